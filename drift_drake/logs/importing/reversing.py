"""Where a car reverses: the single-track model knows forward driving and spins, so those rows are cut and reported."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

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
    edges = np.flatnonzero(np.diff(np.concatenate([[False], backwards, [False]]).astype(int)))
    spans = [slice(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]
    if backwards.mean() > 0.95:
        return []
    return [
        span
        for span in spans
        if (span.stop - span.start) * period >= SHORTEST
        and min(speed[max(span.start - 1, 0)], speed[min(span.stop, len(v) - 1)]) < STANDING
    ]


def forward_parts(count: int, spans: list[slice]) -> list[slice]:
    """The rest of `count` rows, in order."""
    starts = [0, *(span.stop for span in spans)]
    stops = [*(span.start for span in spans), count]
    return [slice(a, b) for a, b in zip(starts, stops, strict=True) if b > a]


def reversing_sentence(t: Array, spans: list[slice]) -> list[str]:
    """One sentence on what was cut, with its times t [s]; none where nothing was."""
    if not spans:
        return []
    shown = ", ".join(f"{t[span.start]:.2f} to {t[span.stop - 1]:.2f} s" for span in spans[:3])
    more = f" and {len(spans) - 3} more times" if len(spans) > 3 else ""
    return [f"the car reverses from {shown}{more}: cut out, since the simulator's car drives forwards only."]
