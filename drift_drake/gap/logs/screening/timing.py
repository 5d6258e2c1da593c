"""Columns that come earlier or later than the others: which are on another clock, and by how much.

The yaw rate is held against what else turns with the car: the heading, the steering, and the lateral speed, which in
gentle driving is r (a + b v^2). What agrees is one group, what is apart by one time another, and the smaller group is
doubted.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from drift_drake.common.arrays import Array, correlation
from drift_drake.gap.logs.clock_offset import estimate_offset
from drift_drake.gap.logs.screening.averaging import Columns, continuous
from drift_drake.gap.logs.screening.relations import GRIP
from drift_drake.gap.logs.screening.suspicions import Suspicion

FEWEST = 230  # rows
MOST, LONGEST = 6, 600.0  # runs, the longest; [s] of each
WINDOW, TREND = 0.3, 3.0  # [s] over which noise is averaged out, and what changes too slowly to tell a time is
SEARCH = 1.5  # [s]
THINNED = 5  # rows that change too little from one to the next to tell more than one of them does
LIKENESS, ALIKE = 0.8, 0.7  # correlation at the best time, with slow changes and without, from which it is believed
SURE = 3.0  # standard deviations
CREEP, SLOW = 0.3, 8.0  # [m/s] between which a lateral speed follows the yaw rate at once
SLIDES = 2.0  # [m/s^2] of v r, above which a lateral speed does not go with r alone
GENTLE = 10.0  # [s] of such driving, from which it is asked
SAME = 0.1  # [s] by which columns of one group may be apart
# [s] by which r may come later than a column, on a car whose clocks agree: the car answers its steering.
USUAL = {"psi": (-0.1, 0.1), "delta_cmd": (-0.05, 0.25), "beta": (-0.15, 0.15)}
EXPLAINED = 0.5  # of the squared errors without a time, that are left at most
# SLIDES, GENTLE and EXPLAINED were set on two real cars and one simulated day (validation).
STEPS = np.arange(-SEARCH, SEARCH + 0.01, 0.05)  # [s] at which a lateral speed is tried


class Apart(NamedTuple):
    """By how much r comes later than a column [s], and the standard deviation."""

    time: float
    std: float

    def beyond(self, low: float, high: float) -> bool:
        """Whether it is outside an interval for certain."""
        return self.time - SURE * self.std > high or self.time + SURE * self.std < low


def late_columns(runs: Sequence[Columns], periods: Sequence[float]) -> list[Suspicion]:
    """Columns that come earlier or later than the others; runs: columns [rows], which have at least `r` and `v`.

    Of commands alone, which a car's actuators delay too, no shift is given.
    """
    longest = sorted(range(len(runs)), key=lambda i: -len(np.asarray(runs[i]["r"])))[:MOST]
    asked, found = [_Run(runs[i], periods[i]) for i in longest], {}
    for name, witness in WITNESSES.items():
        of_runs = [at for run in asked if (at := _apart(run, witness)) is not None]
        if of_runs:
            found[name] = _together(of_runs)
    return [_late(found, names, at) for names, at in _groups(found)]


def on_one_clock(columns: Columns, period: float, late: Sequence[Suspicion]) -> dict[str, Array]:
    """The columns [rows] with those that are late moved to the others' clock."""
    out = {name: np.asarray(values, dtype=float) for name, values in columns.items() if values is not None}
    for one in late:
        for name in one.columns:
            values = continuous(out[name]) if name in ("psi", "beta") else out[name]
            t = np.arange(len(values)) * period
            out[name] = np.interp(t, t + (one.shift or 0.0), values)
    return out


def _together(of_runs: Sequence[Apart]) -> Apart:
    """What several runs say; runs that disagree say less than each claims."""
    times, stds = (np.array(values) for values in zip(*of_runs, strict=True))
    weights = 1.0 / stds**2
    time = float(np.sum(weights * times) / np.sum(weights))
    spread = float(np.sqrt(np.sum(weights * (times - time) ** 2) / max(len(times) - 1, 1)))
    return Apart(time, max(spread, 1.0) / float(np.sqrt(np.sum(weights))))


def _groups(found: dict[str, Apart]) -> list[tuple[list[str], Apart]]:
    """Columns that are apart from r for certain, those that are so by one time together."""
    far = [name for name, at in found.items() if at.beyond(*USUAL[name])]
    out = []
    while far:
        at = found[far[0]]
        names = [name for name in far if not Apart(found[name].time - at.time, found[name].std + at.std).beyond(
            min(USUAL[name][0], -SAME), max(USUAL[name][1], SAME))]  # fmt: skip
        far = [name for name in far if name not in names]
        out.append((names, at))
    return out


def _late(found: dict[str, Apart], names: list[str], at: Apart) -> Suspicion:
    """Of a group that is apart from r by one time."""
    by = f"{abs(at.time):.2g} s (+- {max(at.std, 1e-3):.1g} s)"
    if names == ["delta_cmd"]:
        lead = f"commands lead the motion by {by}" if at.time > 0.0 else f"the motion leads its commands by {by}"
        sentence = f"{lead}: clocks not aligned?"
        fix = " Give the commands a clock of their own in the mapping, with its offset or 'align'"
        return Suspicion(sentence + fix, None, None, sentence)
    agree = ["r", *(name for name in found if not found[name].beyond(*USUAL[name]))]
    wrong, other = (names, agree) if len(names) <= len(agree) else (agree, names)
    late = (at.time > 0.0) == (wrong is agree)
    come, their = ("comes", "its") if len(wrong) == 1 else ("come", "their")
    says = f"{_listed(wrong)} {come} {by} {'later' if late else 'earlier'} than {_listed(other)}"
    shift = -abs(at.time) if late else abs(at.time)
    fix = f": give {_listed(wrong)} a clock of {their} own in the mapping, with offset: {shift:.2g}"
    if len(wrong) == len(other):
        fix = (
            ", and no other column tells which of them is off: give that one a clock of its own in the mapping, with "
            "its offset"
        )
    return Suspicion(says + fix, wrong[0], None, says, columns=tuple(wrong), shift=shift)


def _listed(names: Sequence[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


class _Run:
    """Columns [rows] of a run's middle, a row each period [s]."""

    def __init__(self, columns: Columns, period: float) -> None:
        rows, most = len(np.asarray(columns["r"])), round(LONGEST / period)
        first = max((rows - most) // 2, 0)
        self.period = period
        self.columns = {name: np.asarray(values, dtype=float)[first : first + most]
                        for name, values in columns.items() if values is not None}  # fmt: skip
        self.r, self.v = self.columns["r"], self.columns["v"]

    def column(self, name: str) -> Array | None:
        """None where it is missing."""
        return self.columns.get(name)

    def averaged(self, values: Array, over: float) -> Array:
        """Over so many seconds."""
        from scipy.ndimage import uniform_filter1d  # slow to import

        return np.asarray(uniform_filter1d(values, max(round(over / self.period), 1)))


class _Like(NamedTuple):
    """What turns like r [rows], from r and from a column, and the rows that count."""

    reference: Array
    signal: Array
    kept: NDArray[np.bool_]


def _heading(run: _Run) -> _Like | None:
    psi = run.column("psi")
    return None if psi is None else _Like(run.r, np.gradient(continuous(psi)), run.v > 0.0)


def _steering(run: _Run) -> _Like | None:
    delta, beta = run.column("delta_cmd"), run.column("beta")
    kept = run.v > 0.0 if beta is None else np.abs(beta) < GRIP
    return None if delta is None else _Like(run.r, delta * run.v, kept)


def _lateral(run: _Run) -> _Like | None:
    """The lateral speed, and r (a + b v^2) + c v with the a, b, c and the time that make them most alike; None where
    that time does not explain it much better than none."""
    beta, r, v = run.column("beta"), run.r, run.v
    kept = (v > CREEP) & (v < SLOW) & (np.abs(v * r) < SLIDES)
    if beta is None or np.count_nonzero(kept) * run.period < GENTLE:
        return None
    signal, t = v * np.sin(beta), np.arange(len(r)) * run.period
    terms = np.column_stack([r, r * v**2, v])

    def fitted(late: float) -> tuple[float, Array]:
        moved = np.column_stack([np.interp(t - late, t, term) for term in terms.T])[kept][::THINNED]
        found, *_ = np.linalg.lstsq(moved, signal[kept][::THINNED], rcond=None)
        return float(np.sum((signal[kept][::THINNED] - moved @ found) ** 2)), found

    least, found = min(map(fitted, STEPS), key=lambda at: at[0])
    if least > EXPLAINED * fitted(0.0)[0]:
        return None
    return _Like(terms @ found, signal, kept)


WITNESSES: dict[str, Callable[[_Run], _Like | None]] = {
    "psi": _heading, "delta_cmd": _steering, "beta": _lateral,
}  # fmt: skip


def _apart(run: _Run, witness: Callable[[_Run], _Like | None]) -> Apart | None:
    """Seconds that r comes later than a column; None where a run does not say."""
    found = witness(run) if len(run.r) >= FEWEST else None
    if found is None or not np.all(np.isfinite(found.signal)) or np.count_nonzero(found.kept) < FEWEST:
        return None
    kept = found.kept
    whole = [run.averaged(z, WINDOW) for z in (found.reference, found.signal)]
    # Slow changes tell little of a time, and an understeering car's follow the steering's with another shape.
    reference, signal = (z - run.averaged(z, TREND) for z in whole)
    if min(np.ptp(z[kept]) for z in (*whole, reference, signal)) < 1e-9:
        return None
    t = np.asarray(np.arange(len(kept)) * run.period, dtype=float)
    try:
        at = estimate_offset(t[kept][::THINNED], reference[kept][::THINNED], t, signal, 0.0, SEARCH)
    except ValueError:
        return None
    moved = np.interp(t[kept] + at.offset, t, whole[1])
    if at.correlation < ALIKE or correlation(whole[0][kept], moved) < LIKENESS:
        return None
    return Apart(-at.offset, max(at.std, 1e-4))
