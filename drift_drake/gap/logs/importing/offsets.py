"""Offsets of a recording's clocks to the log's, from the rows or from a motion that both clocks saw."""

import dataclasses
import math

import numpy as np

from drift_drake.common.arrays import Array
from drift_drake.gap.logs.clock_offset import estimate_offset
from drift_drake.gap.logs.importing.mapping import Align, Clock, RecorderMapping
from drift_drake.gap.logs.importing.recording import Readings, Recording
from drift_drake.gap.logs.importing.stretches import LARGEST_GAP, Stretch
from drift_drake.gap.logs.screening.unit_mistakes import mistakes
from drift_drake.gap.logs.wording.conversion import QUANTITIES, dimension

ALIKE = 0.7  # correlation below which an offset is not believed
ABSOLUTE = 1e8  # [s] since 1970: the clock tells the date
DRIFT = 0.03  # [s] over a recording: more, and one offset does not fit
CLOSE, EQUAL = math.log(1.25), math.log(1.12)  # of a gain to one, where all is well, and to a unit's factor
DEVIATIONS = 5.0  # of the drift's estimate that a drift must exceed


@dataclasses.dataclass(frozen=True)
class ClockReport:
    """What was added to a clock to read the log's.

    offset [s], with its standard deviation std [s] where it was estimated (None where the rows or the mapping gave it);
    correlation and gain of the two signals; arrival [s]: how much later than taken its readings stand in the
    rows (0 where they stand in rows of their own).
    """

    offset: float
    std: float | None
    correlation: float | None
    gain: float | None
    arrival: float


def clock_offsets(
    recording: Recording, stretches: list[Stretch], mapping: RecorderMapping
) -> tuple[dict[str, ClockReport], list[str]]:
    """Offsets of all clocks but the log's, and sentences on what looks wrong with them."""
    reports, remarks = {}, []
    first = recording.clocks[mapping.first_clock]
    for name, readings in recording.clocks.items():
        if name == mapping.first_clock:
            continue
        clock = mapping.clocks[name]
        paired = readings.topic == first.topic
        arrived = np.interp(readings.rows, first.rows, first.t) if paired else readings.t - readings.t[0] + first.t[0]
        simultaneous = float(np.median(arrived - readings.t))
        start = _start(clock, readings, first, simultaneous)
        reports[name] = ClockReport(start, None, None, None, simultaneous - start if paired else 0.0)
        if clock.offset is None and paired:
            remarks += _drift(name, readings.t, arrived, first.period)
        remarks += _gaps(name, readings, mapping)
        if clock.align is None:
            continue
        try:
            reports[name], wrong = _aligned(recording, stretches, mapping, clock.align, start, simultaneous)
            remarks += wrong
        except ValueError as error:
            remarks.append(f"the offset of clock {name} is not known from {clock.align.signal}: {error}.")
    return reports, remarks


def _start(clock: Clock, readings: Readings, first: Readings, simultaneous: float) -> float:
    """The offset [s] before any alignment: as stated, none where both clocks have one epoch, else from the rows."""
    if clock.offset is not None:
        return clock.offset
    absolute = min(readings.t[0], first.t[0]) > ABSOLUTE
    overlap = min(readings.t[-1], first.t[-1]) > max(readings.t[0], first.t[0])
    shared = clock.epoch == "shared" or (
        clock.epoch == "auto" and overlap and (absolute or readings.topic != first.topic)
    )
    return 0.0 if shared else simultaneous


def _gaps(name: str, readings: Readings, mapping: RecorderMapping) -> list[str]:
    """Sentences on times without readings of a clock that is not the log's, whose rows are interpolated."""
    steps = np.diff(readings.t)
    long = np.flatnonzero(steps > max(LARGEST_GAP, 5.0 * readings.period))
    if not len(long):
        return []
    worst = int(long[np.argmax(steps[long])])
    names = ", ".join(sorted(key for key, signal in mapping.signals.items() if signal.clock == name))
    start, end = readings.t[worst] - readings.t[0], readings.t[worst + 1] - readings.t[0]
    many = "" if len(long) == 1 else f", the longest of {len(long)} such gaps"
    return [
        f"clock {name} has no readings from {start:.2f} to {end:.2f} s{many}: {names} "
        f"{'are' if ',' in names else 'is'} interpolated there; leave the time out with --start and --end."
    ]


def _aligned(
    recording: Recording, stretches: list[Stretch], mapping: RecorderMapping, align: Align, start: float, paired: float
) -> tuple[ClockReport, list[str]]:
    signal = mapping.signals[align.signal]
    readings = recording.clocks[signal.clock]
    z = readings.signals[align.signal]
    t_ref = np.concatenate([stretch.t for stretch in stretches])
    ref = np.concatenate([stretch.columns[align.against] for stretch in stretches])
    inside = np.zeros(len(z), dtype=bool)
    for stretch in stretches:
        at = readings.t + start
        inside |= (at > stretch.t[0] + align.search) & (at < stretch.t[-1] - align.search)
    inside &= np.isfinite(z)
    t, z = readings.t[inside], z[inside]
    found = estimate_offset(t, z, t_ref, ref, start, align.search)
    if abs(found.correlation) < ALIKE:
        raise ValueError(f"it is too little like {align.against} (correlation {found.correlation:.2g})")
    report = ClockReport(found.offset, found.std, found.correlation, found.gain, paired - found.offset)
    comparable = dimension(signal.unit) == QUANTITIES[align.against]
    return report, _disagreement(align, found.gain / abs(found.correlation)) if comparable else []


def _disagreement(align: Align, ratio: float) -> list[str]:
    """Sentences if a signal is not the motion that it is aligned with, by its scale or its sign.

    Args:
        ratio: of the signal's spread to the motion's, with the correlation's sign.
    """
    size, motion = abs(ratio), f"what the motion's {align.against} says"
    same = [m for m in mistakes(None) if m.columns == (align.against,) and abs(math.log(size / m.low)) < EQUAL]
    sentences = []
    if same:
        sentences.append(
            f"{align.signal} looks like {same[0].looks_like}: it is {size:.3g} times {motion}; {same[0].remedy}."
        )
    elif abs(math.log(size)) > CLOSE:
        sentences.append(f"{align.signal} is {size:.3g} times {motion}: check its unit or scale.")
    if ratio < 0.0:
        sentences.append(
            f"{align.signal} has the opposite sign of {motion}: another axis convention (NED, SAE) or sign?"
        )
    return sentences


def _drift(name: str, t: Array, arrived: Array, period: float) -> list[str]:
    if len(t) < 10:
        return []
    slope, _ = np.polyfit(t - t[0], arrived - arrived[0], 1)
    duration = float(t[-1] - t[0])
    total = (float(slope) - 1.0) * duration
    uncertainty = period * math.sqrt(12.0 / len(t))  # of the total, from times of arrival known to a row
    if abs(total) < max(DRIFT, DEVIATIONS * uncertainty):
        return []
    return [f"clock {name} drifts by {total:+.2g} s over the recording's {duration:.0f} s: one offset does not fit."]
