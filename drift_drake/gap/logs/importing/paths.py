"""Recordings of a satellite receiver alone: its path, and what follows from it.

Without a yaw rate there is no sideslip, and without a steering command nothing to compare the car with: such a
recording is no log. Its path, speed and accelerations are written to be looked at.
"""

import dataclasses
import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from drift_drake.gap.logs.importing.formats.files import InvalidRecordingError
from drift_drake.gap.logs.importing.known import missing_quantities, not_given
from drift_drake.gap.logs.importing.mapping import RecorderMapping
from drift_drake.gap.logs.importing.recording import read_recording
from drift_drake.gap.logs.importing.stretches import moving_stretches, stretch_of

COLUMNS = {"t": "t", "x": "x", "y": "y", "course": "course", "v": "v", "path_ax": "ax", "path_ay": "ay"}
USUAL = 99.0  # percentile of the accelerations that is stated: the largest ones are noise
GRAVITY = 9.81


@dataclasses.dataclass(frozen=True)
class DrivenPath:
    """A stretch of a recording: t [s] after its first reading, x, y [m], course [rad], v [m/s], and the accelerations
    along (ax) and across (ay, to the left) the path [m/s^2]."""

    recording: str
    table: pd.DataFrame


def import_paths(
    files: Sequence[str | Path],
    mapping: RecorderMapping,
    start: float = 0.0,
    end: float = math.inf,
    databases: Sequence[str | Path] = (),
) -> tuple[list[DrivenPath], list[str]]:
    """Paths of all recordings without gaps, and sentences on readings that were left out.

    Args:
        start, end: part of each recording to keep [s after its first reading].

    Raises:
        InvalidRecordingError: a file cannot be used; the message names it, the place and the remedy.
    """
    paths, remarks = [], []
    for file in files:
        recording = read_recording(file, mapping, databases)
        readings = recording.clocks[mapping.first_clock]
        remarks += [f"{recording.name}: {sentence}" for sentence in recording.remarks]
        found = []
        for part in moving_stretches(readings, mapping):
            stretch = stretch_of(readings, part, mapping)
            t = stretch.t - readings.t[0]
            kept = (t >= start) & (t <= end)
            columns = {"t": t} | stretch.columns
            table = pd.DataFrame({short: columns[name][kept] for name, short in COLUMNS.items()})
            if len(table):
                found.append(DrivenPath(recording.name, table))
        if not found:
            raise InvalidRecordingError(f"{file}: holds no positions without gaps; leave it out")
        paths += found
    return paths, remarks


def path_sentences(paths: Sequence[DrivenPath], mapping: RecorderMapping) -> list[str]:
    """What the paths show, a line each, and what they do not."""
    lines = []
    for number, path in enumerate(paths):
        table = path.table
        across = float(np.percentile(np.abs(table["ay"]), USUAL))
        start, end = table["t"].iloc[0], table["t"].iloc[-1]
        lines.append(
            f"path_{number}: {path.recording}, {start:.2f} to {end:.2f} s, {len(table)} rows; "
            f"up to {table['v'].max():.3g} m/s and {across:.3g} m/s^2 across the path "
            f"(its tyres had a friction of {across / GRAVITY:.2g} or more)"
        )
    return [*lines, not_given(missing_quantities(mapping))]
