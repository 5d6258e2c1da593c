"""What the simulator believes of the car: parameters with units, from YAML, validated."""

import dataclasses
import math
from pathlib import Path
from typing import Any, ClassVar, NamedTuple, Protocol, Self, TypeVar

import numpy as np
import yaml

from drift_drake.common.arrays import Array
from drift_drake.common.errors import DriftDrakeError, shown
from drift_drake.common.plain_files import LARGEST_YAML, parse_yaml, read_text
from drift_drake.common.safe_files import write_text

OPTIONAL = ("front_coupling", "tyre", "tolerance")  # keys that a vehicle file may leave out
WORDS = ("tyre", "tolerance")  # that are no numbers


LEAST_TOLERANCE = 1e-9  # that is not zero: deviations are counted in tolerances
RELATIVE = (  # parameters that a relative tolerance has the name of
    "mass", "yaw_inertia", "wheel_radius", "rear_axle_inertia", "friction", "front_stiffness", "rear_stiffness",
)  # fmt: skip


class InvalidVehicleError(DriftDrakeError, ValueError):
    """A vehicle file that cannot be used; the message names the file, the key and the remedy."""


class Constants(NamedTuple):
    """The numbers that the equations of motion read (SI), in the form that compiled code takes."""

    mass: Any
    yaw_inertia: Any
    front_axle_distance: Any
    rear_axle_distance: Any
    wheel_radius: Any
    rear_axle_inertia: Any
    gear_ratio: Any
    friction: Any
    front_stiffness: Any
    rear_stiffness: Any
    gravity: Any
    front_coupling: Any
    tyre: Any  # place in `tyre.TYRES`


def entry(unit: str, symbol: str, default: float, positive: bool = True) -> Any:
    """A field of a vehicle's dataclass with its unit and symbol."""
    return dataclasses.field(default=default, metadata={"unit": unit, "symbol": symbol, "positive": positive})


@dataclasses.dataclass(frozen=True)
class Tolerance:
    """One standard deviation of what is known of the vehicle: relative [-], unless a unit is given.

    A gap of this size is no gap to report; the diagnosis treats it as a nuisance.

    Examples:
        >>> VehicleParameters(tolerance=Tolerance(friction=0.05)).tolerance.friction
        0.05
    """

    mass: float = 0.01
    yaw_inertia: float = 0.03
    front_axle_distance: float = 0.01  # [m], the rear axle's moving the other way
    wheel_radius: float = 0.002
    rear_axle_inertia: float = 0.05
    gear_ratio: float = 0.0
    torque: float = 0.02
    friction: float = 0.01
    front_stiffness: float = 0.03
    rear_stiffness: float = 0.03
    steering_offset: float = 0.001  # [rad]


class CarParameters(Protocol):
    """A car of any kind by its parameters; `car.equations` finds its equations by the type of its constants."""

    @property
    def tolerance(self) -> Tolerance:
        """What is known of it."""

    def constants(self) -> Any:
        """The numbers that its equations read."""

    def with_constants(self, constants: Any) -> Self:
        """A copy with these numbers, validated; raises InvalidVehicleError."""

    def replace(self, **changes: Any) -> Self:
        """A copy with some parameters changed, validated."""

    def single_track(self) -> "VehicleParameters":
        """The nearest single-track car, of the same tolerance: sizes and limits."""

    def to_dict(self) -> dict[str, Any]:
        """Plain data, as in a vehicle file."""


SomeCar = TypeVar("SomeCar", bound=CarParameters)


class PlainCar:
    """A base of dataclasses of cars whose constants are fields of theirs, all plain numbers.

    `key`: of the vehicle file that holds one; `numbers`: the named tuple of its constants.
    """

    key: ClassVar[str]
    numbers: ClassVar[type[Any]]

    def constants(self) -> Any:
        """The part of the parameters that the equations of motion read."""
        return self.numbers(*(float(getattr(self, name)) for name in self.numbers._fields))

    def with_constants(self, constants: Any) -> Self:
        """The car with other numbers in its equations, validated again; raises InvalidVehicleError."""
        return self.replace(**{name: float(value) for name, value in constants._asdict().items()})

    def replace(self, **changes: Any) -> Self:
        """A copy with some parameters changed, validated again."""
        return dataclasses.replace(self, **changes)  # type: ignore[type-var]

    def to_dict(self) -> dict[str, Any]:
        """Plain data, as in a vehicle file."""
        return {self.key: dataclasses.asdict(self)}  # type: ignore[call-overload]


@dataclasses.dataclass(frozen=True)
class VehicleParameters:
    """A single-track car, driven at the rear or at both axles. Defaults: a plausible coupe, no measured vehicle.

    `front_coupling` ties the front rim to the rear's: 0 is rear-wheel drive (the front rolls freely), 1 one shaft for
    both axles; in between, the front rim takes over that share of the difference in speed. `rear_axle_inertia` and the
    torque are then those of the whole driveline. A file may leave it out; and so `tyre`, which names one of another
    package (`car.tyre`). `tolerance` says how well each number is known.

    Raises:
        InvalidVehicleError: a number that no car has; it names the parameter and the range.

    Examples:
        >>> VehicleParameters(mass=1210.0).replace(friction=0.9).mass
        1210.0
    """

    mass: float = entry("kg", "m", 1650.0)
    yaw_inertia: float = entry("kg m^2", "I_z", 2350.0)
    front_axle_distance: float = entry("m", "a", 1.23)
    rear_axle_distance: float = entry("m", "b", 1.24)
    wheel_radius: float = entry("m", "R_w", 0.337)
    rear_axle_inertia: float = entry("kg m^2", "I_w", 20.0)
    gear_ratio: float = entry("-", "G", 10.6)
    friction: float = entry("-", "mu", 1.0)
    front_stiffness: float = entry("N per unit slip", "C_f", 1.4e5)
    rear_stiffness: float = entry("N per unit slip", "C_r", 2.2e5)
    gravity: float = entry("m/s^2", "g", 9.81)
    front_coupling: float = entry("-", "c_f", 0.0, positive=False)
    steering_limit: float = entry("rad", "delta_max", 0.66)
    torque_min: float = entry("N m", "tau_min", -50.0, positive=False)
    torque_max: float = entry("N m", "tau_max", 450.0, positive=False)
    tyre: str = "brush"
    tolerance: Tolerance = dataclasses.field(default_factory=Tolerance)

    def __post_init__(self) -> None:
        check_numbers(self)
        check_torques(self.torque_min, self.torque_max)
        if not 0.0 <= self.front_coupling <= 1.0:
            raise InvalidVehicleError(
                f"front_coupling is {self.front_coupling:g}; give 0 (rear-wheel drive) to 1 (one shaft for both axles)"
            )
        if self.steering_limit >= math.pi / 2:
            raise InvalidVehicleError(f"steering_limit is {self.steering_limit:g} rad; give it in radians, below pi/2")
        self._tyre_place()
        check_tolerance(self.tolerance)

    def command_limits(self) -> tuple[Array, Array]:
        """Least and greatest command (delta [rad], tau [N m])."""
        return np.array([-self.steering_limit, self.torque_min]), np.array([self.steering_limit, self.torque_max])

    def constants(self) -> Constants:
        """The part of the parameters that the equations of motion read; InvalidVehicleError where the tyre is gone."""
        numbers = {name: float(getattr(self, name)) for name in Constants._fields if name not in WORDS}
        return Constants(**numbers, tyre=self._tyre_place())

    def _tyre_place(self) -> float:
        if self.tyre == "brush":
            return 0.0
        from drift_drake.car.tyre import TYRES  # which needs Drake, as a vehicle file need not

        if self.tyre not in list(TYRES):  # a file may hold anything, what has no hash too
            raise InvalidVehicleError(
                f"tyre is {shown(self.tyre)}; give one of {', '.join(TYRES)}, or install the package that has it"
            )
        return float(list(TYRES).index(self.tyre))

    def single_track(self) -> "VehicleParameters":
        """The car itself."""
        return self

    def replace(self, **changes: Any) -> "VehicleParameters":
        """A copy with some parameters changed; raises InvalidVehicleError as the class does."""
        return dataclasses.replace(self, **changes)

    def with_constants(self, constants: Constants) -> "VehicleParameters":
        """A copy with these constants, its tyre as it is; raises InvalidVehicleError as the class does."""
        return self.replace(**{name: float(value) for name, value in constants._asdict().items() if name != "tyre"})

    def to_dict(self) -> dict[str, Any]:
        """Plain data (SI), the inverse of `from_dict`; the brush tyre is left out."""
        data = dataclasses.asdict(self)
        return data if self.tyre != "brush" else {name: value for name, value in data.items() if name != "tyre"}

    @classmethod
    def from_dict(cls, data: dict[str, Any], source: str = "vehicle") -> "VehicleParameters":
        """Parameters from plain data; every parameter but those of `OPTIONAL` must be there, none may be unknown.

        Raises:
            InvalidVehicleError: names `source`, the key and the remedy.
        """
        parameters: VehicleParameters = read_plain(cls, data, source)
        return parameters

    @classmethod
    def from_yaml(cls, path: str | Path) -> "VehicleParameters":
        """Parameters from the path of a vehicle file.

        Raises:
            InvalidVehicleError: names the file, the key and the remedy.
        """
        return cls.from_dict(vehicle_data(path), str(path))

    def to_yaml(self, path: str | Path) -> None:
        """Writes a vehicle file that `from_yaml` reads back to the same parameters; OutputError where it cannot."""
        write_text(path, yaml.safe_dump(self.to_dict(), sort_keys=False))


def read_plain(kind: Any, data: Any, source: str, place: str = "") -> Any:
    """A dataclass of numbers, words and such dataclasses, by name: all but tolerances and those of `OPTIONAL`.

    Args:
        kind: the dataclass; data: as a file holds it; source: what an error names; place: in the source, of a part.

    Raises:
        InvalidVehicleError: names `source`, the key and the remedy.
    """
    if not isinstance(data, dict):
        if not place:
            raise InvalidVehicleError(f"{source}: expected 'name: value' lines, found {type(data).__name__}")
        what = "standard deviation" if kind is Tolerance else "value"
        raise InvalidVehicleError(f"{source}: '{place}' must hold 'name: {what}' lines")
    inner = f"{place}." if place else ""
    types = {field.name: field.type for field in dataclasses.fields(kind)}
    check_keys(source, inner, data, set(types), set() if kind is Tolerance else set(types) - set(OPTIONAL))
    values: dict[str, Any] = {}
    for name, value in data.items():
        of = types[name]
        if isinstance(of, type) and dataclasses.is_dataclass(of):
            values[name] = read_plain(of, value, source, inner + name)
        else:
            values[name] = value if of is str else as_number(value)
    try:
        return kind(**values)
    except InvalidVehicleError as error:
        raise InvalidVehicleError(f"{source}: {inner}{error}") from None


def vehicle_data(path: str | Path) -> Any:
    """What a vehicle file holds, as plain data.

    Raises:
        InvalidVehicleError: it cannot be read, or is no YAML.
    """
    text = read_text(path, InvalidVehicleError, "give the path of a vehicle file", LARGEST_YAML)
    return parse_yaml(text, InvalidVehicleError, str(path), "write one 'name: value' a line")


def as_number(value: Any) -> Any:
    """`1.4e5` is text to YAML 1.1 (it wants `1.4e+5`), but a number to everyone who writes it."""
    if isinstance(value, str):
        try:
            return float(value)
        except ValueError:
            return value
    return value


def is_number(value: Any) -> bool:
    """Whether a value is a number that arithmetic in double precision can take."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return False
    try:
        return math.isfinite(value)
    except OverflowError:
        return False


def check_numbers(parameters: Any) -> None:
    """Raises InvalidVehicleError where a value is no finite number, or not positive as its `entry` asks."""
    for field in dataclasses.fields(parameters):
        if not field.metadata:
            continue
        value, unit, symbol = getattr(parameters, field.name), field.metadata["unit"], field.metadata["symbol"]
        if not is_number(value):
            raise InvalidVehicleError(f"{field.name} ({symbol}) is {shown(value)}; give a finite number in {unit}")
        if field.metadata["positive"] and value <= 0.0:
            raise InvalidVehicleError(f"{field.name} ({symbol}) is {value:g}; it must be positive, in {unit}")


def check_tolerance(tolerance: Tolerance) -> None:
    """Raises InvalidVehicleError where a tolerance is no standard deviation."""
    for name, value in vars(tolerance).items():
        if not is_number(value) or value < 0.0:
            raise InvalidVehicleError(f"tolerance.{name} is {shown(value)}; give a standard deviation, zero or more")
        if 0.0 < value < LEAST_TOLERANCE:
            raise InvalidVehicleError(
                f"tolerance.{name} is {shown(value)}; give 0 for exactly known, or {LEAST_TOLERANCE:g} or more"
            )


def check_torques(low: float, high: float) -> None:
    """Sees that there is a torque between the limits; raises InvalidVehicleError where there is none."""
    if low >= high:
        raise InvalidVehicleError(f"torque_min ({low:g} N m) must lie below torque_max ({high:g} N m)")


def check_keys(
    source: str, prefix: str, data: dict[str, Any], known: set[str], required: set[str] | None = None
) -> None:
    """Raises InvalidVehicleError, which names `source` and the key, where one is unknown or a required one missing."""
    for key in data:
        if key not in known:
            text = shown(key).strip("'")
            raise InvalidVehicleError(
                f"{source}: unknown key '{prefix}{text}'; known keys are {', '.join(sorted(known))}"
            )
    missing = sorted((required or set()) - set(data))
    if missing:
        raise InvalidVehicleError(
            f"{source}: missing {', '.join(f'{prefix}{key}' for key in missing)}; add a line for each"
        )
