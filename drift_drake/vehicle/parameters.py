"""What the simulator believes of the car: parameters with units, from YAML, validated."""

import dataclasses
import math
from pathlib import Path
from typing import Any, NamedTuple

import yaml

OPTIONAL = ("front_coupling", "tolerance")  # keys that a vehicle file may leave out


class InvalidVehicleError(ValueError):
    """A vehicle file that cannot be used; the message names the file, the key and the mend."""


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


def entry(unit: str, symbol: str, default: float, positive: bool = True) -> Any:
    """A field of a vehicle's dataclass with its unit and symbol."""
    return dataclasses.field(default=default, metadata={"unit": unit, "symbol": symbol, "positive": positive})


@dataclasses.dataclass(frozen=True)
class Tolerance:
    """One standard deviation of what is known of the vehicle: relative, unless a unit is given.

    A gap of this size is no gap to report; the diagnosis treats it as a nuisance.
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


@dataclasses.dataclass(frozen=True)
class VehicleParameters:
    """A single-track car, driven at the rear or at both axles. Defaults: a plausible coupe, no measured vehicle.

    `front_coupling` ties the front rim to the rear's: 0 is rear-wheel drive (the front rolls freely), 1 one shaft for
    both axles; in between, the front rim takes over that share of the difference in speed. `rear_axle_inertia` and the
    torque are then those of the whole driveline. A file may leave it out.
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
    tolerance: Tolerance = dataclasses.field(default_factory=Tolerance)

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            if field.name == "tolerance":
                continue
            check_number(field.name, getattr(self, field.name), field.metadata)
        if self.torque_min >= self.torque_max:
            raise InvalidVehicleError(
                f"torque_min ({self.torque_min:g} N m) must lie below torque_max ({self.torque_max:g} N m)"
            )
        if not 0.0 <= self.front_coupling <= 1.0:
            raise InvalidVehicleError(
                f"front_coupling is {self.front_coupling:g}; give 0 (rear-wheel drive) to 1 (one shaft for both axles)"
            )
        if self.steering_limit >= math.pi / 2:
            raise InvalidVehicleError(f"steering_limit is {self.steering_limit:g} rad; give it in radians, below pi/2")
        for field in dataclasses.fields(self.tolerance):
            value = getattr(self.tolerance, field.name)
            if not _is_number(value) or value < 0.0:
                raise InvalidVehicleError(
                    f"tolerance.{field.name} is {value!r}; give a standard deviation, zero or more"
                )

    def constants(self) -> Constants:
        """The part of the parameters that the equations of motion read."""
        return Constants(*(float(getattr(self, name)) for name in Constants._fields))

    def replace(self, **changes: Any) -> "VehicleParameters":
        """A copy with some parameters changed, validated again."""
        return dataclasses.replace(self, **changes)

    def to_dict(self) -> dict[str, Any]:
        """Plain data, the inverse of `from_dict`."""
        return dataclasses.asdict(self)

    @classmethod
    def from_dict(cls, data: dict[str, Any], source: str = "vehicle") -> "VehicleParameters":
        """Parameters from plain data; every parameter but those of `OPTIONAL` must be there, none may be unknown.

        Raises:
            InvalidVehicleError: names `source`, the key and the mend.
        """
        if not isinstance(data, dict):
            raise InvalidVehicleError(f"{source}: expected 'name: value' lines, found {type(data).__name__}")
        known = {field.name: field for field in dataclasses.fields(cls)}
        _check_keys(source, "", data, set(known), required=set(known) - set(OPTIONAL))
        tolerance = data.get("tolerance", {})
        if not isinstance(tolerance, dict):
            raise InvalidVehicleError(f"{source}: 'tolerance' must hold 'name: standard deviation' lines")
        _check_keys(source, "tolerance.", tolerance, {field.name for field in dataclasses.fields(Tolerance)})
        values = {key: _number(value) for key, value in data.items() if key != "tolerance"}
        try:
            return cls(**values, tolerance=Tolerance(**{key: _number(value) for key, value in tolerance.items()}))
        except InvalidVehicleError as error:
            raise InvalidVehicleError(f"{source}: {error}") from None

    @classmethod
    def from_yaml(cls, path: str | Path) -> "VehicleParameters":
        """Parameters from a vehicle file.

        Raises:
            InvalidVehicleError: names the file, the key and the mend.
        """
        try:
            text = Path(path).read_text(encoding="utf-8")
        except UnicodeDecodeError:
            raise InvalidVehicleError(f"{path}: not a text file; give the path of a vehicle file in YAML") from None
        except OSError as error:
            raise InvalidVehicleError(
                f"{path}: cannot be read ({error.strerror}); give the path of a vehicle file"
            ) from None
        try:
            data = yaml.safe_load(text)
        except yaml.YAMLError as error:
            where = getattr(error, "problem_mark", None)
            line = f" at line {where.line + 1}" if where else ""
            raise InvalidVehicleError(f"{path}: not valid YAML{line}; write one 'name: value' a line") from None
        return cls.from_dict(data, str(path))

    def to_yaml(self, path: str | Path) -> None:
        """Writes a vehicle file that `from_yaml` reads back to the same parameters."""
        Path(path).write_text(yaml.safe_dump(self.to_dict(), sort_keys=False), encoding="utf-8")


def _number(value: Any) -> Any:
    """`1.4e5` is text to YAML 1.1 (it wants `1.4e+5`), but a number to everyone who writes it."""
    if isinstance(value, str):
        try:
            return float(value)
        except ValueError:
            return value
    return value


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)


def check_number(name: str, value: Any, metadata: Any) -> None:
    """Holds a value against what `entry` says of its field.

    Raises:
        InvalidVehicleError: not a finite number, or not positive where it must be.
    """
    unit, symbol = metadata["unit"], metadata["symbol"]
    if not _is_number(value):
        raise InvalidVehicleError(f"{name} ({symbol}) is {value!r}; give a finite number in {unit}")
    if metadata["positive"] and value <= 0.0:
        raise InvalidVehicleError(f"{name} ({symbol}) is {value:g}; it must be positive, in {unit}")


def _check_keys(
    source: str, prefix: str, data: dict[str, Any], known: set[str], required: set[str] | None = None
) -> None:
    for key in data:
        if key not in known:
            raise InvalidVehicleError(
                f"{source}: unknown key '{prefix}{key}'; known keys are {', '.join(sorted(known))}"
            )
    missing = sorted((required or set()) - set(data))
    if missing:
        raise InvalidVehicleError(
            f"{source}: missing {', '.join(f'{prefix}{key}' for key in missing)}; add a line for each"
        )
