"""What is run: the experiments that the paper's claims rest on, under its recipe and as shipped, each in its folder."""

import dataclasses
import json
import os
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, Literal, get_args

from drift_drake.common.run_folder import is_done, write_json
from experiments.benchmarks.vehicles import Population
from experiments.drifting import figure_8, improvements, loops
from experiments.drifting.runs import Model, ModelsConfig
from experiments.gathering.recipe import Recipe
from experiments.made import RunConfig, SpreadConfig
from experiments.model.build import do_stages
from experiments.model.ladder import LadderConfig, stages
from experiments.paper import drives, worth

Part = Literal["drives", "figure_8", "loops", "steps", "worth", "figures"]
Kind = Literal["recipe", "shipped"]
KINDS: tuple[Kind, ...] = get_args(Kind)
FIGURE_8: tuple[Model, ...] = ("prior", "online", "once_ocp", "once_info", "twice_info")
LOOPS: tuple[Model, ...] = ("online", "twice_info")
STEPS = (
    "paper",
    "extras",
    "plans",
    "control",
    "model",
    "lags",
)  # of `improvements`, from the recipe to the shipped one


@dataclasses.dataclass(frozen=True)
class PaperConfig(SpreadConfig, RunConfig):
    """Which vehicles, which parts."""

    parts: tuple[Part, ...] = get_args(Part)
    vehicles: int = 20
    seeds: int = 1
    """Attempts of each vehicle on the figure-8 and the loops; the paper has three and two of one car."""
    few: int = 4
    """Vehicles of what is compared one change at a time (steps, worth, alphas)."""
    population: Population = "held_out"
    vehicle_seed: int = 0
    """Of the draw of the vehicles."""
    rebuild: bool = False
    """Train the paper's model anew first; without, the shipped checkpoint of its recipe."""


def recipe(config: PaperConfig, kind: Kind, folder: Path) -> dict[str, Any]:
    """The options that make an experiment the paper's recipe, or leave it as shipped."""
    if kind == "shipped":
        return {}
    return {"as_in_paper": True, "checkpoint": rebuilt_file(folder) if config.rebuild else None}


def drawn(config: PaperConfig, vehicles: int) -> dict[str, Any]:
    """The options that say which vehicles."""
    return {
        "vehicles": vehicles, "population": config.population, "vehicle_seed": config.vehicle_seed,
        "run_on": config.run_on,
    }  # fmt: skip


def rebuilt_file(folder: Path) -> Path:
    """Where the model of `--rebuild` is."""
    return folder / "rebuilt" / "plain.npz"


def rebuild(config: PaperConfig, folder: Path) -> None:
    """Drives of 35 vehicles, and the paper's training on them: where `experiments.model.ladder` begins."""
    whole = LadderConfig(folder / "rebuilt", run_on=config.run_on)
    do_stages(whole, stages(whole)[:2])


def tasks(config: PaperConfig, folder: Path) -> dict[str, Callable[[], None]]:
    """What each part does, by name, in the order of the paper; each goes on with what its folder holds."""
    few = min(config.few, config.vehicles)
    found: dict[str, Callable[[], None]] = {}
    for kind in KINDS:
        options = recipe(config, kind, folder) | drawn(config, config.vehicles) | {"noise_seeds": config.seeds}
        found[f"figure_8/{kind}"] = partial(
            figure_8.main, ModelsConfig(**options, models=FIGURE_8, out=folder / "figure_8" / kind)
        )
        found[f"loops/{kind}"] = partial(
            loops.main, loops.LoopsConfig(**options, models=LOOPS, out=folder / "loops" / kind)
        )
    gathering = {kind: Recipe(**recipe(config, kind, folder)).resolved() for kind in KINDS}
    found["drives"] = partial(drives.main, drives.DrivesConfig(
        gathering["recipe"], gathering["shipped"], config.vehicles, few, config.population, config.vehicle_seed,
        config.run_on, folder / "drives",
    ))  # fmt: skip
    found["steps"] = partial(improvements.main, improvements.ImprovementsConfig(
        **drawn(config, few), maneuver="loops", models=LOOPS, rungs=STEPS, out=folder / "steps",
    ))  # fmt: skip
    found["worth"] = partial(worth.main, worth.WorthConfig(**drawn(config, few), out=folder / "worth"))
    order = ("drives", *(f"{name}/{kind}" for name in ("figure_8", "loops") for kind in KINDS), "steps", "worth")
    return {name: found[name] for name in order if name.split("/")[0] in config.parts}


def run_parts(config: PaperConfig, folder: Path) -> None:
    """Does what the folder lacks; says which part, what is left of it is in its progress bar."""
    if config.rebuild:
        rebuild(config, folder)
    todo, began = tasks(config, folder), time.monotonic()
    file = folder / "parts.json"
    done = json.loads(file.read_text()) if is_done(file) else {}
    for number, (name, task) in enumerate(todo.items(), 1):
        print(f"part {number} of {len(todo)}: {name}, {(time.monotonic() - began) / 60.0:.0f} min so far", flush=True)
        start = time.monotonic()
        task()
        load = os.getloadavg()[2] / (os.cpu_count() or 1)
        done[name] = {"seconds": time.monotonic() - start, "load of a core": load}
        write_json(file, done)
