"""Offsets of a recording's clocks to the log's, from the rows or from a motion that both clocks saw."""

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray

from drift_drake.logs.importing.checks import compare
from drift_drake.logs.importing.clock import estimate_offset
from drift_drake.logs.importing.mapping import Align, RecorderMapping
from drift_drake.logs.importing.recording import Recording
from drift_drake.logs.importing.stretches import Stretch
from drift_drake.logs.importing.units import QUANTITIES, dimension

Array = NDArray[np.float64]

ALIKE = 0.7  # correlation below which an offset is not believed
DRIFT = 0.03  # [s] over a recording: more, and one offset does not fit
DEVIATIONS = 5.0  # of the drift's estimate that a drift must exceed


@dataclasses.dataclass(frozen=True)
class ClockReport:
    """What was added to a clock to read the log's.

    offset [s], with its standard deviation std [s] where it was estimated (None where the rows or the mapping gave it);
    correlation and gain of the two signals; arrival [s]: how much later than taken its readings stand in the rows.
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
        arrived = np.interp(readings.rows, first.rows, first.t)
        paired = float(np.median(arrived - readings.t))
        start = paired if clock.offset is None else clock.offset
        reports[name] = ClockReport(start, None, None, None, paired - start)
        if clock.offset is None:
            remarks += _drift(name, readings.t, arrived, first.period)
        if clock.align is None:
            continue
        try:
            reports[name], wrong = _aligned(recording, stretches, mapping, clock.align, start, paired)
            remarks += wrong
        except ValueError as error:
            remarks.append(f"the offset of clock {name} is not known from {clock.align.signal}: {error}.")
    return reports, remarks


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
    kind = dimension(signal.unit)
    if kind != QUANTITIES[align.against]:
        return report, []
    return report, compare(align.signal, kind, z, np.interp(t + found.offset, t_ref, ref), f"motion's {align.against}")


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
