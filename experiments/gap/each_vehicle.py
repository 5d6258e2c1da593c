"""One file of results a vehicle, so that a run that was broken off goes on."""

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from tqdm import tqdm

from drift_drake.common.run_folder import is_done, write_json, write_versions

Results = list[dict[str, Any]]


def each_vehicle(
    folder: Path, config: Any, vehicles: int, one_vehicle: Callable[[Any, int], dict[str, Any]]
) -> Iterator[Results]:
    """Does the vehicles that are not done yet; gives the results so far after each, and writes the configuration.

    Args:
        folder: of the run; one_vehicle: a vehicle's results as plain data, from `config` and its number.
    """
    write_json(folder / "config.json", config)
    write_versions(folder)
    (folder / "vehicles").mkdir(exist_ok=True)
    results: Results = []
    for index in tqdm(range(vehicles), unit="vehicle"):
        path = folder / "vehicles" / f"{index:03d}.json"
        if not is_done(path):
            write_json(path, one_vehicle(config, index))
        results.append(json.loads(path.read_text()))
        yield results
