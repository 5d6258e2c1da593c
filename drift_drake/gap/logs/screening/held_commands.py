"""Commands that stand still in a log while the car answers to others: frozen, or lost for seconds.

A constant command is normal, in a steady corner or on a straight. So it is held against the command that the motion
asks for, by the run's own relation of the two where the command changes, and only where the motion is as it is there.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from drift_drake.car.log.driving import in_spans, spans
from drift_drake.common.arrays import correlation

SHORTEST = 1.0  # [s] of a command that stands still
SETTLING = 0.5  # [s] after its last change, in which the car still follows that
SMOOTHED = 0.3  # [s] over which noise and lags are averaged out
LIKE = 0.9  # correlation of the command with what the motion asks for, from which the relation is believed
FAR = 1.5  # times as far from what the motion asks for as the command ever is where it changes
SEEN = (0.01, 0.99)  # quantiles of the motion where the command changes: what lies beyond is not asked
MOVING = 0.2  # of the high speeds of a run
Span = tuple[int, int]


def frozen_command(name: str, columns: Mapping[str, np.ndarray], period: float) -> list[Span]:
    """Spans of rows (start, stop) in which `delta_cmd` or `tau_cmd` stands still though the car answers another one.

    Args:
        name: of the command; columns: of the log format [rows], at least it, `r` and `v`; period: between rows [s].
    """
    from scipy.ndimage import uniform_filter1d  # slow to import

    values = columns[name]
    still = [(a, b + 1) for a, b in spans(np.diff(values) == 0.0) if (b + 1 - a) * period >= SHORTEST]
    moving = columns["v"] > MOVING * float(np.quantile(columns["v"], 0.95))
    width = max(round(SMOOTHED / period), 1)
    changing = ~in_spans([(max(a - width, 0), b + width) for a, b in still], len(values)) & moving
    if not still or 2 * np.count_nonzero(changing) < np.count_nonzero(moving):
        return []
    asked, motion = _asked(name, columns, period, width)
    command = uniform_filter1d(values, width, mode="nearest")
    found, *_ = np.linalg.lstsq(asked[changing], command[changing], rcond=None)
    expected = asked @ found
    if correlation(command[changing], expected[changing]) < LIKE:
        return []
    low, high = np.quantile(motion[changing], SEEN, axis=0)
    usual = float(np.max(np.abs(command - expected)[changing]))
    odd = (np.abs(values - expected) > FAR * usual) & ((motion >= low) & (motion <= high)).all(axis=1) & moving
    settled = round(SETTLING / period)
    return [(a, b) for a, b in still if 2 * np.count_nonzero(odd[a + settled : b - width]) > settled]


def _asked(name: str, columns: Mapping[str, np.ndarray], period: float, width: int) -> tuple[np.ndarray, np.ndarray]:
    """What a command depends on [rows, n], smoothed, and what tells whether the relation was seen [rows, m]."""
    from scipy.ndimage import uniform_filter1d

    v, r = (uniform_filter1d(columns[key], width, mode="nearest") for key in ("v", "r"))
    v = np.maximum(v, 1e-3)
    gain, spin = (uniform_filter1d(np.gradient(z, period), width, mode="nearest") for z in (v, r))
    beta = columns.get("beta")
    slides = np.zeros(len(v)) if beta is None else uniform_filter1d(beta, width, mode="nearest")
    ones, motion = np.ones(len(v)), np.column_stack([v, v * r, gain, slides])
    if name == "delta_cmd":
        return np.column_stack([ones, r / v, v * r, spin / v, slides]), motion
    return np.column_stack([ones, gain, v, v * v, v * r * slides, np.abs(r)]), motion


def held_sentences(name: str, run: str, t: np.ndarray, found: Sequence[Span]) -> list[str]:
    """One sentence on a command's frozen spans."""
    if not found:
        return []
    shown = ", ".join(f"{t[start]:.2f} to {t[stop - 1]:.2f} s" for start, stop in found[:3])
    more = f" and {len(found) - 3} more" if len(found) > 3 else ""
    return [f"{run}: {name} stands still from {shown}{more} while the car answers another command: left out"]
