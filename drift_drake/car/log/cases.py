"""Folders of runs (cases), folders of such folders, and logs as a function is given them."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from drift_drake.car.log.table import COLUMNS, InvalidLogError, Run, read_case, run_paths, stated_noise

if TYPE_CHECKING:
    import pandas as pd

Logs = str | Path | Run | Sequence[Run]  # a case folder's or a run's path, or runs


def only_run(path: Path, option: str) -> Run:
    """The one run of a log, by the name of its path; option: that the log was given to.

    Raises:
        InvalidLogError: there are several, or none that can be used.
    """
    first, *others = read_case(path)
    if others:
        raise InvalidLogError(f"{path}: holds {1 + len(others)} runs; give the file of one to {option}")
    return dataclasses.replace(first, name=str(path))


def case_name(folder: Path) -> str:
    """Name of a case: its folder's own, which is its folder's only even where folders are links; or its file's."""
    if folder.is_file():
        return Path(folder.name.removesuffix(".gz")).stem
    return folder.name if folder.name not in ("", "..") else folder.resolve().name


def case_folders(folder: str | Path) -> list[Path]:
    """The folder itself if it holds runs (or the file of one), else its subfolders that do.

    Raises:
        InvalidLogError: there is no run in either.
    """
    folder = Path(folder)
    if run_paths(folder):
        return [folder]
    if not folder.is_dir():
        raise InvalidLogError(f"{folder}: no such folder; give a case (run_0.csv, run_1.csv, ...) or a folder of cases")
    cases = sorted(path for path in folder.iterdir() if path.is_dir() and run_paths(path))
    if not cases:
        raise InvalidLogError(f"{folder}: holds no runs; a case is a folder of run_0.csv, run_1.csv, ...")
    return cases


class GivenLogs(NamedTuple):
    """Runs, what they are called together, and the noise that an import stated with them (SI)."""

    runs: list[Run]
    case: str
    noise: dict[str, float]


def logs_given(logs: Logs, case: str | None = None) -> GivenLogs:
    """The runs of a path, or runs as they are; `case`: what they are called, in place of the folder's name.

    Raises:
        InvalidLogError: the path holds no usable run, or what was given is neither a path nor runs.
    """
    if isinstance(logs, str | Path):
        return GivenLogs(read_case(logs), case or case_name(Path(logs)), stated_noise(logs))
    runs = [logs] if isinstance(logs, Run) else logs
    if not isinstance(runs, Sequence) or not runs or not all(isinstance(run, Run) for run in runs):
        raise InvalidLogError(f"logs: {type(logs).__name__} holds no runs; give a folder's or a file's path, or Run's")
    return GivenLogs(list(runs), case or "case", {})


def runs_of(tables: Sequence["pd.DataFrame"], name: str = "drive") -> list[Run]:
    """Simulated drives' logs as runs: drive_0, drive_1, ..."""
    columns: list[dict[str, Any]] = [
        {column: table[column].to_numpy(dtype=float) for column in COLUMNS if column in table} for table in tables
    ]
    return [Run(name=f"{name}_{k}", **found) for k, found in enumerate(columns)]
