"""Signals of a simulator: their names, and how its own numbers become SI and ISO 8855."""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from drift_drake.car.parameters import InvalidVehicleError, as_number, is_number
from drift_drake.common.arrays import Array
from drift_drake.common.errors import meant, shown
from drift_drake.common.units import DIMENSIONS, unit_of

MOTION = {"r": "angular rate", "v": "speed", "v_x": "speed", "v_y": "speed", "beta": "angle", "omega_r": "speed",
          "psi": "angle"}  # fmt: skip
LEAD_IN = "lead_in"  # 1 while a window is led in, then 0; with a channel's name behind it: as measured
INPUTS = {  # by what a log calls them: dimension
    "steering": "angle", "torque": "torque", "force_x": "force", "force_y": "force", "yaw_moment": "torque",
    "measured_speed": "speed", "measured_yaw_rate": "angular rate", LEAD_IN: "number",
} | {f"{LEAD_IN}_{name}": dimension for name, dimension in MOTION.items() if name != "psi"}  # fmt: skip
KEYS = ("name", "unit", "ratio", "sign", "offset")


class SimulatorSignal(NamedTuple):
    """One input, output or start value; the simulator's own number is `factor` times that in SI, plus `offset`."""

    name: str
    factor: float = 1.0
    offset: float = 0.0

    def own(self, si: Any) -> Any:
        """The simulator's number of one in SI."""
        return self.factor * si + self.offset

    def si(self, own: Any) -> Any:
        """The other way."""
        return (own - self.offset) / self.factor


def in_channels(motion: Array) -> dict[str, Array]:
    """Motion r, v, beta, omega_r, psi [..., 5] by channel, v_x and v_y besides."""
    r, v, beta, omega_r, psi = (motion[..., i] for i in range(5))
    found = {"r": r, "v": v, "v_x": v * np.cos(beta), "v_y": v * np.sin(beta), "beta": beta}
    return found | {"omega_r": omega_r, "psi": psi}


def signals_of(data: Any, place: str, known: Mapping[str, str], wheel_radius: float) -> dict[str, SimulatorSignal]:
    """The signals that a part of a simulator file names.

    Args:
        data: a name, or `name`, `unit`, `ratio`, `sign` and `offset`, by quantity; place: file and key, for messages;
        known: quantities that there are, with their dimensions; wheel_radius: [m], of rims whose rate is given.

    Raises:
        InvalidVehicleError: names the place and the remedy.
    """
    if not isinstance(data, dict):
        raise InvalidVehicleError(f"{place}: must hold 'quantity: name in the simulator' lines")
    for key in data:
        if key not in known:
            raise InvalidVehicleError(f"{place}: unknown quantity {shown(key)}; {meant(str(key), known)}")
    return {key: signal_of(value, f"{place}.{key}", key, known[key], wheel_radius) for key, value in data.items()}


def signal_of(value: Any, place: str, quantity: str, dimension: str, wheel_radius: float) -> SimulatorSignal:
    """One signal; see `signals_of`."""
    if isinstance(value, str):
        return SimulatorSignal(value)
    if not isinstance(value, dict) or not isinstance(value.get("name"), str):
        raise InvalidVehicleError(
            f"{place}: is {shown(value)}; give its name in the simulator, or name:, unit:, ratio:, sign: and offset:"
        )
    for key in value:
        if key not in KEYS:
            raise InvalidVehicleError(f"{place}: unknown key {shown(key)}; known keys are {', '.join(KEYS)}")
    ratio, sign, offset = (
        as_number(value.get(key, usual)) for key, usual in (("ratio", 1), ("sign", 1), ("offset", 0))
    )
    for key, number in (("ratio", ratio), ("sign", sign), ("offset", offset)):
        if not is_number(number) or (key == "ratio" and number == 0.0) or (key == "sign" and number not in (1, -1)):
            wanted = {"sign": "1 or -1", "ratio": "a number other than zero"}.get(key, "a finite number")
            raise InvalidVehicleError(f"{place}.{key}: is {shown(number)}; give {wanted}")
    size = _unit_size(value.get("unit"), place, quantity, dimension, wheel_radius)
    return SimulatorSignal(value["name"], float(sign) * float(ratio) / size, float(offset))


def _unit_size(unit: Any, place: str, quantity: str, dimension: str, wheel_radius: float) -> float:
    """SI units in one of the simulator's."""
    if unit is None:
        return 1.0
    kinds = (dimension, "angular rate") if quantity.endswith("omega_r") else (dimension,)
    found = unit_of(unit, kinds) if isinstance(unit, str) else None
    if found is None or not math.isfinite(found.factor):
        own = ", ".join(name for kind in kinds for name in DIMENSIONS[kind][1])
        raise InvalidVehicleError(f"{place}.unit: {shown(unit)} is none of {quantity}; give one of {own}")
    return found.factor * (wheel_radius if found.dimension != dimension else 1.0)
