"""Columns that stand at one value through whole runs while others say that the car moves: no measurement."""

from collections.abc import Sequence

import numpy as np

from drift_drake.gap.logs.screening.averaging import Columns
from drift_drake.gap.logs.screening.kinematics import Kinematics, motion_of_columns

CONSTANT = 1e-9  # of a column's size that rounding moves it by
SEEN = 0.05  # of what is noted in `_movements`: a movement that a sensor does not miss
BOTH_SIDES, LARGE = 0.05, 0.25  # of the windows turn to either side, by so much of the largest
STEADY = 0.5  # [1/s] of change of a yaw rate that hardly changes
FEWEST = 12  # windows
# What a car that moves does to other columns, by column that cannot stand still then.
WITNESSES: dict[str, dict[str, str]] = {
    "r": {"turning": "psi turns", "course": "the course of x, y turns", "ay": "ay changes"},
    "v": {"rim": "omega_r changes", "moved": "the speed along x, y changes", "ax": "ax is not zero",
          "circling": "ay over r changes"},
    "psi": {"r": "r is not zero"},
    "beta": {"r": "r is not zero"},
    "omega_r": {"speed": "v changes"},
    "ay": {"turned": "v r changes"},
    "ax": {"gain": "v changes"},
    "x": {"driven": "the car drives"},
    "y": {"driven": "the car drives"},
    "delta_cmd": {"both ways": "r turns to both sides"},
}  # fmt: skip


def dead_columns(runs: Sequence[Columns], periods: Sequence[float]) -> dict[str, str]:
    """By column that is dead in all runs, a sentence; empty where nothing is.

    Args:
        runs: columns of the log format [rows] by run; periods: time between the rows [s].
    """
    constant = [name for name in WITNESSES if all(_constant(columns.get(name)) for columns in runs)]
    constant = [name for name in constant if any(columns.get(name) is not None for columns in runs)]
    if len({"x", "y"} & set(constant)) == 1:  # along one axis
        constant = [name for name in constant if name not in ("x", "y")]
    if not constant:
        return {}
    moves = _movements(motion_of_columns(runs, periods))
    found = {}
    for name in constant:
        seen = [words for key, words in WITNESSES[name].items() if moves.get(key, 0.0) > SEEN]
        if seen:
            value = next(float(values[0]) for columns in runs if (values := columns.get(name)) is not None)
            found[name] = (
                f"column {name} is dead: {value:.3g} in all rows though {seen[0]}; map the column that measures it, "
                "or leave it out"
            )
    return found


def set_speed(runs: Sequence[Columns], m: Kinematics) -> str:
    """A sentence where the speed is one value through all runs of a car that turns: turns alone shed speed."""
    if not all(_constant(columns["v"]) for columns in runs) or _spread(m.r) <= SEEN:
        return ""
    speed = float(np.asarray(runs[0]["v"])[0])
    return (
        f"column v is {speed:.3g} m/s in all rows: a set speed rather than a measured one? Map the "
        "column that measures it, if there is one"
    )


def _constant(values: np.ndarray | None) -> bool:
    return values is None or bool(np.ptp(values) <= CONSTANT * max(1.0, float(np.max(np.abs(values)))))


def _movements(m: Kinematics) -> dict[str, float]:
    """How far quantities go: rates [rad/s], accelerations [10 m/s^2], speeds as a share."""
    if len(m.r) < FEWEST:
        return {}
    top = float(np.quantile(np.abs(m.r), 0.95))
    sides = min(float(np.mean(sign * m.r > LARGE * top)) for sign in (1.0, -1.0))
    # Where the yaw rate hardly changes, the car does not slide any further, and ay is v r.
    steady = (np.abs(m.r) > max(0.5 * top, SEEN)) & (np.abs(m.spin) < STEADY * np.abs(m.r))
    felt = m.ax - np.nan_to_num(m.along)
    return {
        "turning": _spread(m.turning), "course": _spread(m.course), "r": _spread(m.r), "ay": 0.1 * _spread(m.ay),
        "rim": _share(m.omega_r), "moved": _share(m.moved), "speed": _share(m.v), "gain": 0.1 * _spread(m.gain),
        "ax": 0.05 * _spread(felt), "turned": 0.1 * _spread(m.turned), "driven": 1.0,
        "circling": 0.1 * _share(np.abs(m.ay[steady] / m.r[steady])), "both ways": top if sides > BOTH_SIDES else 0.0,
    }  # fmt: skip


def _spread(values: np.ndarray) -> float:
    values = values[np.isfinite(values)]
    return float(np.subtract(*np.quantile(values, [0.95, 0.05]))) if len(values) >= FEWEST else 0.0


def _share(values: np.ndarray) -> float:
    """The spread of positive values as a share of their median."""
    values = values[np.isfinite(values) & (values > 0.0)]
    return _spread(values) / float(np.median(values)) if len(values) >= FEWEST else 0.0
