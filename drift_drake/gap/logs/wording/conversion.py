"""The dimension that each quantity of the log must have, its units, and frames turned into ISO 8855."""

from typing import NamedTuple

import numpy as np

from drift_drake.common.arrays import Array
from drift_drake.common.units import DIMENSIONS, OTHER, unit_of

QUANTITIES = {  # that the importer knows by name; other names are inputs of the mapping's own formulas
    "x": "length",
    "y": "length",
    "psi": "angle",
    "latitude": "angle",
    "longitude": "angle",
    "course": "angle",
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
MIRRORED = (
    "y",
    "vy",
    "ay",
    "az",
    "psi",
    "course",
    "r",
    "beta",
    "delta_cmd",
)  # what turns its sign where y is right and z down


def dimension(unit: str) -> str | None:
    """Dimension of a unit, None if no quantity has it, or the unit is unknown."""
    found = unit_of(unit)
    return None if found is None or found.dimension == OTHER else found.dimension


def dimensions_of(name: str) -> tuple[str, ...]:
    """Dimensions that a quantity may be recorded in; of a wheel speed, angular rates too (they take a radius)."""
    kind = QUANTITIES.get(name)
    return tuple(DIMENSIONS) if kind is None else (kind, "angular rate") if name == "omega_r" else (kind,)


def units_of(name: str) -> list[str]:
    """Units of the table that a quantity may be recorded in."""
    return [unit for kind in dimensions_of(name) for unit in DIMENSIONS[kind][1]]


def factor(unit: str, kinds: tuple[str, ...] = tuple(DIMENSIONS)) -> float:
    """What to multiply with to come to SI, of a unit of one of these dimensions.

    Raises:
        ValueError: unknown unit.
    """
    found = unit_of(unit, kinds)
    if found is None:
        raise ValueError(f"unknown unit '{unit}'; known are the units of {', '.join(kinds)}")
    return found.factor


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
