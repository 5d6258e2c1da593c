"""One door to the equations of every kind of car, for compiled code that is written once: `gap.estimation.windows`.

A state z holds r [rad/s], v [m/s], beta [rad], omega_r [m/s], psi [rad], then the car's internal states. Commands are
those that reach the car: what actuators make of them is worked out ahead. Which car it is says the type of its numbers,
when code is compiled: each kind's record (`car.kind`) has the functions below.
"""

from collections.abc import Callable
from typing import Any

from numba.extending import overload

from drift_drake.car.brush import equations as brush
from drift_drake.car.brush.parameters import BrushConstants
from drift_drake.car.double_track import equations as double_track
from drift_drake.car.double_track.constants import DoubleTrackConstants
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.foreign.simulator import SimulatorConstants
from drift_drake.car.installed_cars import installed_cars
from drift_drake.car.kind import CarKind
from drift_drake.car.parameters import Constants, InvalidVehicleError
from drift_drake.car.single_track import equations as single_track

CarConstants = Constants | DoubleTrackConstants | BrushConstants | SimulatorConstants

KINDS = (single_track.KIND, double_track.KIND, brush.KIND, *installed_cars())
EQUATIONS: dict[type, CarKind] = {kind.constants: kind for kind in KINDS}
"""By the named tuple of a car's numbers."""
KINDS_BY_KEY = {kind.key: kind for kind in KINDS if kind.key}
"""Cars with states of their own, by the key of a file that holds one."""


def kind_of(constants: CarConstants) -> Any:
    """A car's kind, or a simulator of the user's, which has no equations here but the same names (`CarKind`)."""
    return constants.simulator if isinstance(constants, SimulatorConstants) else EQUATIONS[type(constants)]


def folded_into(constants: CarConstants, effects: Effects) -> tuple[Any, Effects]:
    """A car's numbers with the effects that change them put into them, and the effects that are left."""
    kind = kind_of(constants)
    return kind.changed_constants(constants, effects), effects._replace(**dict.fromkeys(kind.folded, 0.0))


def check_supported(constants: CarConstants, effects: Effects, source: str = "vehicle") -> None:
    """Raises an InvalidVehicleError that names `source` and the effects that a car of this kind cannot have."""
    kind = EQUATIONS[type(constants)]
    if alien := [name for name in kind.lacks if getattr(effects, name) != 0.0]:
        raise InvalidVehicleError(
            f"{source}: {', '.join(alien)} cannot be put on a {kind.label}, whose equations have another place "
            "for it or none; leave it out, or change the car's parameters"
        )


def size_of(constants: CarConstants) -> int:
    """How many states z of this car has."""
    return EQUATIONS[type(constants)].size


def settle(z: Any, delta: Any, torque: Any, constants: Any, effects: Any) -> None:
    """Writes the internal states of a car that has long driven so."""
    EQUATIONS[type(constants)].settle(z, delta, torque, constants, effects)


def rates(z: Any, command: Any, car: Any, out: Any) -> None:
    """Writes the states' rates; command: (delta, torque); car: (constants, effects, further force (F_x, F_y) [N] and
    yaw moment [N m] on the body)."""
    EQUATIONS[type(car[0])].rates(z, command, car, out)


def fastest(z: Any, constants: Any, effects: Any) -> Any:
    """Rate [1/s] of the fastest motion, which sets an integration's steps."""
    return EQUATIONS[type(constants)].fastest(z, constants, effects)


def decays(z: Any, constants: Any, effects: Any, out: Any) -> None:
    """Writes the rates [1/s] at which internal states return to what the motion asks of them, where they are so fast
    that a step has to be implicit in them; others are left."""
    EQUATIONS[type(constants)].decays(z, constants, effects, out)


def cars_in_lanes(numbers: Any, effects: Any, like: Any) -> Any:
    """The numbers and the effects of `lanes` of cars of the kind of `like`, from flat arrays (`flattened`)."""
    return EQUATIONS[type(like)].cars_in_lanes(numbers, effects)


@overload(cars_in_lanes, strict=False, jit_options={"forceinline": True})
def _cars_in_lanes(numbers, effects, like):  # type: ignore[no-untyped-def]  # noqa: ARG001
    of_kind = EQUATIONS[like.instance_class].cars_in_lanes
    return lambda numbers, effects, like: of_kind(numbers, effects)  # noqa: ARG005


def _compiled_by_car(function: Callable[..., Any], constants_of: Callable[..., Any]) -> None:
    """Has compiled code take a function from the module of the car whose numbers it is given."""

    @overload(function, strict=False, jit_options={"forceinline": True})
    def choose(*arguments):  # type: ignore[no-untyped-def]
        return getattr(EQUATIONS[constants_of(*arguments).instance_class], function.__name__)


_compiled_by_car(settle, lambda _z, _delta, _torque, constants, _effects: constants)
_compiled_by_car(rates, lambda _z, _command, car, _out: car[0])
_compiled_by_car(fastest, lambda _z, constants, _effects: constants)
_compiled_by_car(decays, lambda _z, constants, _effects, _out: constants)
