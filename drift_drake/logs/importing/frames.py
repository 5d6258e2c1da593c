"""Other axes to ISO 8855 (x forward, y left, z up), and the motion of the measured point to the centre of gravity."""

from typing import NamedTuple

import numpy as np

from drift_drake.arrays import Array

FRAMES = ("iso8855", "ned", "sae")
MIRRORED = ("y", "vy", "ay", "az", "psi", "r", "beta", "delta_cmd")  # what turns its sign where y is right and z down


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
