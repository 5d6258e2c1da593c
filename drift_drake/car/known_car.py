"""A car of either kind as a plant, and as what a controller plans with that knows it: a model of one step."""

from drift_drake.car.double_track.parameters import DoubleTrackParameters
from drift_drake.car.double_track.plant import DoubleTrackPlant
from drift_drake.car.double_track.step_model import DoubleTrackStepModel
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.internal_states import planned_with
from drift_drake.car.parameters import CarParameters
from drift_drake.car.single_track.effects_step import EffectsStepModel
from drift_drake.car.single_track.path_plant import CurvedPath, PathPlant
from drift_drake.car.single_track.plant import VehiclePlant
from drift_drake.car.step_model import STEP


def plant_of_car(car: CarParameters, effects: Effects, path: CurvedPath | None) -> PathPlant:
    """Its plant, on a path or on none."""
    if isinstance(car, DoubleTrackParameters):
        return DoubleTrackPlant(car, effects, path)
    return VehiclePlant(car, effects, path)


def known_car_model(
    vehicle: CarParameters, effects: Effects, dt: float = STEP
) -> EffectsStepModel | DoubleTrackStepModel:
    """The car of either kind with what of its effects can be planned with (`internal_states.planned_with`).

    dt: [s] of a step of a single-track car; a double-track one has its own.
    """
    if isinstance(vehicle, DoubleTrackParameters):
        return DoubleTrackStepModel(vehicle, planned_with(effects))
    return EffectsStepModel(vehicle.single_track(), planned_with(effects), dt)
