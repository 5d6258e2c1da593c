"""What stands for the real car: the single-track car with effects, or one that no single-track car follows."""

from typing import Literal

from drift_drake.control.double_track_step import DoubleTrackStepModel
from drift_drake.control.effects_step import EffectsStepModel, planned_with
from drift_drake.vehicle.double_track.motion import NOT_OF_THIS_CAR
from drift_drake.vehicle.double_track.parameters import CARS
from drift_drake.vehicle.double_track.plant import DoubleTrackPlant
from drift_drake.vehicle.effects import Effects
from drift_drake.vehicle.parameters import VehicleParameters
from drift_drake.vehicle.path_plant import CurvedPath, PathPlant
from drift_drake.vehicle.step_model import StepModel

TruePlant = Literal["single_track", "double_track"]


def effects_on(plant: TruePlant, drawn: Effects) -> Effects:
    """Those of the drawn effects that the car can have: the double-track one has load transfer and more of its own."""
    return drawn if plant == "single_track" else drawn._replace(**dict.fromkeys(NOT_OF_THIS_CAR, 0.0))


def plant_of(plant: TruePlant, effects: Effects, path: CurvedPath | None) -> PathPlant | None:
    """The plant on a path, or on none: the double-track coupe; None for `Car`'s own, of the simulator's equations."""
    return None if plant == "single_track" else DoubleTrackPlant(CARS["coupe"], effects, path)


def oracle_of(plant: TruePlant, parameters: VehicleParameters, effects: Effects) -> StepModel:
    """The step model that knows what of the car can be planned with; `parameters`: of the single-track one."""
    if plant == "double_track":
        return DoubleTrackStepModel(CARS["coupe"], planned_with(effects))
    return EffectsStepModel(parameters, planned_with(effects), exact=False)
