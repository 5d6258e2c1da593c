"""What is known of one effect: a record, and, for an effect from another package, its physics.

Functions of the physics take floats, complex numbers and Drake's scalars alike and are compiled by numba: plain
arithmetic and the functions of `drift_drake.car.scalar` (sin, cos, exp, tanh, sqrt, maximum, select, ...). They
give nothing where the magnitude is zero, and see the car now and nothing of before, but for one state of the effect's
own where it has a `rate`: that state is then their last argument.
"""

import dataclasses
from collections.abc import Mapping
from typing import Any, Literal, NamedTuple, Protocol, get_args

from drift_drake.car.parameters import Constants, VehicleParameters
from drift_drake.common.errors import DriftDrakeError, unit_suffix

Stage = Literal["command", "actuator", "motion", "sensor"]
Command = Literal["delta_cmd", "tau_cmd"]
Fit = Literal["further", "drives", "alone", "double_track"]
"""Methods that look for an effect unasked: a calibration, where held-out prediction asks for it; the car that drives
identify; the same car with this effect alone as well; a double-track car."""
REFERENCE = VehicleParameters()
LEAST_SIGNED, LEAST_UNSIGNED = 0.2, 0.5  # of the size, or of the low end, of a practical range: below it is no gap
PHYSICS = {"motion": "force", "actuator": "actuation", "sensor": "reading"}  # of a stage, the function that it needs
READ = ("r", "v", "beta", "omega_r")  # readings that sensors' effects change
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


class Distribution(NamedTuple):
    """A normal distribution cut at `low` and `high`; a standard deviation of infinity makes it uniform."""

    mean: float
    deviation: float
    low: float
    high: float


def normal(deviation: float, bound: float, mean: float = 0.0) -> Distribution:
    """A normal distribution cut at `bound` from its mean."""
    return Distribution(mean, deviation, mean - bound, mean + bound)


def uniform(low: float, high: float) -> Distribution:
    """A uniform distribution."""
    return Distribution(0.5 * (low + high), float("inf"), low, high)


class ParameterChange(NamedTuple):
    """What an effect of magnitude q does to a car's parameter: times (1 + sign q), or plus sign q where it is a length.

    The parameter has the name that a simulator file's `meaning` gives it.
    """

    meaning: str
    sign: float = 1.0
    relative: bool = True


@dataclasses.dataclass(frozen=True)
class Effect:
    """One effect: unit, practical range, where it acts and what it needs to be seen.

    The range is that of the reference car, `VehicleParameters()`; `mass`, `length` and `radius` are the powers of a
    car's mass, wheelbase and wheel radius, relative to the reference car's, that scale it. An effect from another
    package has one of `force`, `actuation` and `reading`; with the first two it may have a state of its own, by
    `rate` and `start`. Or it `delays` a command, and has no function.

    Examples:
        >>> CATALOGUE["steering_lag"].unit, CATALOGUE["steering_lag"].stage
        ('s', 'actuator')
    """

    unit: str
    low: float  # [unit] end of the practical range
    high: float  # [unit] its other end
    change: str  # in words, of the magnitude q
    stage: Stage = "motion"  # of the loop, where it acts
    needs: tuple[str, ...] = ()  # columns without which a filter cannot see it
    tolerance: str | None = None  # of the vehicle file, that this effect is a larger deviation of
    spread: bool = False  # magnitudes are spread evenly by their logarithm
    delays: Command | None = None  # the command that reaches the car late by the magnitude [s]: a pure delay
    hastens: tuple[Command, ...] = ()  # commands that reach it earlier than the log says, by the magnitude [s]
    below_zero: str | None = None  # the effect of the size -q that no log tells from this one of a magnitude q < 0
    remembers: tuple[
        Command, ...
    ] = ()  # commands whose values before the first row matter, in addition to a delayed one
    mass: float = 0.0  # [-] power of the car's mass that scales the range
    length: float = 0.0  # [-] of its wheelbase
    radius: float = 0.0  # [-] of its wheel radius
    daily: float = 1.0  # [-] how often it changes from one day to another, relative to the others
    of_tyres_or_body: bool = False  # which the equations have in their own way: what it is worth differs by the driving
    moves_loads: bool = False  # static loads of the axles, times (1 + q) or by a shift of q [m] backwards
    varies: bool = False  # by less than a gap from one recording to the next, without anybody touching the car
    shown_by: str = ""  # the manoeuvre that shows it; a text of `effects.manoeuvres` joins its group
    distinguished_from: Mapping[str, str] = dataclasses.field(default_factory=dict)
    """Effects that act alike in most driving, and the manoeuvre that distinguishes them from this one."""
    factor: bool = False  # something is multiplied by 1 + q, which stays above zero
    share: bool = False  # of the friction that it takes: below one
    possible: tuple[float, float] | None = None  # [unit] that a vehicle can have; else several times the range
    limit: bool = False  # an upper limit: it acts more the smaller it is
    saturates: bool = False  # increases and decreases have different effects
    asked: bool = False  # a sentence of a `none` states its detection limit
    watched: bool = False  # and one of a watch's "nothing has changed": a loss of friction, gains, lags, biases
    at_the_limit: bool = False  # it shows at the limit of grip alone
    scales: Literal["r", "v", "beta", "omega_r"] | None = None  # the reading that is multiplied by 1 + q
    resists: bool = False  # it brakes the car, like less torque
    rolls: bool = False  # its worth depends on roll and pitch, which the equations lack
    of_road: bool = False  # a property of the road, of no car
    late: bool = False  # readings are late by the magnitude [s]; `sensor_latency` alone
    double_track: Literal["effect", "parameter", "nothing"] = "effect"  # on a double-track car
    fitted: tuple[Fit, ...] = ()  # by default: "further" in a calibration, "drives", "alone" in `choose`
    drawn: Distribution | None = None  # magnitudes of the simulated vehicles that a model is trained on
    drawn_out_of_distribution: Distribution | None = (
        None  # of vehicles out of that distribution, where `drawn` has none
    )
    changes: tuple[ParameterChange, ...] = ()  # of a simulator's parameters, by which it acts there
    any_of_them: bool = False  # one of these parameters is enough for
    by_torque: bool = False  # that another command to the engine does, too
    since: int = 1  # version of the package's own catalogue, by which vectors of magnitudes are ordered
    force: Force | None = None  # on the body
    actuation: Actuation | None = None  # of the commands
    reading: Reading | None = None  # added by the sensors
    rate: Rate | None = None  # of a state of its own
    start: Start | None = None  # that state where a run starts

    @property
    def suffix(self) -> str:
        """The unit as it follows a number in a sentence."""
        return unit_suffix(self.unit)

    @property
    def signed(self) -> bool:
        """Whether the magnitude may have either sign."""
        return self.low < 0.0

    @property
    def rolled(self) -> bool:
        """Whether the magnitude is a length that a tyre rolls before its force follows."""
        return self.spread and self.unit == "m"

    def range_for(self, vehicle: VehicleParameters) -> tuple[float, float]:
        """Practical range [unit] of the magnitude for a vehicle of another size (1.6 kg to 40 t)."""
        size = (
            (vehicle.mass / REFERENCE.mass) ** self.mass
            * (wheelbase(vehicle) / wheelbase(REFERENCE)) ** self.length
            * (vehicle.wheel_radius / REFERENCE.wheel_radius) ** self.radius
        )
        return self.low * size, self.high * size

    def least_for(self, vehicle: VehicleParameters) -> float:
        """Least absolute value [unit] that is a gap to report, for a vehicle of another size."""
        low, high = self.range_for(vehicle)
        return LEAST_SIGNED * max(abs(low), abs(high)) if self.signed else LEAST_UNSIGNED * low


def wheelbase(vehicle: VehicleParameters) -> float:
    """Distance between the axles [m]."""
    return vehicle.front_axle_distance + vehicle.rear_axle_distance


class InvalidExtensionError(DriftDrakeError, ValueError):
    """An effect or a tyre of another package that cannot be used; the message names it and the remedy."""
