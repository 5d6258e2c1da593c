"""What is known of one effect: a record, and, for an effect from another package, its physics beside it.

Functions of the physics take floats, complex numbers and Drake's scalars alike and are compiled by numba: plain
arithmetic and the functions of `drift_drake.vehicle.scalar` (sin, cos, exp, tanh, sqrt, maximum, select, ...). They
give nothing where the magnitude is zero, and see the car now and nothing of before, but for one state of the effect's
own where it has a `rate`: that state is then their last argument.
"""

import dataclasses
import hashlib
import math
import sys
from collections.abc import Callable, Mapping
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Any, Literal, Protocol, get_args

from drift_drake.errors import DriftDrakeError, one_line, unit_suffix
from drift_drake.vehicle.parameters import Constants, VehicleParameters

Stage = Literal["command", "actuator", "motion", "sensor"]
Command = Literal["delta_cmd", "tau_cmd"]
REFERENCE = VehicleParameters()
LEAST_SIGNED, LEAST_UNSIGNED = 0.2, 0.5  # of the size, or of the low end, of a practical range: below it is no gap
GROUP = "drift_drake.effects"
PHYSICS = {"motion": "force", "actuator": "actuation", "sensor": "reading"}  # of a stage, the function that it needs
FUNCTIONS = (*PHYSICS.values(), "rate", "start")
COMMANDS = get_args(Command)


class Force(Protocol):
    """A further force on the body, of an effect on the motion."""

    def __call__(
        self, r: Any, v: Any, beta: Any, omega_r: Any, psi: Any, car: Constants, magnitude: Any
    ) -> tuple[Any, Any, Any]:
        """(force_x, force_y [N] in the body frame, yaw moment [N m]) from r [rad/s], v [m/s], beta [rad], omega_r
        [m/s], the heading psi [rad] and the car's numbers (mass, yaw_inertia, wheel_radius, gravity, ...)."""


class Actuation(Protocol):
    """A change of what the actuators do, behind their lags."""

    def __call__(self, delta: Any, tau: Any, v: Any, magnitude: Any) -> tuple[Any, Any]:
        """(road-wheel angle [rad], engine torque [N m]) from what they would be without the effect, and v [m/s]."""


class Reading(Protocol):
    """An error of the sensors."""

    def __call__(self, r: Any, beta: Any, omega_r: Any, magnitude: Any) -> tuple[Any, Any, Any]:
        """What is added to the readings of the yaw rate [rad/s], the sideslip [rad] and the rim speed [m/s]."""


class Rate(Protocol):
    """How an effect's own state moves."""

    def __call__(
        self, r: Any, v: Any, beta: Any, omega_r: Any, delta: Any, tau: Any, car: Constants, magnitude: Any, state: Any
    ) -> Any:
        """Its derivative by time, delta [rad] and tau [N m] without the effects of other packages; finite and stable
        at a magnitude of zero, too."""


class Start(Protocol):
    """The state of an effect where a run starts."""

    def __call__(
        self, r: Any, v: Any, beta: Any, omega_r: Any, delta: Any, tau: Any, car: Constants, magnitude: Any
    ) -> Any:
        """That of a car that has driven so for long, arguments as of `Rate`."""


@dataclasses.dataclass(frozen=True)
class Effect:
    """One effect: unit, practical range, where it acts and what it needs to be seen.

    The range is that of the reference car, `VehicleParameters()`; `mass`, `length` and `radius` are the powers of a
    car's mass, wheelbase and wheel radius, beside the reference car's, that scale it. An effect from another package
    has one of `force`, `actuation` and `reading`; beside the first two it may have a state of its own, by
    `rate` and `start`. Or it `delays` a command, and has no function.
    """

    unit: str
    low: float  # end of the practical range
    high: float
    change: str  # in words, of the magnitude q
    stage: Stage = "motion"
    needs: tuple[str, ...] = ()  # columns without which a filter cannot see it
    tolerance: str | None = None  # of the vehicle file, that this effect is a larger deviation of
    spread: bool = False  # magnitudes are spread evenly by their logarithm
    delays: Command | None = None  # the command that reaches the car late by the magnitude [s]: a pure delay
    hastens: tuple[Command, ...] = ()  # commands that reach it earlier than the log says, by the magnitude [s]
    below_zero: str | None = None  # the effect of the size -q that no log tells from this one of a magnitude q < 0
    remembers: tuple[Command, ...] = ()  # commands whose values before the first row matter, beside a delayed one
    mass: float = 0.0
    length: float = 0.0
    radius: float = 0.0
    daily: float = 1.0  # how often it changes from one day to another, beside the others
    of_tyres_or_body: bool = False  # which the equations have in their own way: what it is worth differs by the driving
    varies: bool = False  # by less than a gap from one recording to the next, without anybody touching the car
    shown_by: str = ""  # the manoeuvre that shows it best, in words
    force: Force | None = None
    actuation: Actuation | None = None
    reading: Reading | None = None
    rate: Rate | None = None
    start: Start | None = None

    @property
    def suffix(self) -> str:
        """The unit as it follows a number in a sentence."""
        return unit_suffix(self.unit)

    @property
    def signed(self) -> bool:
        """Whether the magnitude may have either sign."""
        return self.low < 0.0

    def range_for(self, vehicle: VehicleParameters) -> tuple[float, float]:
        """Practical range of the magnitude for a car of another size (1.6 kg to 40 t)."""
        size = (
            (vehicle.mass / REFERENCE.mass) ** self.mass
            * (wheelbase(vehicle) / wheelbase(REFERENCE)) ** self.length
            * (vehicle.wheel_radius / REFERENCE.wheel_radius) ** self.radius
        )
        return self.low * size, self.high * size

    def least_for(self, vehicle: VehicleParameters) -> float:
        """Least absolute value that is a gap to report, for a car of another size."""
        low, high = self.range_for(vehicle)
        return LEAST_SIGNED * max(abs(low), abs(high)) if self.signed else LEAST_UNSIGNED * low


def wheelbase(vehicle: VehicleParameters) -> float:
    """Distance between the axles [m]."""
    return vehicle.front_axle_distance + vehicle.rear_axle_distance


class InvalidExtensionError(DriftDrakeError, ValueError):
    """An effect or a tyre of another package that cannot be used; the message names it and the remedy."""


@cache
def installed_effects() -> dict[str, Effect]:
    """Effects of other packages by name, in the order of their names.

    A package names an effect, an `Effect` with its physics or that `delays` a command, in its pyproject.toml:

        [project.entry-points."drift_drake.effects"]
        side_wind = "my_package.wind:SIDE_WIND"

    Raises:
        InvalidExtensionError: one cannot be imported, or is none.
    """
    points = sorted(entry_points(group=GROUP), key=lambda point: point.name)
    return {point.name: _loaded(point) for point in points}


def loaded(where: str, point: EntryPoint) -> Any:
    """What an entry point names; an InvalidExtensionError, which begins with `where`, if it cannot be imported."""
    try:
        return point.load()
    except Exception as error:
        raise InvalidExtensionError(
            f"{where}: cannot be imported ({one_line(error)}); correct it or uninstall it"
        ) from None


def _loaded(point: EntryPoint) -> Effect:
    where = f"effect {point.name} ({point.value})"
    effect = loaded(where, point)
    if not point.name.isidentifier() or point.name.startswith("_"):
        raise InvalidExtensionError(f"{where}: its name is no name of a variable; choose one such as side_wind")
    if not isinstance(effect, Effect):
        raise InvalidExtensionError(f"{where}: is no drift_drake.Effect; name one in the entry point")
    (_check_delay if effect.delays or effect.hastens else _check_physics)(where, effect)
    return effect


def _check_delay(where: str, effect: Effect) -> None:
    """Sees that a delay is nothing but one, of a command of the logs."""
    functions = [name for name in FUNCTIONS if getattr(effect, name) is not None]
    if effect.hastens:
        raise InvalidExtensionError(
            f"{where}: hastens commands, as the catalogue's own command_clock_error does; use it"
        )
    if effect.delays not in COMMANDS or effect.stage != "command" or functions:
        raise InvalidExtensionError(
            f"{where}: delays '{effect.delays}' at stage '{effect.stage}' with {functions or 'no functions'}; let a "
            f"delay be of {' or '.join(COMMANDS)}, at stage 'command', without functions"
        )
    if not 0.0 < effect.low < effect.high:
        raise InvalidExtensionError(f"{where}: its range begins at {effect.low:g} s; give a delay one above zero")
    if effect.delays == "tau_cmd" and "tau_cmd" not in effect.needs:
        raise InvalidExtensionError(f"{where}: delays the torque; let it need its column (needs=('tau_cmd',))")


def _check_physics(where: str, effect: Effect) -> None:
    """Sees that the effect's function is there, and does nothing at a magnitude of zero."""
    given = [name for name in PHYSICS.values() if getattr(effect, name) is not None]
    wanted = PHYSICS.get(effect.stage, "")
    if given != [wanted]:
        stages = ", ".join(f"{name} for stage '{stage}'" for stage, name in (*PHYSICS.items(), ("command", "delays")))
        raise InvalidExtensionError(f"{where}: has stage '{effect.stage}' and {given or 'no physics'}; give {stages}")
    state = _check_state(where, effect)
    trials: dict[str, tuple[tuple[Any, ...], tuple[float, ...]]] = {
        "force": ((0.1, 12.0, 0.02, 12.1, 0.3, REFERENCE.constants()), (0.0, 0.0, 0.0)),
        "actuation": ((0.05, 100.0, 12.0), (0.05, 100.0)),
        "reading": ((0.1, 0.02, 12.1), (0.0, 0.0, 0.0)),
    }
    arguments, nothing = trials[wanted]
    try:
        found = tuple(float(value) for value in getattr(effect, wanted)(*arguments, 0.0, *state))
    except Exception as error:
        raise InvalidExtensionError(f"{where}: its {wanted} fails ({one_line(error)}); correct it") from None
    if found != nothing:
        raise InvalidExtensionError(
            f"{where}: its {wanted} gives {found} at a magnitude of zero; let it give {nothing}"
        )


def _check_state(where: str, effect: Effect) -> tuple[float, ...]:
    """The state of an effect at a magnitude of zero, if it has one, seen to be finite and so its rate."""
    if effect.rate is None and effect.start is None:
        return ()
    if effect.rate is None or effect.start is None or effect.reading:
        raise InvalidExtensionError(
            f"{where}: a state needs both rate and start, beside a force or an actuation; give both or none"
        )
    moving = (0.1, 12.0, 0.02, 12.1, 0.05, 100.0, REFERENCE.constants(), 0.0)
    try:
        state = float(effect.start(*moving))
        rate = float(effect.rate(*moving, state))
    except Exception as error:
        raise InvalidExtensionError(f"{where}: its rate or start fails ({one_line(error)}); correct it") from None
    if not (math.isfinite(state) and math.isfinite(rate)):
        raise InvalidExtensionError(
            f"{where}: its state {state:g} or rate {rate:g} is not finite at a magnitude of zero; bound its divisor"
        )
    return (state,)


def physics(kind: str) -> list[tuple[str, Callable[..., Any]]]:
    """(name, function) of the installed effects that have a function of this kind (`force`, ..., `start`)."""
    pairs = [(name, getattr(effect, kind)) for name, effect in installed_effects().items()]
    return [(name, function) for name, function in pairs if function is not None]


def fingerprint(tyres: Mapping[str, Callable[..., Any]]) -> str:
    """What other packages' effects and tyres hash to: their names, delays and functions' sources; empty without any."""
    if not installed_effects() and not tyres:
        return ""
    digest = hashlib.sha256()
    for name, effect in installed_effects().items():
        digest.update(f"{name} {effect.delays} ".encode())
    for name, function in [*(pair for kind in FUNCTIONS for pair in physics(kind)), *tyres.items()]:
        source = sys.modules[function.__module__].__file__
        digest.update(name.encode() + (Path(source).read_bytes() if source else b""))
    return digest.hexdigest()[:16]
