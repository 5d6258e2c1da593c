"""A car of any kind as a plant, and as what a controller plans with that knows it: a model of one step."""

from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.equations_plant import EquationsPlant
from drift_drake.car.equations_step import EquationsStepModel
from drift_drake.car.internal_states import planned_with
from drift_drake.car.parameters import CarParameters, VehicleParameters
from drift_drake.car.path_plant import CurvedPath, PathPlant
from drift_drake.car.single_track.effects_step import EffectsStepModel
from drift_drake.car.single_track.plant import VehiclePlant
from drift_drake.car.step_model import STEP


def plant_of_car(car: CarParameters, effects: Effects, path: CurvedPath | None) -> PathPlant:
    """Its plant, on a path or on none."""
    return (VehiclePlant if isinstance(car, VehicleParameters) else EquationsPlant)(car, effects, path)


def known_car_model(
    vehicle: CarParameters, effects: Effects, dt: float = STEP
) -> EffectsStepModel | EquationsStepModel:
    """The car of any kind with what of its effects can be planned with (`internal_states.planned_with`).

    dt: [s] of a step.
    """
    if isinstance(vehicle, VehicleParameters):
        return EffectsStepModel(vehicle, planned_with(effects), dt)
    return EquationsStepModel(vehicle, planned_with(effects), dt)
