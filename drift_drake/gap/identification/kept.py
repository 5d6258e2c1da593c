"""Parameters that a baseline's drives cannot show: they stay at their first guess, as well known as before."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.parameters import VehicleParameters
from drift_drake.gap.estimation.normal import Normal
from drift_drake.gap.estimation.prior import TOLERANCE_OF, TWO_SIDED
from drift_drake.gap.estimation.unknowns import FIELDS, unknown
from drift_drake.gap.identification.calibration import Identification, Parameter, directions
from drift_drake.gap.identification.outlook import TIMES

EFFECT_OF = {tolerance: name for name, tolerance in TOLERANCE_OF.items()}
NEVER: list[float | None] = [None] * len(TIMES)
HELD = 1e-6  # of a parameter, or rad: a tolerance that a fit cannot move it by


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
