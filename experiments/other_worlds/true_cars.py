"""What stands for the real car when drifting: the package's plants, or cars that it has no equations of.

Brush cars, CommonRoad's multi-body cars and MuJoCo's are drawn one by one; the last two are other programs'.
"""

from typing import Literal, NamedTuple

from drift_drake.car.brush.parameters import BrushParameters
from drift_drake.car.double_track.parameters import CARS, DoubleTrackParameters
from drift_drake.car.effects.catalogue import OFF_THE_MOTION
from drift_drake.car.effects.magnitudes import NOT_ON_FOUR_WHEELS, Effects
from drift_drake.car.foreign.stepped_plant import SteppedCar, SteppedPlant
from drift_drake.car.known_car import known_car_model, plant_of_car
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.path_plant import CurvedPath, PathPlant
from drift_drake.car.step_model import StepModel
from drift_drake.common.errors import InvalidOptionError, MissingExtraError
from experiments.other_worlds.brush_drifters import draw_drifter
from experiments.other_worlds.multi_body import draw_multi_body

OwnCar = Literal["single_track", "double_track", "roadster", "rear_engined", "saloon"]
"""The car of the simulator's equations, or a double-track one: the coupe of its size, or a car of another kind."""
World = Literal[OwnCar, "brush", "multi_body", "mujoco"]


class Stepped(NamedTuple):
    """A car of another program, by its place in a draw: it is made where it drives."""

    world: Literal["multi_body", "mujoco"]
    vehicle: int
    seed: int

    def made(self, friction: float = 1.0) -> SteppedCar:
        """The car, on tyres whose friction is multiplied by a factor.

        Raises:
            MissingExtraError: its program is not installed.
        """
        if self.world == "multi_body":
            return draw_multi_body(self.vehicle, self.seed, friction)
        try:
            from experiments.other_worlds.mujoco_drifter import draw_mujoco
        except ImportError:
            raise MissingExtraError("the MuJoCo car", "mujoco", "worlds") from None
        return draw_mujoco(self.vehicle, self.seed, friction)


TrueCar = OwnCar | BrushParameters | Stepped


def true_car(world: World, vehicle: int, seed: int) -> TrueCar:
    """What a vehicle of a draw is; cars that the package has no equations of are drawn one by one."""
    if world == "multi_body" or world == "mujoco":
        return Stepped(world, vehicle, seed)
    return draw_drifter(vehicle, seed) if world == "brush" else world


def effects_in(world: World, drawn: Effects) -> Effects:
    """Those of the drawn effects that a car of this world can have."""
    if world == "multi_body" or world == "mujoco":
        return drawn._replace(**{name: 0.0 for name in Effects._fields if name not in OFF_THE_MOTION})
    # A double-track car has load transfer and more of its own.
    return drawn if world == "single_track" else drawn._replace(**dict.fromkeys(NOT_ON_FOUR_WHEELS, 0.0))


def double_track_of(car: OwnCar) -> DoubleTrackParameters | None:
    """The double-track car; None for the single-track one."""
    return None if car == "single_track" else CARS["coupe" if car == "double_track" else car]


def true_plant(car: TrueCar, effects: Effects, path: CurvedPath | None) -> PathPlant | None:
    """The car on a path, or on none; None for `Car`'s own plant, of the simulator's equations."""
    if isinstance(car, Stepped):
        return SteppedPlant(car.made(), path)
    own = car if isinstance(car, BrushParameters) else double_track_of(car)
    return None if own is None else plant_of_car(own, effects, path)


def oracle(car: TrueCar, parameters: VehicleParameters, effects: Effects) -> StepModel:
    """The step model that knows the car; `parameters`: of the single-track one.

    Raises:
        InvalidOptionError: nobody has the car's equations.
    """
    if isinstance(car, Stepped):
        raise InvalidOptionError(f"--models oracle: nobody has the equations of a {car.world} car; leave it out")
    own = car if isinstance(car, BrushParameters) else double_track_of(car)
    return known_car_model(own or parameters, effects)
