"""The calibrated car: parameters, tolerances and effects from a point of the posterior."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from drift_drake.estimation.problem import NUISANCES, Problem, car
from drift_drake.identification.unknowns import PARAMETERS
from drift_drake.vehicle.effects import Effects, make_effects
from drift_drake.vehicle.parameters import Tolerance, VehicleParameters

ABSOLUTE = ("front_axle_distance", "steering_offset")  # tolerances with a unit; the others are relative
FIELD = {"torque": "gear_ratio"}  # the parameter that a deviation changes, where it has another name


@dataclasses.dataclass(frozen=True)
class Scale:
    """An unknown's value is `origin + factor * theta`, in `unit`."""

    name: str
    origin: float
    factor: float
    unit: str


def scales(problem: Problem, vehicle: VehicleParameters, names: Sequence[str], units: dict[str, str]) -> list[Scale]:
    """How the vehicle's own parameters and the effects `names` follow from theta, in the order of `places`."""
    out = []
    fields = {field.name: field.metadata for field in dataclasses.fields(VehicleParameters)}
    for name in PARAMETERS:
        tolerance = float(problem.tolerance[NUISANCES.index(name)])
        if name == "steering_offset":
            out.append(Scale(name, 0.0, tolerance, "rad"))
            continue
        field = FIELD.get(name, name)
        value = float(getattr(vehicle, field))
        out.append(Scale(field, value, tolerance * (1.0 if name in ABSOLUTE else value), fields[field]["unit"]))
    return out + [Scale(name, 0.0, 1.0, units[name]) for name in names]


def places(problem: Problem, names: Sequence[str]) -> np.ndarray:
    """Indices in theta of the vehicle's own parameters and of the effects `names`."""
    return np.concatenate([np.arange(len(PARAMETERS)), problem.nuisances + np.arange(len(names))])


def calibrated_vehicle(
    problem: Problem, vehicle: VehicleParameters, theta: np.ndarray, names: Sequence[str], deviations: dict[str, float]
) -> tuple[VehicleParameters, Effects]:
    """The vehicle and effects at theta, with posterior standard deviations (in units of `scales`) for tolerances."""
    constants, effects = car(problem, theta, names)
    fixed = ("gravity", "front_coupling", "tyre")
    changes = {name: value for name, value in constants._asdict().items() if name not in fixed}
    if problem.rim_fed:
        changes["rear_axle_inertia"] = vehicle.rear_axle_inertia
    tolerances = {}
    for name in PARAMETERS:
        field = FIELD.get(name, name)
        tolerances[name] = deviations[field] / (1.0 if name in ABSOLUTE else changes[field])
    tolerance: Tolerance = dataclasses.replace(vehicle.tolerance, **tolerances)
    kept = {name: float(getattr(effects, name)) for name in {*names, "steering_offset"}}
    return vehicle.replace(**changes, tolerance=tolerance), make_effects(kept)
