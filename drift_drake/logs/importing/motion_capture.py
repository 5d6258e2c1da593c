"""Speed, sideslip, yaw rate and accelerations of the centre of gravity from a body's measured position and heading."""

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray

from drift_drake.logs.importing.frames import PlanarMotion, at_centre_of_gravity, to_body
from drift_drake.logs.importing.smoothing import smooth

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class Stretch:
    """All signals of the log's clock, and what is derived from them, at times t [n] [s]; at the centre of gravity.

    `noise`: standard deviation of one reading (SI), by signal; `std`: the columns' typical ones after smoothing;
    `bandwidth` [Hz]: of the smoothers, up to which position and heading are taken for motion.
    """

    t: Array
    columns: dict[str, Array]
    noise: dict[str, float]
    std: dict[str, float]
    bandwidth: dict[str, float]


def captured_motion(
    t: Array, x: Array, y: Array, psi: Array, measured_point: tuple[float, float], highest: float = math.inf
) -> Stretch:
    """Differentiates a stretch of motion capture (NaN where a frame is missing) and moves it to the centre of gravity.

    Its columns are x, y, psi, r, v, beta, ax, ay; its noise is of position [m] and heading [rad].

    highest: frequency [Hz] of motion; what is faster is taken for noise.

    Raises:
        ValueError: too few readings.
    """
    position, heading = smooth(t, np.stack([x, y], axis=1), highest), smooth(t, psi, highest)
    psi, r, r_dot = heading.value[:, 0], heading.rate[:, 0], heading.acceleration[:, 0]
    (x, y), (x_dot, y_dot), (x_ddot, y_ddot) = position.value.T, position.rate.T, position.acceleration.T
    point = PlanarMotion(x, y, *to_body(psi, x_dot, y_dot), *to_body(psi, x_ddot, y_ddot))
    centre = at_centre_of_gravity(point, measured_point, psi, r, r_dot)
    v = np.hypot(centre.vx, centre.vy)
    speed_std = float(np.median(position.std[:, 1]))
    heading_std, r_std = (float(np.median(heading.std[:, i])) for i in (0, 1))
    return Stretch(
        t=t,
        columns={
            "x": centre.x,
            "y": centre.y,
            "psi": psi,
            "r": r,
            "v": v,
            "beta": np.unwrap(np.arctan2(centre.vy, centre.vx)),
            "ax": centre.ax,
            "ay": centre.ay,
        },
        noise={"position": position.noise, "heading": heading.noise},
        std={
            "x": float(np.median(position.std[:, 0])),
            "y": float(np.median(position.std[:, 0])),
            "psi": heading_std,
            "r": r_std,
            "v": speed_std,
            "beta": float(np.hypot(speed_std / max(float(np.median(v)), 0.1), heading_std)),
        },
        bandwidth={"position": position.bandwidth, "heading": heading.bandwidth},
    )
