"""A kind of car: the record that plants, step models, predictions, calibration and diagnosis are generated from."""

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any

from drift_drake.car.deviation import Deviation
from drift_drake.car.effects.catalogue import PARAMETRIC
from drift_drake.car.effects.magnitudes import COUNT, NOT_ON_FOUR_WHEELS, Effects
from drift_drake.car.lanes import load_lanes, load_lanes_tuple
from drift_drake.car.scalar import jitable, loaded_tuple

Function = Callable[..., Any]


@jitable
def no_decays(z: Any, constants: Any, effects: Any, out: Any) -> None:
    """Of a car whose own states are stepped."""


def _unflattened(constants: type, count: int) -> Function:
    return jitable(lambda numbers, like=0.0: constants(*loaded_tuple(numbers, 0, count, like)))


def _in_lanes(unflattened: Function) -> Function:
    return jitable(lambda numbers, effects: (unflattened(numbers, load_lanes(numbers, 0)),
                                             Effects(*load_lanes_tuple(effects, 0, COUNT))))  # fmt: skip


@dataclasses.dataclass(frozen=True, kw_only=True)
class CarKind:
    """One kind of car, by the functions of its equations.

    A state z holds r [rad/s], v [m/s], beta [rad], omega_r [m/s], psi [rad], then the car's own states. Functions are
    plain arithmetic and those of `car.scalar` (`select` in place of `if`): they are compiled, for eight cars at once
    too, and evaluated on Drake's scalars. `double_track.equations` and `brush.equations` are two kinds.
    """

    label: str
    """What it is called in a sentence."""
    constants: type
    """A named tuple of its numbers; with the fields mass, gravity, friction and both axle distances."""
    own: tuple[str, ...]
    """Names of its own states; `steering` and `torque` are those of the actuators."""
    own_scale: tuple[float, ...]
    """Their sizes."""
    rates: Function
    """rates(z, command, car, out) writes the states' rates. command: (delta [rad], torque [N m]) that reach the car;
    car: (constants, effects, further force (F_x, F_y) [N] and yaw moment [N m] on the body)."""
    settle: Function
    """settle(z, delta, torque, constants, effects) writes the own states of a car that has long driven so."""
    fastest: Function
    """fastest(z, constants, effects): rate [1/s] of the fastest motion, which sets an integration's steps."""
    changed_constants: Function
    """changed_constants(constants, effects): the numbers with the effects that change them (`effects.changed`)."""
    folded: tuple[str, ...] = tuple(sorted(PARAMETRIC))
    """These effects."""
    stepped: bool = True
    """Whether own states follow a measured motion by the steps of a prediction; else by half an implicit step a row."""
    decays: Function = no_decays
    """decays(z, constants, effects, out): rates [1/s] at which own states return to what the motion asks of them, where
    they are so fast that a step has to be implicit in them."""
    lacks: tuple[str, ...] = NOT_ON_FOUR_WHEELS
    """Effects that mean nothing on it."""
    deviations: Mapping[str, Deviation] = dataclasses.field(default_factory=dict)
    """What a vehicle file says nothing of, by name: of `constants`, unless `value_of` and `deviated` say otherwise."""
    value_of: Function = lambda name, constants: float(getattr(constants, name))
    """value_of(name, constants) of such a quantity."""
    deviated: Any = None
    """deviated(constants, by, effects): the car with them so many standard deviations off."""
    flattened: Function = tuple
    """All numbers of a car in one row."""
    unflattened: Any = None
    """The inverse, unflattened(numbers, like); where `like` is `lanes`, that many cars of a flat array."""
    cars_in_lanes: Any = None
    """cars_in_lanes(numbers, effects): constants and effects of `lanes` of cars, from flat arrays."""
    parameters: type | None = None
    """The dataclass of a file (`parameters.CarParameters`); None for the single-track car."""
    key: str = ""
    """The key of a file that holds it."""
    check: Callable[[Any, str], None] = lambda *_: None
    """check(parameters, source) sees that a car may be some vehicle (InvalidVehicleError)."""

    def __post_init__(self) -> None:
        unflattened = self.unflattened or _unflattened(self.constants, len(getattr(self.constants, "_fields", ())))
        generated = {"unflattened": unflattened, "cars_in_lanes": self.cars_in_lanes or _in_lanes(unflattened),
                     "deviated": self.deviated or self._moved}  # fmt: skip
        for name, value in generated.items():
            object.__setattr__(self, name, value)

    @property
    def size(self) -> int:
        """How many states z has."""
        return 5 + len(self.own)

    def _moved(self, constants: Any, by: Mapping[str, float], effects: Effects) -> Any:  # noqa: ARG002
        return constants._replace(**{name: deviation.moved(self.value_of(name, constants), by[name])
                                     for name, deviation in self.deviations.items() if name in by})  # fmt: skip
