"""What stands for the real car: the single-track car with effects, or one that no single-track car follows."""

from typing import Literal

from drift_drake.car.double_track.motion import NOT_OF_THIS_CAR
from drift_drake.car.double_track.parameters import CARS, DoubleTrackParameters
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.known_car import known_car_model
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.single_track.path_plant import CurvedPath, PathPlant
from drift_drake.car.step_model import StepModel
from drift_drake.drive.loop.car import plant_of_car

TruePlant = Literal["single_track", "double_track", "roadster", "rear_engined", "saloon"]
"""The car of the simulator's equations, or a double-track one: the coupe of its size, or a car of another kind."""


def double_track_of(plant: TruePlant) -> DoubleTrackParameters | None:
    """The double-track car; None for the single-track one."""
    return None if plant == "single_track" else CARS["coupe" if plant == "double_track" else plant]


def effects_on(plant: TruePlant, drawn: Effects) -> Effects:
    """Those of the drawn effects that the car can have: a double-track one has load transfer and more of its own."""
    return drawn if plant == "single_track" else drawn._replace(**dict.fromkeys(NOT_OF_THIS_CAR, 0.0))


def plant_of(plant: TruePlant, effects: Effects, path: CurvedPath | None) -> PathPlant | None:
    """The plant on a path, or on none; None for `Car`'s own, of the simulator's equations."""
    car = double_track_of(plant)
    return None if car is None else plant_of_car(car, effects, path)


def oracle_of(plant: TruePlant, parameters: VehicleParameters, effects: Effects) -> StepModel:
    """The step model that knows what of the car can be planned with; `parameters`: of the single-track one."""
    return known_car_model(double_track_of(plant) or parameters, effects)
