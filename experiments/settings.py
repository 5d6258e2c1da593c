"""A folder of results is gone on with: by the settings that it was begun with, and what is there is not made again."""

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

from drift_drake.common.errors import DriftDrakeError
from drift_drake.common.executors import ExecutorConfig, run_jobs
from drift_drake.common.run_folder import is_done, plain, write_json, write_versions

Job = TypeVar("Job")


class OtherExperimentError(DriftDrakeError, ValueError):
    """A folder that holds runs of another experiment; the message names it and what differs."""


def keep_settings(folder: Path, settings: Mapping[str, Any], free: Sequence[str]) -> None:
    """Writes config.json and versions.json; settings that are `free` may change from call to call.

    Raises:
        OtherExperimentError: the results there were made with others.
    """
    path, entry = folder / "config.json", plain(settings)
    before = json.loads(path.read_text()) if is_done(path) else {}
    differ = [name for name in before if name not in free and before[name] != entry.get(name)]
    if differ:
        raise OtherExperimentError(
            f"{folder} holds runs made with another {', '.join(differ)}; give another folder, or the settings of {path}"
        )
    write_json(path, entry)
    write_versions(folder)


def kept(path: Path, make: Callable[[], Any]) -> Any:
    """What a JSON file of results holds; made and written first where it is not there whole."""
    if not is_done(path):
        write_json(path, make())
    return json.loads(path.read_text())


def run_kept(
    run_on: ExecutorConfig, function: Callable[[Job], Any], jobs: Sequence[Job], file: Callable[[Job], Path],
    unit: str, tasks_per_worker: int = 0,
) -> list[Any]:  # fmt: skip
    """The results of all jobs, each kept in a JSON file of its own; those that are there are not run again.

    Args:
        file: of a job; the others as for `run_jobs`.
    """
    missing = [job for job in jobs if not is_done(file(job))]
    run_jobs(run_on, function, missing, lambda job, result: write_json(file(job), result), unit,
             tasks_per_worker=tasks_per_worker)  # fmt: skip
    return [json.loads(file(job).read_text()) for job in jobs]
