"""Makes worlds for `road`: double-track cars, cars of other sizes, multi-body cars of a `days.py` where one is given.

    python -m experiments.other_worlds.make_worlds runs/worlds --cars coupe roadster --seeds 0 1 --smooth 0 8
    python -m experiments.other_worlds.make_worlds runs/worlds --cars --multibody PATH/days.py --seeds 0

Each world is a folder of its own (`days` says of what); one that is there is not made again. A `days.py` takes
`OUT --car C --seed S --smooth HZ --none N` and writes the same files; its cars need the package vehiclemodels, of the
extra `worlds`.
"""

import dataclasses
import importlib.util
import itertools
import os
import subprocess
import sys
from pathlib import Path
from typing import Annotated

import tyro

from diagrams.command import run_command
from drift_drake.car.double_track.parameters import CARS
from drift_drake.common.errors import DriftDrakeError
from drift_drake.common.executors import ExecutorConfig, run_jobs
from drift_drake.common.run_folder import write_json
from experiments.other_worlds.days import ALL_CARS, RANGE, Days
from experiments.other_worlds.days import main as make_days
from experiments.other_worlds.drivers import DAY_ONE

PACKAGE = "vehiclemodels"


class MissingWorldError(DriftDrakeError, RuntimeError):
    """A world that cannot be made here; the message names the remedy."""


@dataclasses.dataclass(frozen=True)
class Worlds:
    """Worlds of several cars."""

    out: Annotated[Path, tyro.conf.Positional]
    """Folder for the worlds."""
    cars: tuple[str, ...] = tuple(CARS)
    """Cars of `days.ALL_CARS`; small, truck and electric are those on brush tyres."""
    seeds: tuple[int, ...] = (0,)
    smooth: tuple[float, ...] = (0.0, 8.0)
    """Bandwidths [Hz] of the sensors' low-pass; 0: none."""
    other_drives: tuple[bool, ...] = (False, True)
    """Whether days but the first are driven otherwise than the first."""
    none: int = 4
    """Days without an effect, of each world."""
    count: int = len(RANGE)
    """Days with one effect, of each world but the multi-body ones."""
    strange: int = 0
    """Days with a strange fault each, of each world but the multi-body ones."""
    first_runs: int = len(DAY_ONE)
    """Runs of the first day, of each world but the multi-body ones."""
    multibody: Path | None = None
    """A days.py of multi-body cars."""
    multibody_cars: tuple[int, ...] = (1, 3)
    """Its cars."""
    workers: int = 2
    """Processes."""


@dataclasses.dataclass(frozen=True)
class MultiBody:
    """One world of a `days.py`. `car`, `seed` and `smooth` are in its config.json, for `road`."""

    out: Path
    car: str
    number: int
    seed: int
    smooth: float
    none: int
    script: Path


def check_multibody(script: Path) -> None:
    """Whether worlds of a `days.py` can be made.

    Raises:
        MissingWorldError: says in one sentence what is missing.
    """
    if not script.is_file():
        raise MissingWorldError(f"{script}: no such file; give the path of a days.py, or leave --multibody out")
    if importlib.util.find_spec(PACKAGE) is None:
        raise MissingWorldError(f"{script}: needs the package {PACKAGE}; pip install 'drift_drake[worlds]'")


def worlds_of(config: Worlds) -> list[Days | MultiBody]:
    """Every world that is asked for.

    Raises:
        MissingWorldError: a car that there is not, or the multi-body cars cannot be made.
    """
    strange = [car for car in config.cars if car not in ALL_CARS]
    if strange:
        raise MissingWorldError(f"unknown car {strange[0]}; there are {', '.join(ALL_CARS)}")
    out: list[Days | MultiBody] = []
    for car, seed, smooth, other in itertools.product(config.cars, config.seeds, config.smooth, config.other_drives):
        name = f"{car}-{seed}-{smooth:g}hz" + ("-other" if other else "")
        out.append(Days(config.out / name, car, seed, smooth, config.none, config.count, other,  # type: ignore[arg-type]
                        strange=config.strange, first_runs=config.first_runs))  # fmt: skip
    if config.multibody is not None:
        check_multibody(config.multibody)
        for number, seed, smooth in itertools.product(config.multibody_cars, config.seeds, config.smooth):
            name = f"multibody{number}-{seed}-{smooth:g}hz"
            out.append(MultiBody(config.out / name, f"multibody{number}", number, seed, smooth, config.none,
                                 config.multibody))  # fmt: skip
    return out


def make_world(world: Days | MultiBody) -> None:
    """Makes a world next to its place, then puts it there: one that is broken off is not taken for whole."""
    part = world.out.with_name(world.out.name + ".part")
    part.mkdir(parents=True, exist_ok=True)
    if isinstance(world, Days):
        make_days(dataclasses.replace(world, out=part))
    else:
        command = [sys.executable, str(world.script), str(part), "--car", str(world.number), "--seed", str(world.seed),
                   "--smooth", str(world.smooth), "--none", str(world.none)]  # fmt: skip
        made = subprocess.run(command, capture_output=True, text=True, check=False,
                              env=os.environ | {"PYTHONDONTWRITEBYTECODE": "1"})  # fmt: skip
        if made.returncode:
            raise MissingWorldError(f"{world.script} failed: {made.stderr.strip().splitlines()[-1]}")
        write_json(part / "config.json", world)
    part.rename(world.out)


def main(config: Worlds) -> None:
    """Makes what is not there."""
    left = [world for world in worlds_of(config) if not world.out.exists()]
    run_jobs(ExecutorConfig(workers=config.workers), make_world, left, lambda _world, _nothing: None, "world")


if __name__ == "__main__":
    run_command(main, Worlds, __doc__)
