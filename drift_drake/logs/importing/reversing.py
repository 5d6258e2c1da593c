"""Where a car reverses: the single-track model knows forward driving and spins, so those rows are cut and reported."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from drift_drake.logs.driving import spans

Array = NDArray[np.float64]

BACKWARDS = 0.5  # [m/s] of backward velocity that noise explains
STANDING = 2.0  # [m/s] at the change of direction: a car that reverses has stopped before, one that spins has not
SHORTEST = 0.1  # [s]


def reversing_parts(columns: Mapping[str, Array], period: float) -> list[slice]:
    """Rows in which the car reverses; none of a car that never drives forwards, whose sign or heading is wrong.

    Args:
        columns: of the log [n], with `vx`, `vy` where they are known; period: time between rows [s].
    """
    v, beta = columns["v"], columns.get("beta", np.zeros_like(columns["v"]))
    along = columns.get("vx", v * np.cos(beta))
    speed = np.hypot(along, columns.get("vy", v * np.sin(beta)))
    backwards = along < -BACKWARDS
    if backwards.mean() > 0.95:
        return []
    return [
        slice(a, b)
        for a, b in spans(backwards)
        if (b - a) * period >= SHORTEST and min(speed[max(a - 1, 0)], speed[min(b, len(v) - 1)]) < STANDING
    ]


def forward_parts(count: int, left_out: list[slice]) -> list[slice]:
    """The rest of `count` rows, in order."""
    starts = [0, *(part.stop for part in left_out)]
    stops = [*(part.start for part in left_out), count]
    return [slice(a, b) for a, b in zip(starts, stops, strict=True) if b > a]


def reversing_sentence(t: Array, parts: list[slice]) -> list[str]:
    """One sentence on what was cut, with its times t [s]; none where nothing was."""
    if not parts:
        return []
    shown = ", ".join(f"{t[part.start]:.2f} to {t[part.stop - 1]:.2f} s" for part in parts[:3])
    more = f" and {len(parts) - 3} more times" if len(parts) > 3 else ""
    return [f"the car reverses from {shown}{more}: cut out, since the simulator's car drives forwards only."]
