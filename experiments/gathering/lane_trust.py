"""What is usual of informative drives for the vehicles that a model was made for, and who would be refused.

    python -m experiments.gathering.lane_trust
    python -m experiments.gathering.lane_trust --checkpoint runs/bayesian_model.npz --keep runs/lane_trust.json

The mean squared distance of the first drive's innovations (`drift_drake.gathering.choice`), and how far off half a
second ahead the model and the car that the drives identify are after two (`drift_drake.gathering.choice`), give three
limits on validation vehicles. Held-out, `wide` and `extreme` vehicles, and held-out ones as a double-track car, are
judged by them. Written: numbers.json, report.md, lane_trust.png. Broken off, it goes on where it was (give --out). With
--keep, what is usual is added to a file, as the package's data/lane_trust.json holds it for the shipped models.
"""

import dataclasses
from functools import partial
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
import tyro
from matplotlib.figure import Figure

from diagrams.command import run_command
from drift_drake.arrays import Array
from drift_drake.drives.vehicles import EXTREME, Population, draw_effects
from drift_drake.executors import ExecutorConfig
from drift_drake.gathering.choice import REFUSED, Believed, Findings, Usual, familiar_from, keep_usual
from drift_drake.gathering.config import Recipe
from drift_drake.model.checkpoint import BayesianModel, load_model
from drift_drake.pictures.style import BOUND, INK, RUNS, new_figure, styled
from drift_drake.run_folder import make_run_folder, write_json, write_versions
from drift_drake.safe_files import write_figure
from drift_drake.vehicle.effects import Effects
from experiments.gathering.beliefs import gather_all
from experiments.made import write_report
from experiments.other_worlds.true_cars import World, effects_in, true_car
from experiments.settings import keep_settings

GROUPS: dict[str, tuple[Population, World]] = {
    "validation": ("validation", "single_track"),
    "held-out": ("held_out", "single_track"),
    "wide": ("wide", "single_track"),
    "extreme": ("extreme", "single_track"),
    "double-track": ("held_out", "double_track"),
    "brush": ("held_out", "brush"),
}


@dataclasses.dataclass(frozen=True)
class LaneTrust(Recipe):
    """Which model, how many vehicles."""

    vehicles: int = 40
    """Of each population; of the extreme ones, one each."""
    first: int = 0
    """Index of the first vehicle of each population."""
    vehicle_seed: int = 0
    """Of the draw of the vehicles."""
    keep: Path | None = None
    """File that what is usual is added to."""
    run_on: Annotated[ExecutorConfig, tyro.conf.arg(name="")] = dataclasses.field(default_factory=ExecutorConfig)
    out: Path | None = None
    """Folder for the results; one that holds some drives of the same experiment already is gone on with."""


class Found(NamedTuple):
    """Of a group's vehicles."""

    surprise: Array  # mean squared distance of the first informative drive
    learnt: Array  # forecast error of the learnt model after two drives
    identified: Array  # the same of the car that they identify, as it is; infinite where none was
    further: Array  # and with one thing more, or as a double-track car, where that is asked for


def true_effects(population: Population, world: World, seed: int, vehicle: int) -> Effects:
    """What is true of a group's vehicle."""
    return effects_in(world, draw_effects(population, vehicle, seed))


def judge(config: LaneTrust, learnt: BayesianModel, folder: Path) -> dict[str, Found]:
    """All groups' vehicles, but those without a second plan."""
    found = {}
    for name, (population, world) in GROUPS.items():
        count = len(EXTREME) if population == "extreme" else config.vehicles
        drives = folder / name
        drives.mkdir(exist_ok=True)
        attempts = [(config.first + i, 0) for i in range(count)]
        effects_of = partial(true_effects, population, world, config.vehicle_seed)
        taught = gather_all(attempts, effects_of, frozenset({"identified"}), learnt, config.gathering, drives,
                            config.run_on, partial(true_car, world, seed=config.vehicle_seed))  # fmt: skip
        told = [(t.surprise, t.findings) for t in taught.values() if t.surprise is not None and t.findings]
        found[name] = Found(*np.array([(surprise, f.learnt, f.as_it_is, f.identified) for surprise, f in told]).T)
    return found


def limits(found: dict[str, Found]) -> Usual:
    """What is usual, by the validation vehicles."""
    known = found["validation"]
    return Usual(*(familiar_from(values) for values in (known.surprise, known.learnt, known.identified)))


def report(found: dict[str, Found], usual: Usual) -> str:
    """Who would be refused, as Markdown."""
    first, learnt, identified = (one.limit() for one in usual)
    lines = [
        f"Beyond each limit are {REFUSED:.1%} of vehicles like those trained on: a mean squared distance of "
        f"{first:.1f} in the first drive; after two a forecast error of {learnt:.3f} (learnt model) and of "
        f"{identified:.4f} (identified car).",
        "",
        "| vehicles | mean squared distance, least / median / most | refused by it | forecast error, learnt model "
        "| forecast error, identified car as it is | and further | learnt model believed | identified car believed "
        "| neither |",
        "| --- | --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    kinds: tuple[Believed, ...] = ("learnt", "identified", "neither")
    for name, f in found.items():
        believed = [
            usual.choice(Findings(None, one, two)).believed for one, two in zip(f.learnt, f.further, strict=True)
        ]
        count = len(believed)
        chosen = " | ".join(f"{believed.count(kind)} of {count}" for kind in kinds)
        lines.append(
            f"| {name} | {spread(f.surprise, 1)} | {int(np.sum(f.surprise > first))} of {count} "
            f"| {spread(f.learnt, 3)} | {spread(f.identified, 3)} | {spread(f.further, 3)} | {chosen} |"
        )
    return "\n".join(lines)


def spread(values: Array, digits: int) -> str:
    """Least, median and most."""
    return " / ".join(f"{q:.{digits}f}" for q in np.quantile(values, [0.0, 0.5, 1.0], method="nearest"))


@styled
def draw(found: dict[str, Found], usual: Usual) -> Figure:
    """Rows of points a group, limits as lines: the first drive's surprise, and both models' forecast errors."""
    figure = new_figure(7.0, 4.4)
    above, below = figure.subplots(2, 1)
    rng = np.random.default_rng(0)
    parts = ((above, "surprise", INK, 0.0), (below, "learnt", INK, -0.2), (below, "further", RUNS[0], 0.2))
    for axes, name, color, shift in parts:
        axes.axvline(
            getattr(usual, "identified" if name == "further" else name).limit(),
            color=color if axes is below else BOUND,
            linestyle="--",
        )
        for row, f in enumerate(found.values()):
            values = getattr(f, name)
            at = row + shift + rng.uniform(-0.1, 0.1, len(values))
            label = {"learnt": "learnt model", "further": "identified car"}.get(name) if row == 0 else None
            axes.scatter(values, at, s=12, color=color, alpha=0.7, linewidths=0, label=label)
    for axes in (above, below):
        axes.set_xscale("log")
        axes.set_yticks(range(len(found)), list(found))
        axes.invert_yaxis()
    above.set_xlabel("mean squared distance of the first informative drive [-]")
    below.set_xlabel("forecast error after both drives [-]")
    below.legend()
    return figure


def main(config: LaneTrust) -> None:
    """Drives all vehicles, then writes numbers, a table and a picture."""
    config = config.resolved()
    folder = make_run_folder("lane_trust", config.out)
    learnt = load_model(config.checkpoint)
    settings = dataclasses.asdict(config) | {"checkpoint": learnt.content_hash()}
    keep_settings(folder, settings, ("vehicles", "first", "keep", "run_on", "out"))
    write_versions(folder)
    found = judge(config, learnt, folder)
    usual = limits(found)
    numbers: dict[str, Any] = {
        "usual": {name: one._asdict() | {"limit": one.limit()} for name, one in usual._asdict().items()},
        "found": {name: f._asdict() for name, f in found.items()},
    }
    write_json(folder / "numbers.json", numbers)
    write_report(folder, report(found, usual), config)
    write_figure(draw(found, usual), folder / "lane_trust.png")
    if config.keep is not None:
        keep_usual(learnt, usual, config.keep)
    print(report(found, usual))
    print(f"results in {folder}")


if __name__ == "__main__":
    run_command(main, LaneTrust, __doc__)
