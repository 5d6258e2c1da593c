"""A fit by prediction as a calibration: parameters with intervals, tolerances, and what is to be warned of."""

import dataclasses
from collections.abc import Mapping

from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.car.parameters import VehicleParameters
from drift_drake.gap.estimation.prior import TWO_SIDED
from drift_drake.gap.estimation.unknowns import FIELDS, OWN, folded, magnitudes
from drift_drake.gap.identification.asked import Asked
from drift_drake.gap.identification.by_likelihood import stretched
from drift_drake.gap.identification.by_prediction import PredictionFit
from drift_drake.gap.identification.calibration import Calibration, Identification, Parameter, directions, tied
from drift_drake.gap.identification.estimate import Trust
from drift_drake.gap.identification.held_out import HeldOut
from drift_drake.gap.identification.kept import extended


def stated_in_full(found: PredictionFit, why: list[str], asked: Asked, rows: int) -> Identification:
    """Parameters, tolerances and the file, all of one fit by prediction; `why`: that was the criterion."""
    parameters: dict[str, Parameter] = {}
    changes: dict[str, float] = {}
    start, _ = folded(asked.vehicle, asked.effects)
    left, car = found.left_open, found.vehicle.single_track()
    theta = magnitudes(found.fit.names, found.fit.theta)
    for u, sigma, wide in zip(found.unknowns, left.deviations, left.stated, strict=True):
        info = CATALOGUE[u.name]
        field = FIELDS.get(u.name)
        scale = 1.0 if field is None or info.unit != "-" else float(getattr(start, field))
        first = float(getattr(start, field)) if field else float(getattr(asked.effects, u.name))
        value = float(getattr(car, field)) if field else first + theta[u.name]
        prior, sigma, wide = (float(min(q, u.prior)) * scale for q in (u.prior, sigma, wide))
        low, high = value - TWO_SIDED * wide, value + TWO_SIDED * wide
        low = max(low, 0.0) if not info.signed or (field and info.unit == "-") else low
        unit = VehicleParameters.__dataclass_fields__[field].metadata["unit"] if field else info.unit
        kind = "free" if u.name in OWN else "effect"
        parameters[field or u.name] = Parameter(unit, first, value, low, high, wide, prior, 1.0, kind)
        if info.tolerance:
            changes[info.tolerance] = sigma / (value if info.unit == "-" else 1.0)
    parameters |= found.of_kind
    correlation = extended(left.correlation, len(parameters))
    calibration = Calibration(
        case=asked.case, parameters=parameters, correlation=correlation.tolist(),
        not_identified=directions(parameters, correlation), tied=tied(list(parameters), correlation),
        left_out=list(found.left_out), held_out=found.held_out, trust=Trust(1.0, 1.0), tempering=1.0, discrepancy=None,
        seconds=0.0, warnings=[*why, *found.remarks, *worse_states(found.held_out), *beyond_stated(parameters, asked),
                               *left.sentences],
        criterion="prediction", normal=found.normal, disagreed=left.disagreed, outlook=found.outlook,
    )  # fmt: skip
    tolerance = dataclasses.replace(found.vehicle.tolerance, **changes)
    return Identification(calibration, found.vehicle.replace(tolerance=tolerance), found.effects, rows)


def beyond_stated(parameters: Mapping[str, Parameter], asked: Asked) -> list[str]:
    """Warnings of parameters that came out more than three times the tolerance that the vehicle file states."""
    tolerances = {}
    for name in OWN:
        info, field = CATALOGUE[name], FIELDS.get(name, name)
        if info.tolerance in asked.tolerances and field in parameters:
            tolerance = float(getattr(asked.vehicle.tolerance, info.tolerance))
            tolerances[field] = tolerance * (parameters[field].start if info.unit == "-" else 1.0)
    return stretched({name: dataclasses.replace(parameters[name], kind="known", prior=max(tolerance, 1e-12))
                      for name, tolerance in tolerances.items()})  # fmt: skip


def worse_states(h: HeldOut) -> list[str]:
    """Warnings of states that the calibrated car predicts worse than the first guess."""
    rows = zip(h.states, h.before[-1], h.after[-1], strict=True)
    return [f"{state} is predicted worse than by the first guess ({after:.3g}, {before:.3g} before)"
            for state, before, after in rows if state in h.worse]  # fmt: skip
