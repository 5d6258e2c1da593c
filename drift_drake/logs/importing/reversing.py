"""Where a car reverses: the single-track model knows forward driving and spins, so those rows are cut and reported."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from drift_drake.logs.driving import in_spans, spans

Array = NDArray[np.float64]

BACKWARDS = 0.5  # [m/s] of backward velocity that noise explains
STANDING = 2.0  # [m/s] at the change of direction: a car that reverses has stopped before, one that spins has not
SHORTEST = 0.1  # [s]


def reversing_rows(columns: Mapping[str, Array], period: float) -> NDArray[np.bool_]:
    """Rows [n] in which the car reverses; none of a car that never drives forwards, whose sign or heading is wrong.

    Args:
        columns: of the log [n], with `vx`, `vy` where they are known; period: time between rows [s].
    """
    v, beta = columns["v"], columns.get("beta", np.zeros_like(columns["v"]))
    along = columns.get("vx", v * np.cos(beta))
    speed = np.hypot(along, columns.get("vy", v * np.sin(beta)))
    backwards = along < -BACKWARDS
    found = [
        (a, b)
        for a, b in spans(backwards)
        if (b - a) * period >= SHORTEST and min(speed[max(a - 1, 0)], speed[min(b, len(v) - 1)]) < STANDING
    ]
    return in_spans([] if backwards.mean() > 0.95 else found, len(v))


def reversing_sentence(t: Array, parts: Sequence[tuple[int, int]]) -> list[str]:
    """One sentence on what was cut, with its times t [s]; none where nothing was."""
    if not parts:
        return []
    shown = ", ".join(f"{t[start]:.2f} to {t[stop - 1]:.2f} s" for start, stop in parts[:3])
    more = f" and {len(parts) - 3} more times" if len(parts) > 3 else ""
    return [f"the car reverses from {shown}{more}: cut out, since the simulator's car drives forwards only."]
