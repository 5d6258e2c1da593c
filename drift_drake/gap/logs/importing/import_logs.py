"""Recordings to runs of the log format, and to a case folder: the function behind `drift-drake import`."""

import dataclasses
import math
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from drift_drake.car.log.table import COLUMNS, IMPORT_REPORT, Run, run_paths, write_run
from drift_drake.common.errors import InvalidOptionError, OutputError, meant
from drift_drake.common.run_folder import write_json
from drift_drake.common.safe_files import alone_in, writing_together
from drift_drake.gap.logs.importing.importer import ImportReport, import_recordings
from drift_drake.gap.logs.importing.mapping import RecorderMapping, read_mapping


class Imported(NamedTuple):
    """Runs at 100 Hz, and what was estimated on the way and looks wrong."""

    runs: list[Run]
    report: ImportReport


def import_logs(
    recordings: str | Path | Sequence[str | Path], mapping: str | Path | RecorderMapping, out: str | Path | None = None,
    *, start: float = 0.0, end: float = math.inf, trust: Sequence[str] = (), dbc: Sequence[str | Path] = (),
) -> Imported:  # fmt: skip
    """Turns a recorder's files into runs of the log format, and writes them as a case folder where `out` is given.

    Examples:
        >>> imported = import_logs("lap.mcap", "mine.yaml", out="logs/monday")  # doctest: +SKIP
        >>> print(imported.report.remarks)  # doctest: +SKIP

    Args:
        recordings: a file, or files of one vehicle on one day; mapping: a mapping file's path, a preset's name, or a
            mapping: columns, units, frames and clocks;
        out: new folder for run_0.csv, run_1.csv, ... and import.json;
        start, end: part of each recording to keep [s after its first reading];
        trust: columns of the log to take as they are, however large;
        dbc: databases of CAN messages, by which raw frames are decoded.

    Raises:
        InvalidRecordingError, InvalidMappingError: of a file: names it, the place and the remedy;
        InvalidOptionError: another argument cannot be used; OutputError: the folder holds runs, or cannot be written.
    """
    paths = [recordings] if isinstance(recordings, str | Path) else list(recordings)
    check_asked(out, start, end, trust)
    given = mapping if isinstance(mapping, RecorderMapping) else read_mapping(str(mapping))
    given = dataclasses.replace(given, trust=(*given.trust, *trust))
    if out is None:
        return Imported(*import_recordings(paths, given, start, end, dbc))
    out = Path(out)
    with alone_in(out):
        check_asked(out, start, end, trust)  # nobody else has written runs since
        imported = Imported(*import_recordings(paths, given, start, end, dbc))
        write_case(out, *imported, given)
    return imported


def check_asked(out: str | Path | None, start: float, end: float, trust: Sequence[str]) -> None:
    """Sees that an import's options can be used.

    Raises:
        InvalidOptionError: names the option and the remedy; OutputError: the folder is a file, or holds runs.
    """
    if not start < end:
        raise InvalidOptionError(f"--start {start:g} --end {end:g}: give a start before the end")
    for name in trust:
        if name not in COLUMNS:
            raise InvalidOptionError(f"--trust {name}: is not a column of the log; {meant(name, COLUMNS)}")
    if out is not None and Path(out).exists():
        if not Path(out).is_dir():
            raise OutputError(f"{out}: is a file; give a new folder")
        if run_paths(Path(out)):
            raise OutputError(f"{out}: holds runs already; give a new folder")


def write_case(folder: Path, runs: Sequence[Run], report: ImportReport, mapping: RecorderMapping) -> None:
    """Writes the runs and the report, which holds the mapping too: all of them or none."""
    with writing_together(folder) as part:
        for number, run in enumerate(runs):
            write_run(run, part / f"run_{number}.csv")
        write_json(part / IMPORT_REPORT, dataclasses.asdict(report) | {"mapping": dataclasses.asdict(mapping)})
