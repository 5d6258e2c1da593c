"""A closed track for cars that grip: two straights and two bends, joined by clothoids."""

import dataclasses
import math
from functools import cache

import numpy as np

from drift_drake.common.arrays import Array
from drift_drake.common.errors import InvalidOptionError
from drift_drake.drive.reference.chain import GRID_SPACING
from drift_drake.drive.reference.path import Path
from drift_drake.drive.reference.trajectory import Reference

HARDEST = 8.0  # [m/s^2] of lateral acceleration that a lane may ask for: tyres on dry asphalt give hardly more
LONGEST = 1000.0  # [m] of a straight, and of a radius


@dataclasses.dataclass(frozen=True)
class Stadium:
    """A stadium to the left, and how fast it is driven.

    Raises:
        InvalidOptionError: a track that does not close, or cannot be driven.
    """

    straight: float = 40.0  # [m], each of two
    radius: float = 20.0  # [m] of both bends, where they are tightest
    transition: float = 12.0  # [m] of each of four clothoids
    lateral: float = 5.0  # [m/s^2] that bounds the speed in bends
    accelerating: float = 2.5  # [m/s^2] out of bends
    braking: float = 0.7  # [m/s^2] into them: the engine alone brakes, with 0.9 at most

    def __post_init__(self) -> None:
        longest = {"straight": LONGEST, "radius": LONGEST, "transition": math.pi * self.radius, "lateral": HARDEST,
                   "accelerating": 10.0, "braking": 10.0}  # fmt: skip
        for name, most in longest.items():
            if not 0.0 < getattr(self, name) < most + 1e-9:
                raise InvalidOptionError(
                    f"the track's {name} is {getattr(self, name):g}; give above 0, up to {most:.4g}"
                )


def stadium_path(track: Stadium) -> Path:
    """The middle of a track, from the beginning of a straight along the x axis: its half turns by pi and closes it.

    In a bend the curvature rises over a transition, stays at 1 / radius, and falls over another one.
    """
    arc = math.pi * track.radius - track.transition
    half = np.cumsum([0.0, track.straight, track.transition, arc, track.transition])
    turn, s = np.array([0.0, 0.0, 1.0, 1.0, 0.0]) / track.radius, np.concatenate([half, half[1:] + half[-1]])
    kept = np.append(True, np.diff(s) > 0.0)  # transitions that meet leave no arc
    return Path(s[kept], np.concatenate([turn, turn[1:]])[kept], closed=True)


def speed_profile(track: Stadium, curvature: Array, spacing: float, fastest: float) -> Array:
    """The fastest speeds [M] [m/s] along a lap that keep to a track's accelerations, each along and across alone.

    Args:
        curvature: of a lap's points [M] [1/m], `spacing` [m] apart, the last one the first again; fastest: [m/s].
    """
    with np.errstate(divide="ignore"):
        squared = np.minimum(track.lateral / np.abs(curvature), fastest**2)[:-1]
    count = len(squared)
    for step, most in ((1, track.accelerating), (-1, track.braking)):
        for i in range(2 * count):  # two laps: the second one begins as the first one ended
            here, after = (step * i) % count, (step * (i + 1)) % count
            squared[after] = min(squared[after], squared[here] + 2.0 * most * spacing)
    return np.sqrt(np.append(squared, squared[0]))


@cache
def stadium(track: Stadium, fastest: float, half_width: float) -> Reference:
    """A track with its speed, gripping, one lap of it.

    Args:
        fastest: speed [m/s] on the straights; half_width: [m] of the lane to either side.
    """
    path = stadium_path(track)
    s = np.linspace(0.0, path.length, math.ceil(path.length / GRID_SPACING) + 1)
    curvature = np.asarray(path.curvature(s), dtype=np.float64)
    v = speed_profile(track, curvature, float(s[1]), fastest)
    zero, lane = np.zeros_like(s), np.full_like(s, half_width)
    return Reference(
        path=path, s=s, v=v, beta=zero, r=curvature * v, omega_r=v, curvature=curvature, delta=zero, tau=zero,
        e_min=-lane, e_max=lane, in_transition=np.zeros(len(s), dtype=bool), distance=path.length,
    )  # fmt: skip
