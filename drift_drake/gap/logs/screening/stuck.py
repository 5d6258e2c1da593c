"""Columns that stay at one value for long while the car moves: named before what they make of all other columns."""

from collections.abc import Mapping, Sequence

import numpy as np

from drift_drake.car.log.driving import in_spans, spans
from drift_drake.gap.logs.noise import step
from drift_drake.gap.logs.screening.bad_samples import LONGEST_HOLD, frozen

Columns = Mapping[str, np.ndarray]
MEASURED = ("psi", "r", "v", "beta", "omega_r", "ax", "ay")


def without_stuck(runs: Sequence[Columns], period: float, fewest: int) -> tuple[list[Columns], list[str]]:
    """The parts of runs in which no measured column is stuck, and a sentence on each that is.

    Args:
        runs: columns of the log format [rows] by run, `t` and `v` among them; period: time between rows [s];
        fewest: rows of a part.
    """
    parts: list[Columns] = []
    found: dict[str, list[tuple[float, float]]] = {}
    for columns in runs:
        held = {name: stuck(columns[name], columns["v"], period) for name in MEASURED if name in columns}
        for name, stretches in held.items():
            times = [(float(columns["t"][start]), float(columns["t"][stop - 1])) for start, stop in stretches]
            found.setdefault(name, []).extend(times)
        bad = [stretch for stretches in held.values() for stretch in stretches]
        if not bad:
            parts.append(columns)
            continue
        good = [(start, stop) for start, stop in spans(~in_spans(bad, len(columns["v"]))) if stop - start >= fewest]
        parts += [{name: values[start:stop] for name, values in columns.items()} for start, stop in good]
    return parts, [_sentence(name, stretches) for name, stretches in found.items() if stretches]


def stuck(values: np.ndarray, v: np.ndarray, period: float) -> list[tuple[int, int]]:
    """Frozen stretches [rows] that last longer than any sensor holds a reading."""
    least = round(LONGEST_HOLD / period)
    edges = np.concatenate([[0], np.flatnonzero(np.diff(values)) + 1, [len(values)]])
    if np.max(np.diff(edges)) <= least:
        return []
    return [(start, stop) for start, stop in frozen(values, v, step(values), period) if stop - start > least]


def _sentence(name: str, stretches: Sequence[tuple[float, float]]) -> str:
    lasting = sum(end - begin for begin, end in stretches)
    times = f"from {stretches[0][0]:.2f} to {stretches[0][1]:.2f} s"
    if len(stretches) > 1:
        times = f"for {lasting:.3g} s in {len(stretches)} stretches, the first {times}"
    return (
        f"column {name} is frozen {times}: one value while the car moves; 'check' and 'diagnose' leave these rows out, "
        "map another column if there is one."
    )
