"""Units by name, and the dimension that each quantity of the log must have."""

import math
from typing import NamedTuple

import numpy as np

from drift_drake.arrays import Array

DIMENSIONS = {  # of a quantity: its SI unit, and the factors to it
    "time": ("s", {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0}),
    "length": ("m", {"m": 1.0, "mm": 1e-3, "cm": 1e-2, "km": 1e3, "ft": 0.3048}),
    "angle": ("rad", {"rad": 1.0, "deg": math.pi / 180.0, "rev": 2.0 * math.pi}),
    "speed": ("m/s", {"m/s": 1.0, "mm/s": 1e-3, "km/h": 1.0 / 3.6, "mph": 0.44704, "kn": 1852.0 / 3600.0}),
    "angular rate": (
        "rad/s",
        {"rad/s": 1.0, "deg/s": math.pi / 180.0, "rpm": math.pi / 30.0, "rev/s": 2.0 * math.pi},
    ),
    "acceleration": ("m/s^2", {"m/s^2": 1.0, "mm/s^2": 1e-3, "g": 9.80665, "mg": 9.80665e-3}),
    "torque": ("N m", {"N m": 1.0, "kN m": 1e3, "lb ft": 1.3558179}),
    "force": ("N", {"N": 1.0, "kN": 1e3}),
    "number": ("-", {"-": 1.0, "%": 0.01}),
}

QUANTITIES = {  # that the importer knows by name; other names are inputs of the mapping's own formulas
    "x": "length",
    "y": "length",
    "psi": "angle",
    "r": "angular rate",
    "v": "speed",
    "vx": "speed",
    "vy": "speed",
    "beta": "angle",
    "omega_r": "speed",
    "ax": "acceleration",
    "ay": "acceleration",
    "az": "acceleration",
    "delta_cmd": "angle",
    "tau_cmd": "torque",
    "bank": "angle",
}
FRAMES = ("iso8855", "ned", "sae")
MIRRORED = ("y", "vy", "ay", "az", "psi", "r", "beta", "delta_cmd")  # what turns its sign where y is right and z down


def dimension(unit: str) -> str | None:
    """Dimension of a unit, None if the unit is unknown."""
    return next((name for name, (_, factors) in DIMENSIONS.items() if unit in factors), None)


def units_of(name: str) -> list[str]:
    """Units that a quantity may be recorded in; of a wheel speed, angular rates too (they take a radius)."""
    kind = QUANTITIES.get(name)
    known = list(DIMENSIONS) if kind is None else [kind, "angular rate"] if name == "omega_r" else [kind]
    return [unit for each in known for unit in DIMENSIONS[each][1]]


def factor(unit: str) -> float:
    """What to multiply with to come to SI."""
    return DIMENSIONS[dimension(unit) or "number"][1][unit]


def to_iso8855(name: str, values: Array, frame: str) -> Array:
    """A quantity of a vehicle or fixed frame in ISO 8855.

    In `ned` (x north, y east, z down; x forward, y right) and `sae` (SAE J670's z-down axes) all that points or turns
    to the right is positive. The fixed frame becomes x north, y west. Quantities that are not mirrored, and names that
    the log does not know, stay as they are.

    Raises:
        ValueError: unknown frame.
    """
    if frame not in FRAMES:
        raise ValueError(f"unknown frame '{frame}'; known frames are {', '.join(FRAMES)}")
    return -values if frame != "iso8855" and name in MIRRORED else values


class PlanarMotion(NamedTuple):
    """Planar motion of a point of the body: position [m] and velocity, acceleration in the body frame, arrays [n]."""

    x: Array
    y: Array
    vx: Array
    vy: Array
    ax: Array
    ay: Array


def to_body(psi: Array, x: Array, y: Array) -> tuple[Array, Array]:
    """Components along and across the heading psi [rad] of a vector (x, y) of the fixed frame."""
    return x * np.cos(psi) + y * np.sin(psi), -x * np.sin(psi) + y * np.cos(psi)


def at_centre_of_gravity(
    point: PlanarMotion, offset: tuple[float, float], psi: Array, r: Array, r_dot: Array
) -> PlanarMotion:
    """The motion of the centre of gravity of a rigid body from that of the point `offset` (x, y) [m] ahead and left."""
    along, across = offset
    return PlanarMotion(
        x=point.x - along * np.cos(psi) + across * np.sin(psi),
        y=point.y - along * np.sin(psi) - across * np.cos(psi),
        vx=point.vx + r * across,
        vy=point.vy - r * along,
        ax=point.ax + r_dot * across + r**2 * along,
        ay=point.ay - r_dot * along + r**2 * across,
    )
