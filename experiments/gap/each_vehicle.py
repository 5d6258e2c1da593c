"""One file of results a vehicle, so that a run that was broken off goes on."""

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

from tqdm import tqdm

from experiments.settings import kept

Results = list[dict[str, Any]]


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
