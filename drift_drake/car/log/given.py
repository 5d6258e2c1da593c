"""Logs as a function is given them: the path of a case folder or a run's file, or runs."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from drift_drake.car.log.cases import case_name
from drift_drake.car.log.table import InvalidLogError, Run, read_case, stated_noise

Logs = str | Path | Run | Sequence[Run]


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
