"""What stands for the real car when drifting: the package's plants, or brush cars, which it has no equations of."""

from typing import Literal

from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.single_track.effects_step import planned_with
from drift_drake.car.single_track.path_plant import CurvedPath, PathPlant
from drift_drake.car.step_model import StepModel
from drift_drake.drive.loop.true_plant import TruePlant, effects_on, oracle_of, plant_of
from experiments.other_worlds.brush_car import BrushCar
from experiments.other_worlds.brush_drifters import draw_drifter
from experiments.other_worlds.brush_plant import BrushPlant
from experiments.other_worlds.brush_step import BrushStepModel

World = Literal[TruePlant, "brush"]
TrueCar = TruePlant | BrushCar


def true_car(world: World, vehicle: int, seed: int) -> TrueCar:
    """What a vehicle of a draw is; brush cars are drawn one by one."""
    return draw_drifter(vehicle, seed) if world == "brush" else world


def effects_in(world: World, drawn: Effects) -> Effects:
    """Those of the drawn effects that a car of this world can have."""
    return effects_on("double_track" if world == "brush" else world, drawn)


def true_plant(car: TrueCar, effects: Effects, path: CurvedPath) -> PathPlant | None:
    """The car on a path; None for `Car`'s own plant, of the simulator's equations."""
    return BrushPlant(car, effects, path) if isinstance(car, BrushCar) else plant_of(car, effects, path)


def oracle(car: TrueCar, parameters: VehicleParameters, effects: Effects) -> StepModel:
    """The step model that knows the car; `parameters`: of the single-track one."""
    if isinstance(car, BrushCar):
        return BrushStepModel(car, planned_with(effects))
    return oracle_of(car, parameters, effects)
