"""A recorder's files to runs of the log format, with a report of what was estimated and what looks wrong."""

import dataclasses
import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from drift_drake.car.log.driving import spans
from drift_drake.car.log.table import COLUMNS, SHORTEST_RUN, InvalidLogError, Run
from drift_drake.common.arrays import Array
from drift_drake.gap.logs.importing.checks import doubts_of
from drift_drake.gap.logs.importing.clocks import clock_doubts
from drift_drake.gap.logs.importing.formats.files import InvalidRecordingError
from drift_drake.gap.logs.importing.formula import evaluate
from drift_drake.gap.logs.importing.known import is_path_only
from drift_drake.gap.logs.importing.mapping import InvalidMappingError, RecorderMapping
from drift_drake.gap.logs.importing.offsets import ClockReport, clock_offsets
from drift_drake.gap.logs.importing.position import course_doubts
from drift_drake.gap.logs.importing.recording import Recording, read_recording
from drift_drake.gap.logs.importing.smoothing import SHORTEST, noise_of
from drift_drake.gap.logs.importing.stretches import (
    LARGEST_GAP,
    MEASURED,
    VELOCITY,
    Stretch,
    from_velocity,
    moving_stretches,
    reversing_rows,
    reversing_sentence,
    split_sentence,
    stretch_of,
)
from drift_drake.gap.logs.noise import without_jumps
from drift_drake.gap.logs.screening.repeated import without_repeated

PERIOD = 0.01  # [s] of the log
SLOW = 1.5  # periods of the log between two readings: more, and rows between readings are no measurements


@dataclasses.dataclass(frozen=True)
class RunReport:
    """One run: the recording it is of, its start and end [s] after that one's first reading, and its rows.

    noise: standard deviation of one reading (SI), by signal; std: of the log's columns; bandwidth [Hz]: up
    to which smoothed position and heading follow (what is faster was taken for noise); remarks: on what looks wrong.
    """

    name: str
    recording: str
    start: float
    end: float
    rows: int
    noise: dict[str, float]
    std: dict[str, float]
    bandwidth: dict[str, float]
    remarks: list[str]


@dataclasses.dataclass(frozen=True)
class ImportReport:
    """What was estimated on the way: offsets of clocks by recording, and each run's report.

    remarks: all sentences on what looks wrong, each with the name of its run or recording; unchecked: columns of which
    no other one tells whether they are right; undecided: what else the columns cannot tell, as clauses.
    """

    recorder: str
    clocks: dict[str, dict[str, ClockReport]]
    runs: list[RunReport]
    remarks: list[str]
    unchecked: tuple[str, ...] = ()
    undecided: tuple[str, ...] = ()


def import_recordings(
    paths: Sequence[str | Path], mapping: RecorderMapping, start: float = 0.0, end: float = math.inf,
    databases: Sequence[str | Path] = (),
) -> tuple[list[Run], ImportReport]:  # fmt: skip
    """Turns recordings of one vehicle into runs at 100 Hz, in the order given.

    Args:
        start, end: part of each recording to keep [s after its first reading]. Clocks are aligned on all of it.
        databases: of CAN messages (DBC), of recordings of raw frames.

    Raises:
        InvalidRecordingError: a file cannot be used; the message names it, the place and the remedy.
        InvalidMappingError: it gives a path alone.
    """
    if is_path_only(mapping):
        raise InvalidMappingError(
            "the mapping gives a path alone, which the command 'drift-drake import' writes; runs need a yaw rate and a "
            "steering command: map them (of gentle driving, 'formulas: {r: course_rate}')"
        )
    if not paths:
        raise InvalidRecordingError("no recordings; give some files")
    pieces: list[Piece] = []
    clocks: dict[str, dict[str, ClockReport]] = {}
    remarks: list[str] = []
    for path in paths:
        recording = read_recording(path, mapping, databases)
        label = recording.name if recording.name not in clocks else f"{recording.name}_{len(clocks)}"
        found, clocks[label], sentences = pieces_of(Path(path), label, recording, mapping, start, end)
        pieces += found
        remarks += [f"{label}: {sentence}" for sentence in sentences]
        del recording  # of a long one, memory
    ahead = [piece for piece in pieces if not piece.reverses]
    doubts, wrong = doubts_of([(piece.label, piece.columns) for piece in ahead], PERIOD, mapping)
    for piece in ahead:
        wrong[piece.label] += [
            doubt for doubt in course_doubts(piece.columns, PERIOD) if doubt not in wrong[piece.label]
        ]
    runs = [as_run(piece, mapping, wrong[piece.label]) for piece in pieces]
    once, same = without_repeated(runs)
    pieces = [piece for piece, run in zip(pieces, runs, strict=True) if any(run is other for other in once)]
    reports = [
        _report(piece, run, [] if piece.reverses else wrong[piece.label])
        for piece, run in zip(pieces, once, strict=True)
    ]
    remarks += [f"{report.name}: {sentence}" for report in reports for sentence in report.remarks]
    remarks += [f"{', '.join(clocks)}: {sentence}" for sentence in same]
    return once, ImportReport(mapping.recorder, clocks, reports, remarks, doubts.unchecked, doubts.undecided)


@dataclasses.dataclass(frozen=True)
class Piece:
    """A part of a recording that is a run, before it is one. noise: of one reading (SI), of other clocks' signals.

    reverses: it drives backwards throughout, which what checks columns by each other does not take into account.
    """

    path: Path
    name: str
    label: str  # of its recording
    stretch: Stretch
    noise: dict[str, float]
    columns: dict[str, Array]
    reverses: bool


def pieces_of(
    path: Path, label: str, recording: Recording, mapping: RecorderMapping, start: float, end: float
) -> tuple[list[Piece], dict[str, ClockReport], list[str]]:
    """The driving of a recording, the offsets of its clocks, and sentences on it.

    Where it reverses is a run of its own, and left out where no sideslip says so.

    Raises:
        InvalidRecordingError: there is too little.
    """
    first = recording.clocks[mapping.first_clock]
    clock = mapping.clocks[mapping.first_clock]
    doubted = [] if clock.rate else clock_doubts(clock.column, first.t, clock.unit)
    moved = moving_stretches(first, mapping)
    stretches = [stretch_of(first, part, mapping) for part in moved]
    offsets, wrong = clock_offsets(recording, stretches, mapping) if stretches else ({}, [])
    rows = [_rows(recording, stretch, offsets, mapping, start, end) for stretch in stretches]
    kept = [(stretch, t) for stretch, t in zip(stretches, rows, strict=True) if len(t) >= SHORTEST_RUN]
    if not kept:
        if doubted:
            raise InvalidRecordingError(f"{path}: {doubted[0]}")
        step = float(np.median(np.diff(first.t)))
        if step > LARGEST_GAP:
            raise InvalidRecordingError(
                f"{path}: the clock '{clock.label}' ticks each {step:.3g} s, and a log needs readings each "
                f"{LARGEST_GAP:g} s or more often; name a finer column of times, or record faster"
            )
        asked = "" if mapping.moving is None else f" above {mapping.moving.speed:g} m/s"
        raise InvalidRecordingError(
            f"{path}: holds no {SHORTEST_RUN} rows of motion{asked} without a gap; leave it out, or change "
            "'moving', start or end"
        )
    noise = _noise_of_other_clocks(recording, mapping)
    parts, back, times = [], [], []
    for stretch, t in kept:
        columns = _columns(recording, stretch, t, offsets, mapping)
        backwards = reversing_rows(columns, PERIOD)
        back.append(backwards)
        times.append(t)
        ways = [(a, b) for a, b in (*spans(~backwards), *(spans(backwards) if "beta" in columns else ()))]
        for a, b in sorted(way for way in ways if way[1] - way[0] >= SHORTEST_RUN):
            taken = {"t": t[a:b]} | {k: values[a:b] for k, values in columns.items()}
            bare = dataclasses.replace(stretch, t=stretch.t[:0].copy(), columns={})  # in the rows from here on
            parts.append((bare, taken, bool(backwards[a])))
    if all(reverses for _, _, reverses in parts):
        raise InvalidRecordingError(f"{path}: holds no {SHORTEST_RUN} rows of driving forwards; leave it out")
    names = [label if len(parts) == 1 else f"{label}_{number}" for number in range(len(parts))]
    pieces = [Piece(path, name, label, stretch, noise, columns, reverses)
              for name, (stretch, columns, reverses) in zip(names, parts, strict=True)]  # fmt: skip
    what = "a run of its own" if any(piece.reverses for piece in pieces) else "cut out, since it is too short"
    what = what if "beta" in pieces[0].columns else "cut out, since there is no sideslip"
    reversed_ = reversing_sentence(np.concatenate(times), spans(np.concatenate(back)), what)
    said = dict.fromkeys([*doubted, *recording.remarks, *wrong, *_slow_columns(recording),
                          *split_sentence(first, moved, mapping, len(parts)), *reversed_])  # fmt: skip
    return pieces, offsets, list(said)


def _rows(
    recording: Recording,
    stretch: Stretch,
    offsets: dict[str, ClockReport],
    mapping: RecorderMapping,
    start: float,
    end: float,
) -> Array:
    """Times of the rows [s] that all clocks cover."""
    origin = recording.clocks[mapping.first_clock].t[0]
    start, end = max(start, stretch.t[0] - origin), min(end, stretch.t[-1] - origin)
    for clock, report in offsets.items():
        times = recording.clocks[clock].t + report.offset - origin
        start, end = max(start, times[0]), min(end, times[-1])
    # The log's times are whole multiples of its period.
    first, last = int(np.ceil(start / PERIOD - 1e-6)), int(np.floor(end / PERIOD + 1e-6))
    return np.asarray(np.arange(first, last + 1) * PERIOD, dtype=float)


def _columns(
    recording: Recording, stretch: Stretch, t: Array, offsets: dict[str, ClockReport], mapping: RecorderMapping
) -> dict[str, Array]:
    """All quantities at the rows' times t [n]."""
    origin = recording.clocks[mapping.first_clock].t[0]
    columns = {key: resample(t, stretch.t - origin, values) for key, values in stretch.columns.items()}
    for clock, readings in recording.clocks.items():
        for key in readings.signals if clock != mapping.first_clock else ():
            times, values = readings.seen(key)
            between = mapping.signals[key].between if key in mapping.signals else "linear"  # x, y of a position
            columns[key] = resample(t, times + offsets[clock].offset - origin, values, between)
    if "vx" in columns and not VELOCITY & set(mapping.signals) <= set(stretch.columns):
        columns = from_velocity(columns, mapping.measured_point)
    for key, formula in mapping.formulas.items():
        columns[key] = np.broadcast_to(evaluate(formula, columns | mapping.constants), t.shape).astype(float)
    if "beta" in columns:
        columns["beta"] = np.angle(np.exp(1j * columns["beta"]))
    return columns


def resample(rows: Array, t: Array, values: Array, between: str = "linear") -> Array:
    """Values read at times t [s] on the log's rows [s]: on a line between two readings, or held until the next."""
    if between == "hold":
        return np.asarray(values[np.clip(np.searchsorted(t, rows, side="right") - 1, 0, len(t) - 1)])
    return np.asarray(np.interp(rows, t, values))


def as_run(piece: Piece, mapping: RecorderMapping, sentences: Sequence[str]) -> Run:
    """One run; sentences: on what looks wrong in its recording.

    Raises:
        InvalidRecordingError: no car's log may look like that.
    """
    try:
        present = {key: piece.columns[key] for key in COLUMNS if key in piece.columns}
        return Run(name=piece.name, trusted=mapping.trust, recording="", **present)
    except InvalidLogError as error:
        said = " ".join([f"{_not_raw(str(error), mapping)}.", *sentences]).removesuffix(".")
        raise InvalidRecordingError(f"{piece.path}: {said}") from None


def _not_raw(said: str, mapping: RecorderMapping) -> str:
    """What is said of a column that is too large, where its unit is not what is wrong."""
    what, _, guess = said.partition("; it looks like ")
    for key, signal in mapping.signals.items():
        if f"column {key} reaches" in what and guess.startswith(f"{signal.unit},"):
            return f"{what}; it is read as {signal.unit} already: give the factor of its raw counts as its 'scale'"
    return said


def _report(piece: Piece, run: Run, sentences: list[str]) -> RunReport:
    std = piece.stretch.std | {key: value for key, value in piece.noise.items() if key in COLUMNS}
    return RunReport(piece.name, piece.label, float(run.t[0]), float(run.t[-1]), len(run),
                     piece.stretch.noise | piece.noise, std, piece.stretch.bandwidth, sentences)  # fmt: skip


def _noise_of_other_clocks(recording: Recording, mapping: RecorderMapping) -> dict[str, float]:
    """Standard deviation of one reading (SI) of the log's columns that are not on the log's clock."""
    noise = {}
    for name, signal in mapping.signals.items():
        if signal.clock != mapping.first_clock and name in MEASURED:
            t, values = recording.clocks[signal.clock].seen(name)
            if len(t) >= SHORTEST:
                noise[name] = noise_of(t, without_jumps(values))
    return noise


def _slow_columns(recording: Recording) -> list[str]:
    """Sentences on measured columns that are read less often than the log has rows."""
    sentences = []
    for readings in recording.clocks.values():
        names = sorted(set(readings.signals) & {*MEASURED, "psi"} & set(COLUMNS))
        if names and readings.period > SLOW * PERIOD:
            sentences.append(
                f"{', '.join(names)} {'is' if len(names) == 1 else 'are'} read each {readings.period:.2g} s: the rows "
                "between are interpolated, and the noise is not white."
            )
    return sentences
