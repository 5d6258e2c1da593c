"""What an estimator is given of runs: the parts that it can use, doubts, and the effects that their columns show."""

import dataclasses
import itertools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.car.foreign.simulator_car import SimulatorCar
from drift_drake.car.log.driving import (
    UsedStretch,
    backing,
    driven,
    in_spans,
    reversing,
    slowest_asked,
    spans,
    turned_back,
)
from drift_drake.car.log.table import OPTIONAL, SHORTEST_RUN, InvalidLogError, Run
from drift_drake.car.parameters import CarParameters, VehicleParameters
from drift_drake.gap.estimation.windows import SETTLING, stride_of
from drift_drake.gap.logs.screening.screened import Screened, ScreenedLogs, screened, screened_logs
from drift_drake.gap.logs.screening.suspicions import Suspicion, suspicions_of
from drift_drake.gap.logs.screening.timing import late_columns

GOLDEN = (np.sqrt(5.0) - 1.0) / 2.0
AHEAD = 6.5  # strides that a part needs for one window
SHORT = "parts that are too short"
LEAST_TOTAL = 4.0  # [s] of all parts: an informative drive takes 4.5
LONGEST_FILLED = 0.1  # [s] of bad samples in a row that are filled; a longer stretch is cut out
LISTED = 3  # stretches of one kind, and runs, that are reported one by one
MOST_SECONDS = 300.0
PIECE = 12.0  # [s], about, that longer runs are cut into
ROUNDING = 1e-6  # [s]


def lasting(run: Run) -> float:
    """From a run's first row to its last [s]: a drive of 4.5 s has one row more than periods."""
    return float(run.t[-1] - run.t[0])


def pieces_of(run: Run, seconds: float, longest: float = np.inf) -> list[Run]:
    """A run in pieces of equal length, about so long, named by the seconds of the run that they begin at.

    longest: [s] that a piece is cut to.
    """
    count = max(round(lasting(run) / seconds), 1)
    if count == 1:
        return [run] if lasting(run) < 1.5 * longest else [run.rows(0, round(1.5 * longest / run.period))]
    edges = np.linspace(0, len(run), count + 1).round().astype(int)
    most = min(longest / run.period, len(run))
    return [
        dataclasses.replace(
            run.rows(int(a), min(int(b), int(a) + round(most))),
            name=f"{run.name} from {run.t[a] - run.t[0]:.0f} s",
            recording=run.recording or run.name,
        )
        for a, b in itertools.pairwise(edges)
    ]


def spread(pieces: Sequence[Run], most: float, later: Sequence[bool] | np.ndarray | None = None) -> list[int]:
    """Indices of pieces that last so long together [s], or of one, spread evenly; those `later` after all others.

    Multiples of the golden ratio fall evenly and in no rhythm: manoeuvres that take turns are all met.
    """
    last = np.zeros(len(pieces), dtype=bool) if later is None else np.asarray(later, dtype=bool)
    place = np.empty(len(pieces))
    for kind in (False, True):
        place[last == kind] = np.arange(np.count_nonzero(last == kind)) * GOLDEN % 1.0
    order = np.lexsort((place, last))
    until = np.cumsum([lasting(pieces[i]) for i in order])
    return [int(i) for i in sorted(order[: max(int(np.count_nonzero(until <= most)), 1)])]


def least_part(vehicle: VehicleParameters) -> float:
    """Seconds that a part has to last for a window of predictions of a car of this size."""
    return SETTLING + AHEAD * stride_of(vehicle)


def usable_parts(
    runs: Sequence[Run], clean: Sequence[Screened], vehicle: VehicleParameters, reverse: bool = True
) -> tuple[list[Run], list[str]]:
    """Runs without bad samples, cut where they spin, stand, turn back or freeze, each part a run of its own; warnings.

    Args:
        clean: the runs as they were screened; reverse: parts that reverse can be used.

    Raises:
        InvalidLogError: too little is left.
    """
    kept: list[Run] = []
    warnings: list[str] = []
    lost: dict[str, float] = {}
    for one in clean:
        run = dataclasses.replace(one.run, filled=one.mask()) if one.bad else one.run
        frozen, back, parts, least = _parts(one, run, vehicle, reverse)
        if not in_spans(parts, len(run)).all():
            warnings.append(_left_out(run, vehicle, frozen, back, parts, least))
            for kind, rows in _kinds(run, vehicle, frozen, back, parts).items():
                lost[kind] = lost.get(kind, 0.0) + float(np.count_nonzero(rows)) * run.period
        for number, (a, b) in enumerate(parts):
            name = run.name if len(parts) == 1 else f"{run.name}_{number}"
            part = dataclasses.replace(run.rows(a, b), name=name, recording=run.recording or run.name)
            kept.append(turned_back(part) if back[a] else part)
    if len(warnings) > LISTED:
        warnings = [_in_all(runs, kept, lost, len(warnings))]
    _check_enough(runs, kept, vehicle)
    return kept, warnings


def _parts(
    one: Screened, run: Run, vehicle: VehicleParameters, reverse: bool
) -> tuple[np.ndarray, np.ndarray, list[tuple[int, int]], int]:
    """Rows that are frozen, those that reverse and can be used, the parts, and the rows that a part must have."""
    frozen = one.mask(LONGEST_FILLED / run.period) | bool(one.dead)
    least = max(round(least_part(vehicle) / run.period), SHORTEST_RUN)
    back = backing(run, vehicle) & ~frozen & reverse
    ways = (*spans(driven(run, vehicle) & ~frozen), *spans(back))
    return frozen, back, sorted((a, b) for a, b in ways if b - a >= least), least


def stretches(runs: Sequence[Run], vehicle: VehicleParameters, reverse: bool = True) -> list[list[UsedStretch]]:
    """By run what an estimator uses of it, and what it does not, in order of time; reverse: as of `usable_parts`."""
    found = []
    for one in screened(runs)[0]:
        frozen, back, parts, _ = _parts(one, one.run, vehicle, reverse)
        rows = [(a, b, "") for a, b in parts]
        for why, at in _kinds(one.run, vehicle, frozen, back, parts).items():
            rows += [(a, b, why) for a, b in spans(at & ~in_spans(parts, len(one.run)))]
        found.append([UsedStretch(float(one.run.t[a]), float(one.run.t[b - 1]), why) for a, b, why in sorted(rows)])
    return found


def _left_out(
    run: Run, vehicle: VehicleParameters, frozen: np.ndarray, back: np.ndarray, parts: Sequence[tuple[int, int]],
    least: int,
) -> str:  # fmt: skip
    """What of one run is not used, and why."""
    kinds = _kinds(run, vehicle, frozen, back, parts)
    short = kinds.pop(SHORT, None)
    why = "; ".join(f"{kind} {_times(run, rows)}" for kind, rows in kinds.items() if np.any(rows))
    if not parts:
        why = why or "it is too short"
        return f"{run.name}: left out, no {least * run.period:.3g} s in a row can be used ({why})"
    if len(parts) <= LISTED:
        used = " and ".join(f"{run.t[a]:.2f} to {run.t[b - 1]:.2f} s" for a, b in parts)
    else:
        used = f"{sum(b - a for a, b in parts) * run.period:.3g} s in {len(parts)} parts"
    if short is not None and np.any(short):
        why = f"{why}; " * bool(why) + f"{np.count_nonzero(short) * run.period:.3g} s in {SHORT}"
    return f"{run.name}: only {used} are used ({why})"


def _in_all(runs: Sequence[Run], kept: Sequence[Run], lost: dict[str, float], count: int) -> str:
    """One sentence on many runs."""
    total, used = (sum(len(run) * run.period for run in some) for some in (runs, kept))
    why = ", ".join(f"{seconds:.3g} s {kind}" for kind, seconds in lost.items() if seconds > 0.0)
    return f"of {total:.0f} s of logs {used:.3g} s are used, in {len(kept)} parts ({count} runs lose some: {why})"


def seen_effects(runs: Sequence[Run], names: Sequence[str]) -> tuple[list[str], list[str]]:
    """Effects that the columns of the log can show, and a warning about missing columns and the others."""
    missing = [name for name in OPTIONAL if any(run.column(name) is None for run in runs)]
    kept = [name for name in names if not set(CATALOGUE[name].needs) & set(missing)]
    lost = [name for name in names if name not in kept]
    kept, road = _with_road(runs, kept)
    if not missing:
        return kept, road
    what = f"column{'s' if len(missing) > 1 else ''} {', '.join(missing)} {'are' if len(missing) > 1 else 'is'} missing"
    return kept, [f"{what}: {', '.join(lost)} cannot be judged without" if lost else what, *road]


def _with_road(runs: Sequence[Run], names: list[str]) -> tuple[list[str], list[str]]:
    """Effects that can be judged where the bank is logged of the road, and what a magnitude of `road_bank` is then."""
    banked = [run.bank is not None for run in runs]
    if not any(banked) or "road_bank" not in names:
        return names, []
    if all(banked):
        return names, ["column bank is known: road_bank is its relative error, the true bank (1 + road_bank) times it"]
    left = [name for name in names if name != "road_bank"]
    return left, ["column bank is in some runs only: road_bank cannot be judged; give it in all runs or in none"]


def _kinds(
    run: Run, vehicle: VehicleParameters, frozen: np.ndarray, used_back: np.ndarray, parts: Sequence[tuple[int, int]]
) -> dict[str, np.ndarray]:
    """By reason why they are not used, rows [rows] (bool) outside of the parts."""
    slow = run.v < slowest_asked(vehicle)
    back = reversing(run, vehicle)
    good = driven(run, vehicle) | used_back
    return {
        f"slower than the {slowest_asked(vehicle):.2g} m/s that slips need": slow,
        "reversing": back & ~good & ~slow,
        "a spin": ~good & ~slow & ~back,
        "frozen columns": frozen,
        SHORT: good & ~frozen & ~in_spans(parts, len(run)),
    }


def _times(run: Run, rows: np.ndarray) -> str:
    found = spans(rows)
    reported = " and ".join(f"from {run.t[a]:.2f} to {run.t[b - 1]:.2f} s" for a, b in found[:LISTED])
    if len(found) <= LISTED:
        return reported
    return f"{reported} and {len(found) - LISTED} times more, {np.count_nonzero(rows) * run.period:.3g} s in all"


def _check_enough(runs: Sequence[Run], kept: Sequence[Run], vehicle: VehicleParameters) -> None:
    enough = (
        f"{LEAST_TOTAL:g} s in all, in parts of {least_part(vehicle):.2g} s or more, faster than "
        f"{slowest_asked(vehicle):.2g} m/s, would be enough"
    )
    fastest = max(float(np.max(run.v)) for run in runs)
    if fastest < slowest_asked(vehicle):
        raise InvalidLogError(
            f"no run has a speed above {fastest:.2g} m/s, too slow for the slips of a car of this size: {enough}"
        )
    total = sum(len(run) * run.period for run in kept)
    if total < LEAST_TOTAL - 1e-6:
        raise InvalidLogError(f"no run has enough to be used, {total:.3g} s in all are too little: {enough}")


def part_of(runs: Sequence[Run], most: float = MOST_SECONDS) -> tuple[list[Run], list[str]]:
    """At most so many seconds of the runs, and a sentence that says so; all runs as they are where they last no longer.

    Which pieces are taken depends on their places alone, not on what happened in them.
    """
    total = sum(lasting(run) for run in runs)
    most += ROUNDING
    if total <= most:
        return list(runs), []
    pieces = [piece for run in runs for piece in pieces_of(run, PIECE)]
    kept = spread(pieces, most)
    used = sum(lasting(pieces[i]) for i in kept)
    sentence = f"of {total:.0f} s of logs {used:.0f} s are used, {len(kept)} pieces spread evenly over them"
    return [pieces[i] for i in kept], [sentence]


class Admitted(NamedTuple):
    """What an estimator is given of runs."""

    runs: list[Run]  # the parts that it can use
    doubts: list[Suspicion]  # units, signs and clocks that seem wrong
    warnings: list[str]  # of the doubts, of bad samples and of what is left out


def admit(logs: Sequence[Run] | ScreenedLogs, car: CarParameters) -> Admitted:
    """Usable parts (`usable_parts`) and `suspicions` of runs, screened or not; a run that is there twice counts once.

    Parts that reverse are for cars of this package alone: what a simulator of the user's does with a negative speed is
    its own affair.

    Raises:
        InvalidLogError: too little is left.
    """
    vehicle = car.single_track()
    runs, clean, said = logs if isinstance(logs, ScreenedLogs) else screened_logs(logs)
    late = late_columns([one.columns for one in clean], [one.run.period for one in clean])
    # Commands that come late are for the hypotheses.
    doubts = [*suspicions_of(clean, vehicle), *(doubt for doubt in late if doubt.shift is not None)]
    kept, left_out = usable_parts(runs, clean, vehicle, not isinstance(car, SimulatorCar))
    return Admitted(kept, doubts, [*(doubt.sentence for doubt in doubts), *said, *left_out])
