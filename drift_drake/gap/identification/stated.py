"""What an identification is asked, and what it states: parameters with intervals, tolerances, and warnings.

Parameters that a baseline's drives cannot show stay at their first guess, as well known as before.
"""

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np

from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.log.table import Run
from drift_drake.car.parameters import CarParameters, VehicleParameters
from drift_drake.gap.estimation.normal import Normal
from drift_drake.gap.estimation.prior import TOLERANCE_OF, TWO_SIDED
from drift_drake.gap.estimation.unknowns import FIELDS, OWN, folded, magnitudes, unknown
from drift_drake.gap.identification.by_likelihood import stretched
from drift_drake.gap.identification.by_prediction import PredictionFit
from drift_drake.gap.identification.calibration import Calibration, Identification, Parameter, directions, tied
from drift_drake.gap.identification.estimate import Trust
from drift_drake.gap.identification.held_out import HeldOut
from drift_drake.gap.identification.options import EFFECTS, KNOWN, AskedKind, Criterion
from drift_drake.gap.identification.outlook import TIMES

EFFECT_OF = {tolerance: name for name, tolerance in TOLERANCE_OF.items()}
NEVER: list[float | None] = [None] * len(TIMES)
HELD = 1e-6  # of a parameter, or rad: a tolerance that a fit cannot move it by


@dataclasses.dataclass(frozen=True)
class Asked:
    """What is asked of an identification; see `identify`."""

    first: CarParameters  # the first guess
    effects: Effects = Effects()
    case: str = "case"
    known: tuple[str, ...] = KNOWN
    names: tuple[str, ...] = EFFECTS  # effects that may belong to the car, in addition to those of the first guess
    stated: Mapping[str, float] | None = None  # noise levels that are known otherwise (`make_problem`)
    criterion: Criterion = "auto"
    tolerances: frozenset[str] = frozenset()  # that the vehicle file states: prediction believes them, times two
    kind: AskedKind = "auto"
    force: bool = False
    unseen: tuple[str, ...] | None = None
    """Parameters (names of tolerances) that stay as they are; None: those that the drives cannot show."""
    validation: tuple[str, ...] = ()  # stretches that are not fitted (`validation.split`)
    judged: tuple[Run, ...] = ()  # the parts of these that can be used, once they are known

    @property
    def vehicle(self) -> VehicleParameters:
        """The single-track car of the first guess, or the nearest."""
        return self.first.single_track()

    @property
    def kept(self) -> tuple[str, ...]:
        """Parameters that stay as they are, once it is known which."""
        return self.unseen or ()

    def without_unseen(self, names: Sequence[str]) -> list[str]:
        """Effects of these names that the drives may show."""
        return [name for name in names if not ("friction" in self.kept and CATALOGUE[name].at_the_limit)]


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


def held_still(vehicle: VehicleParameters, names: Sequence[str]) -> VehicleParameters:
    """The vehicle with these tolerances so small that a fit leaves their parameters where they are."""
    return vehicle.replace(tolerance=dataclasses.replace(vehicle.tolerance, **dict.fromkeys(names, HELD)))


def kept_at_first_guess(
    found: Identification, vehicle: VehicleParameters, effects: Effects, names: Sequence[str], stated: frozenset[str],
    known: Sequence[str] = (),
) -> Identification:  # fmt: skip
    """The calibration with parameters that were held still stated as they were believed before.

    Args:
        vehicle, effects: the first guess; names: of tolerances; stated: tolerances that the vehicle file states;
        known: those that are believed as they are.
    """
    if not names:
        return found
    c, parameters, changes = found.calibration, dict(found.calibration.parameters), dict[str, float]()
    for name in names:
        effect = EFFECT_OF[name]
        field, prior = FIELDS.get(effect), unknown(effect, vehicle, stated).prior
        prior = max(float(getattr(vehicle.tolerance, name)), HELD) if name in known else prior
        start = float(getattr(vehicle, field) if field else getattr(effects, effect))
        deviation = prior * (start if field and name != "front_axle_distance" else 1.0)
        unit = VehicleParameters.__dataclass_fields__[field].metadata["unit"] if field else CATALOGUE[effect].unit
        half = TWO_SIDED * deviation
        parameters[field or effect] = Parameter(
            unit, start, start, max(start - half, 0.0) if field else start - half, start + half, deviation, deviation,
            1.0, "unseen",
        )  # fmt: skip
        changes[name] = prior
    correlation = extended(np.array(c.correlation), len(parameters))
    calibration = dataclasses.replace(
        c, parameters=parameters, correlation=correlation.tolist(), not_identified=directions(parameters, correlation),
        outlook=c.outlook | {EFFECT_OF[n]: NEVER for n in names if EFFECT_OF[n] in c.outlook},
        normal=None if c.normal is None else widened_unknown(c.normal, {EFFECT_OF[n]: q for n, q in changes.items()}),
    )  # fmt: skip
    tolerance = dataclasses.replace(found.vehicle.tolerance, **changes)
    return dataclasses.replace(found, calibration=calibration, vehicle=found.vehicle.replace(tolerance=tolerance))


def extended(correlation: np.ndarray, count: int) -> np.ndarray:
    """A correlation matrix [count, count] with parameters added that are correlated with none."""
    out = np.eye(count)
    out[: len(correlation), : len(correlation)] = correlation
    return out


def widened_unknown(normal: Normal, priors: dict[str, float]) -> Normal:
    """The baseline where nothing more is known of some effects than `priors`, standard deviations by name."""
    out = {}
    for field in ("unknown", "left_open"):
        covariance = getattr(normal, field)
        factor = np.ones(len(covariance))
        for i, (name, unit) in enumerate(zip(normal.names, normal.units, strict=True)):
            if name in priors:
                factor[i] = max(priors[name] / unit / np.sqrt(max(covariance[i, i], 1e-300)), 1.0)
        out[field] = covariance * np.outer(factor, factor)
    return dataclasses.replace(normal, **out)
