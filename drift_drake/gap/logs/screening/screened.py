"""Runs without their bad samples: found, listed, and filled from the rows next to them."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from drift_drake.car.log.driving import in_spans
from drift_drake.car.log.table import COLUMNS, OPTIONAL, UNITS, Run
from drift_drake.gap.logs.noise import coarse, noise_of, step, white_noise_level, wrap_size
from drift_drake.gap.logs.screening.averaging import Columns
from drift_drake.gap.logs.screening.bad_samples import command_dropouts, filled, frozen, spikes
from drift_drake.gap.logs.screening.dead import dead_columns
from drift_drake.gap.logs.screening.held_commands import frozen_command, held_sentences
from drift_drake.gap.logs.screening.repeated import without_repeated

MEASURED = ("x", "y", "psi", "r", "v", "beta", "omega_r", "ax", "ay")
COMMANDS = ("delta_cmd", "tau_cmd")
FARTHEST = {"delta_cmd": 0.5 * np.pi}  # [rad] that a wheel can be steered
ANGLES = ("psi", "beta")  # that may be wrapped
LISTED = 3  # spikes of a column that are reported one by one

REACHED_UNITS = {"speed": "m/s", "lateral acceleration": "m/s^2", "sideslip": "rad", "steering": "rad",
                 "steering rate": "rad/s"}  # fmt: skip

Span = tuple[int, int]


@dataclasses.dataclass(frozen=True)
class BadRows:
    """Rows start:stop of one column that are no measurement: a `spike`, or `frozen`."""

    column: str
    kind: str
    start: int
    stop: int


@dataclasses.dataclass(frozen=True)
class Screened:
    """A run whose bad samples are filled by interpolation, with a list of them.

    noise_floor: standard deviation [the column's unit] that coarse rounding alone makes, by column. dead: columns that
    no run can do without and that stand still; others are left out.
    """

    run: Run
    bad: tuple[BadRows, ...]
    noise_floor: Mapping[str, float]
    dead: tuple[str, ...] = ()

    @property
    def columns(self) -> Columns:
        """The run's columns by name, None where there is none."""
        return {name: self.run.column(name) for name in COLUMNS}

    def mask(self, beyond: float = 0.0) -> np.ndarray:
        """Rows [rows] (bool) in which a column is filled, not measured, for more than so many rows."""
        bad = [(part.start, part.stop) for part in self.bad if part.stop - part.start > beyond]
        return in_spans(bad, len(self.run))


class ScreenedLogs(NamedTuple):
    """Logs that count once, without their bad samples."""

    runs: list[Run]  # without those that are there twice
    clean: list[Screened]  # of each
    said: list[str]  # on both


def screened_logs(runs: Sequence[Run]) -> ScreenedLogs:
    """Logs as an estimator is given them."""
    once, repeated = without_repeated(runs)
    clean, found = screened(once)
    return ScreenedLogs(once, clean, [*repeated, *found])


def screened(runs: Sequence[Run]) -> tuple[list[Screened], list[str]]:
    """Each run without its bad samples, and sentences on what was found."""
    found = [screen(run) for run in runs]
    return [one for one, _ in found], [sentence for _, said in found for sentence in said]


def screen(run: Run) -> tuple[Screened, list[str]]:
    """One run without its bad samples, and sentences on them."""
    run, dead, dead_sentences = _without_dead(run)
    bad: list[BadRows] = []
    floor: dict[str, float] = {}
    corrected: dict[str, Any] = {}
    sentences: list[str] = []
    stretches: dict[tuple[int, int], list[str]] = {}
    for name in MEASURED:
        raw = run.column(name)
        if raw is None:
            continue
        if name in dead:
            continue
        wrap = None if name in ANGLES else wrap_size(raw)
        values = np.unwrap(raw) if name in ANGLES else raw if wrap is None else np.unwrap(raw, period=wrap)
        if wrap is not None:
            corrected[name] = raw = values
            sentences.append(f"{run.name}: {name} jumps by {wrap:.4g} {UNITS[name]} over and over, as a recorder's "
                             "number that has left its range: taken as if it went on")  # fmt: skip
        size = step(values)
        held, found = _bad_spans(values, run.v, size, run.period)
        for span in held:
            stretches.setdefault(span, []).append(name)
        parts = [BadRows(name, "frozen", *span) for span in held] + [BadRows(name, "spike", *span) for span in found]
        if parts:
            corrected[name] = _corrected(raw, values, [*held, *found], wrapped=name == "beta")
            bad += parts
        sentences += _spike_sentences(run, name, raw, corrected.get(name, raw), found)
        if coarse(values, size):
            floor[name] = noise_of(size)
            sentences.append(
                f"{run.name}: {name} comes in steps of {size:.3g} {UNITS[name]}, coarse relative to its noise: "
                f"its noise is at least {floor[name]:.2g} {UNITS[name]}, and not white"
            )
    for name in COMMANDS:
        raw = run.column(name)
        found = [] if raw is None else command_dropouts(raw, run.period, FARTHEST.get(name, np.inf))
        if raw is not None and found:
            corrected[name] = filled(raw, found)
            bad += [BadRows(name, "spike", *span) for span in found]
            sentences += _spike_sentences(run, name, raw, corrected[name], found)
        held = [] if raw is None else frozen_command(name, {k: q for k in COLUMNS if (q := run.column(k)) is not None},
                                                     run.period)  # fmt: skip
        bad += [BadRows(name, "frozen", *span) for span in held]
        sentences += held_sentences(name, run.name, run.t, held)
    sentences = dead_sentences + _frozen_sentences(run, stretches) + sentences
    clean = dataclasses.replace(run, **corrected) if corrected else run
    return Screened(clean, tuple(sorted(bad, key=lambda part: part.start)), floor, dead), sentences


def _without_dead(run: Run) -> tuple[Run, tuple[str, ...], list[str]]:
    """The run without dead columns, those that it needs, and sentences on all."""
    found = dead_columns([{name: run.column(name) for name in COLUMNS}], [run.period])
    found = {name: sentence for name, sentence in found.items() if name in MEASURED}
    needed = tuple(name for name in found if name not in OPTIONAL)
    left_out = set(found) - set(needed)
    return run.without(*left_out) if left_out else run, needed, [f"{run.name}: {said}" for said in found.values()]


def _bad_spans(values: np.ndarray, v: np.ndarray, size: float, period: float) -> tuple[list[Span], list[Span]]:
    """Frozen stretches and spikes of one column; what is both is frozen."""
    held = frozen(values, v, size, period)
    found = [span for span in spikes(values, size) if not _overlaps(span, held)]
    if found:
        # A spike next to readings that repeat looks like the jump at a frozen stretch's end.
        still = frozen(filled(values, found), v, size, period)
        held = [span for span in held if _overlaps(span, still)]
    return held, found


def _overlaps(span: Span, others: Sequence[Span]) -> bool:
    return any(span[0] < stop and start < span[1] for start, stop in others)


def _corrected(raw: np.ndarray, values: np.ndarray, bad: Sequence[Span], wrapped: bool) -> np.ndarray:
    """The column with bad rows filled; `values` is it unwrapped."""
    between = filled(values, bad)
    if wrapped:
        between = np.arctan2(np.sin(between), np.cos(between))
    return np.where(in_spans(bad, len(raw)), between, raw)


def _spike_sentences(
    run: Run, name: str, raw: np.ndarray, filled: np.ndarray, found: Sequence[tuple[int, int]]
) -> list[str]:
    reported = []
    for start, stop in found[:LISTED]:
        rows = "" if stop - start == 1 else f" ({stop - start} rows)"
        worst = start + int(np.argmax(np.abs(raw[start:stop] - filled[start:stop])))
        reported.append(
            f"at {run.t[start]:.2f} s{rows} ({raw[worst]:.4g} {UNITS[name]} in place of {filled[worst]:.4g})"
        )
    if not reported:
        return []
    more = f" and {len(found) - LISTED} more" if len(found) > LISTED else ""
    what = "a spike" if len(found) == 1 else f"{len(found)} spikes"
    return [f"{run.name}: {name} has {what} {', '.join(reported)}{more}: left out"]


def _frozen_sentences(run: Run, stretches: Mapping[tuple[int, int], Sequence[str]]) -> list[str]:
    """Columns that freeze together are reported together."""
    return [
        f"{run.name}: {', '.join(names)} {'is' if len(names) == 1 else 'are'} frozen from {run.t[start]:.2f} to "
        f"{run.t[stop - 1]:.2f} s ({stop - start} rows of the same value while the car moves): left out"
        for (start, stop), names in sorted(stretches.items())
    ]


@dataclasses.dataclass(frozen=True)
class RunQuality:
    """One run. noise: white noise by column (SI, one standard deviation); bad: rows without a measurement by column;
    reached: the largest speed [m/s], lateral acceleration v r [m/s^2], sideslip [rad], steering [rad] and rate of
    steering [rad/s] (99 % of the rows stay below)."""

    name: str
    seconds: float
    rate: float  # [Hz]
    missing: list[str]
    noise: dict[str, float]
    bad: dict[str, int]
    reached: dict[str, float]


def quality(runs: Sequence[Run], clean: Sequence[Screened]) -> list[RunQuality]:
    """Each run's quality; clean: the runs, screened."""
    found = []
    for run, one in zip(runs, clean, strict=True):
        bad: dict[str, int] = {}
        for part in one.bad:
            bad[part.column] = bad.get(part.column, 0) + part.stop - part.start
        columns = {name: values for name in MEASURED if (values := one.run.column(name)) is not None}
        noise = {name: _noise(one, name, values) for name, values in columns.items() if name not in ("x", "y", "psi")}
        missing = [name for name in OPTIONAL if run.column(name) is None]
        length = len(run) * run.period
        found.append(RunQuality(run.name, length, 1.0 / run.period, missing, noise, bad, reached(one.run)))
    return found


def _noise(one: Screened, name: str, values: np.ndarray) -> float:
    """White noise of a column where it is measured; the steps of its numbers make at least some."""
    bad = in_spans([(part.start, part.stop) for part in one.bad if part.column == name], len(values))
    return max(white_noise_level(np.asarray(values)[~bad]), one.noise_floor.get(name, 0.0))


def reached(run: Run) -> dict[str, float]:
    """How far 99 % of the rows go."""

    def most(values: np.ndarray) -> float:
        return float(np.quantile(np.abs(values), 0.99))

    out = {"speed": most(run.v), "lateral acceleration": most(run.v * run.r)}
    if run.beta is not None:
        out["sideslip"] = most(run.beta)
    return out | {"steering": most(run.delta_cmd), "steering rate": most(np.gradient(run.delta_cmd, run.period))}
