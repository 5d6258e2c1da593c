"""A car whose equations are a simulator of the user's, read from a simulator file."""

import dataclasses
import hashlib
import json
import math
from pathlib import Path
from typing import Any

from drift_drake.car.deviation import Deviation
from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.car.foreign.signals import INPUTS, MOTION, signals_of
from drift_drake.car.foreign.simulator import FORCES, MEANINGS, STEERING, Simulator, SimulatorConstants
from drift_drake.car.parameters import (
    InvalidVehicleError,
    Tolerance,
    VehicleParameters,
    as_number,
    check_keys,
    is_number,
)
from drift_drake.car.vehicle_file import SIMULATOR
from drift_drake.common.errors import meant, shown

KINDS = ("python", "drake", "fmu")
OPTIONS = {"step": 0.01, "lead_in": 0.0, "limit": 2.0}  # [s] that hold where the file says nothing
LONGEST = {"step": 0.1, "lead_in": 5.0, "limit": 600.0}  # [s]
KEYS = {*KINDS, *OPTIONS, "folder", "batch", "set_state", "windows", "inputs", "outputs", "start", "parameters",
        "meaning", "unknown"}  # fmt: skip


@dataclasses.dataclass(frozen=True)
class SimulatorCar:
    """A simulator with its parameters' values; `car`: its sizes, limits and tolerances as a single-track car's."""

    simulator: Simulator
    values: tuple[float, ...]
    car: VehicleParameters

    @property
    def tolerance(self) -> Tolerance:
        return self.car.tolerance

    def constants(self) -> SimulatorConstants:
        return SimulatorConstants(self.simulator, self.values, self.car.constants())

    def with_constants(self, constants: SimulatorConstants) -> "SimulatorCar":
        for name, value in constants.by_name().items():
            if not math.isfinite(value):
                raise InvalidVehicleError(f"{SIMULATOR}.parameters.{name}: came out as {value}, which is no number")
        return dataclasses.replace(self, values=constants.values, car=self.car.with_constants(constants.about))

    def replace(self, **changes: Any) -> "SimulatorCar":
        """A copy with another tolerance; other parameters are changed through `with_constants`."""
        return dataclasses.replace(self, car=self.car.replace(**changes))

    def single_track(self) -> VehicleParameters:
        return self.car

    @property
    def source_hash(self) -> str:
        """SHA-256 of the FMU, or of the module's file where it lies in the simulator's folder; empty elsewhere."""
        s = self.simulator
        path = Path(s.target if s.kind == "fmu" else f"{s.folder}/{s.target.partition(':')[0].replace('.', '/')}.py")
        return hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else ""

    def to_dict(self) -> dict[str, Any]:
        """Plain data, as in a simulator file; the torque's ratio holds the gain that was found."""
        data, constants = self.simulator.data, self.constants()
        data["parameters"] = constants.by_name()
        if constants.torque_gain != 1.0:
            torque = data["inputs"]["torque"]
            torque = {"name": torque} if isinstance(torque, str) else dict(torque)
            data["inputs"]["torque"] = torque | {"ratio": float(torque.get("ratio", 1.0)) * constants.torque_gain}
        return {SIMULATOR: data, "car": self.car.to_dict()}


def read_simulator(data: dict[str, Any], path: str | Path) -> SimulatorCar:
    """The car of a simulator file's plain data.

    Raises:
        InvalidVehicleError: names the file, the key and the remedy.
    """
    source = str(path)
    check_keys(source, "", data, {SIMULATOR, "car", "effects"}, {SIMULATOR, "car"})
    car = _car_of(data["car"], path)
    given = data[SIMULATOR]
    if not isinstance(given, dict):
        raise InvalidVehicleError(f"{source}: '{SIMULATOR}' must hold 'name: value' lines")
    check_keys(source, f"{SIMULATOR}.", given, KEYS, {"inputs", "outputs"})
    place = f"{source}: {SIMULATOR}"
    kind, target = _target(given, place)
    folder = (Path(path).resolve().parent / str(given.get("folder", "."))).resolve()
    target = str((folder / target).resolve()) if kind == "fmu" else target
    options = {name: _seconds(given.get(name, usual), f"{place}.{name}", LONGEST[name])
               for name, usual in OPTIONS.items()}  # fmt: skip
    inputs = signals_of(given["inputs"], f"{place}.inputs", INPUTS, car.wheel_radius)
    outputs = signals_of(given["outputs"], f"{place}.outputs", MOTION, car.wheel_radius)
    start = signals_of(given.get("start", given["outputs"]), f"{place}.start", MOTION, car.wheel_radius)
    _check_signals(place, set(inputs), set(outputs), set(start), options["lead_in"])
    values = _values(given.get("parameters") or {}, place)
    written = given | {kind: target, "folder": str(folder)}
    windows = given.get("windows", 0)
    if not isinstance(windows, int) or isinstance(windows, bool) or windows < 0:
        raise InvalidVehicleError(f"{place}.windows: is {shown(windows)}; give a whole number, or leave it out")
    simulator = Simulator(
        kind=kind, target=target, folder=str(folder), batch=given.get("batch", False) is True,
        set_state=str(given.get("set_state", "")), windows=windows, inputs=inputs, outputs=outputs, start=start,
        parameters=tuple(values), meaning=_meaning(given.get("meaning") or {}, place, values),
        unknown=_unknown(given.get("unknown") or {}, place, values), reference_gear=car.gear_ratio,
        written=json.dumps(written), **options,
    )  # type: ignore[arg-type]  # fmt: skip
    return SimulatorCar(simulator, tuple(values.values()), car)


def _car_of(data: Any, path: str | Path) -> VehicleParameters:
    """The single-track car that is about the simulator's: in the file, or a vehicle file that it names."""
    if isinstance(data, str):
        return VehicleParameters.from_yaml(Path(path).parent / data)
    return VehicleParameters.from_dict(data, f"{path}: car")


def _target(given: dict[str, Any], place: str) -> tuple[Any, str]:
    named = [kind for kind in KINDS if kind in given]
    if len(named) != 1:
        raise InvalidVehicleError(
            f"{place}: names {len(named)} simulators; give one of python: MODULE:FUNCTION, drake: MODULE:FUNCTION, "
            "fmu: FILE"
        )
    target = given[named[0]]
    if not isinstance(target, str) or (named[0] != "fmu" and len(target.split(":")) != 2):
        wanted = "an FMU's path" if named[0] == "fmu" else "MODULE:FUNCTION"
        raise InvalidVehicleError(f"{place}.{named[0]}: is {shown(target)}; give {wanted}")
    return named[0], target


def _seconds(value: Any, place: str, longest: float) -> float:
    value = as_number(value)
    if not is_number(value) or not 0.0 <= value <= longest or (value == 0.0 and not place.endswith("lead_in")):
        raise InvalidVehicleError(f"{place}: is {shown(value)}; give seconds, up to {longest:g}")
    return float(value)


def _check_signals(place: str, inputs: set[str], outputs: set[str], start: set[str], lead_in: float) -> None:
    """Sees that there is what a prediction needs."""
    if STEERING not in inputs:
        raise InvalidVehicleError(f"{place}.inputs: steering is missing; name the input of the road-wheel angle")
    if "torque" not in inputs:
        raise InvalidVehicleError(f"{place}.inputs: torque is missing; name the input of the engine's torque")
    if "r" not in outputs or not ({"v_x", "v_y"} <= outputs or {"v", "beta"} <= outputs):
        raise InvalidVehicleError(
            f"{place}.outputs: r with v and beta, or r with v_x and v_y, are needed; name the simulator's outputs"
        )
    if not start & {"v", "v_x"}:
        raise InvalidVehicleError(f"{place}.start: a window starts at the measured speed; name what sets v, or v_x")
    settable = {"r", "v_x", "v_y"} <= start or {"r", "v", "beta"} <= start
    if not settable and lead_in == 0.0 and not {"measured_speed", "measured_yaw_rate"} & inputs:
        raise InvalidVehicleError(
            f"{place}.start: r and the sideslip (beta, or v_y) cannot be set; give lead_in: 0.3, seconds in which they "
            "settle before each window"
        )
    if len(inputs & set(FORCES)) == 1 and "yaw_moment" not in inputs:
        raise InvalidVehicleError(f"{place}.inputs: force_x and force_y belong together; name both, or none")


def _values(given: Any, place: str) -> dict[str, float]:
    if not isinstance(given, dict):
        raise InvalidVehicleError(f"{place}.parameters: must hold 'name: value' lines")
    values = {str(name): as_number(value) for name, value in given.items()}
    for name, value in values.items():
        if not is_number(value):
            raise InvalidVehicleError(f"{place}.parameters.{name}: is {shown(value)}; give a finite number")
    return {name: float(value) for name, value in values.items()}


def _meaning(given: Any, place: str, values: dict[str, float]) -> dict[str, tuple[str, ...]]:
    if not isinstance(given, dict):
        raise InvalidVehicleError(f"{place}.meaning: must hold 'mass: name of the parameter' lines")
    out: dict[str, tuple[str, ...]] = {}
    for key, names in given.items():
        if key not in MEANINGS:
            raise InvalidVehicleError(f"{place}.meaning: unknown quantity {shown(key)}; {meant(str(key), MEANINGS)}")
        out[key] = tuple(str(name) for name in ([names] if isinstance(names, str) else names or ()))
        for name in out[key]:
            if name not in values:
                raise InvalidVehicleError(f"{place}.meaning.{key}: no parameter {shown(name)}; {_there(name, values)}")
    if "friction" in out and {"front_friction", "rear_friction"} & set(out):
        raise InvalidVehicleError(f"{place}.meaning: friction is of both axles; give it, or front_ and rear_friction")
    return out


def _unknown(given: Any, place: str, values: dict[str, float]) -> dict[str, Deviation]:
    if not isinstance(given, dict):
        raise InvalidVehicleError(f"{place}.unknown: must hold 'parameter: relative standard deviation' lines")
    out: dict[str, Deviation] = {}
    for name, spread in given.items():
        if name not in values:
            raise InvalidVehicleError(f"{place}.unknown: no parameter {shown(name)}; {_there(str(name), values)}")
        if name in CATALOGUE:
            raise InvalidVehicleError(f"{place}.unknown.{name}: is the name of an effect; give the parameter another")
        absolute = isinstance(spread, dict)
        size = as_number(spread.get("deviation") if absolute else spread)
        if not is_number(size) or size <= 0.0:
            raise InvalidVehicleError(f"{place}.unknown.{name}: is {shown(spread)}; give a standard deviation, say 0.2")
        if not absolute and values[name] <= 0.0:
            raise InvalidVehicleError(
                f"{place}.unknown.{name}: a share of {values[name]:g} is none; give {{deviation: standard deviation in "
                "its own unit}"
            )
        out[name] = Deviation("-", float(size), not absolute, -math.inf if absolute else 0.0)
    return out


def _there(name: str, values: dict[str, float]) -> str:
    return meant(name, values) if values else "give its value under parameters:"
