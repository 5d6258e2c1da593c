"""A folder of results is gone on with: by the settings that it was begun with, and what is there is not made again."""

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from tqdm import tqdm

from drift_drake.common.errors import DriftDrakeError
from drift_drake.common.executors import ExecutorConfig, run_jobs
from drift_drake.common.run_folder import is_done, plain, write_json, write_versions

Job = TypeVar("Job")
Results = list[dict[str, Any]]


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


def each_vehicle(
    folder: Path, config: Any, vehicles: int, one_vehicle: Callable[[Any, int], dict[str, Any]]
) -> Iterator[Results]:
    """Does the vehicles that are not done yet; gives the results so far after each.

    Args:
        folder: of the run; one_vehicle: a vehicle's results as plain data, from `config` and its number.
    """
    (folder / "vehicles").mkdir(exist_ok=True)
    results: Results = []
    for index in tqdm(range(vehicles), unit="vehicle"):
        results.append(kept(folder / "vehicles" / f"{index:03d}.json", partial(one_vehicle, config, index)))
        yield results


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
