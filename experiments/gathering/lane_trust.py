"""What is usual of informative drives for the vehicles that a model was made for, and who would be refused.

    python -m experiments.gathering.lane_trust
    python -m experiments.gathering.lane_trust --checkpoint runs/bayesian_model.npz --add-to runs/lane_trust.json

The mean squared distance of the first drive's innovations, and how far off half a second ahead the car is that both
drives identify (`gap.choose.choice`), give two limits on validation vehicles. Held-out, `wide` and `extreme`
vehicles, held-out ones as a double-track car, and brush cars, whose equations the package has nothing of, are judged by
them. Written: numbers.json, report.md, lane_trust.png. Broken off, it goes on where it was (give --out). With --add-to,
what is usual is added to a file, as the package's data/lane_trust.json holds it for the shipped models.
"""

import dataclasses
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure

from diagrams.command import run_command
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.common.arrays import Array
from drift_drake.common.run_folder import make_run_folder
from drift_drake.common.safe_files import write_figure
from drift_drake.drive.learnt.checkpoint import BayesianModel, load_model
from drift_drake.gap.choose.choice import REFUSED, SURPRISED, Choice, Familiar, Findings
from drift_drake.view.colours import INK, RUNS
from drift_drake.view.style import BOUND, new_figure, styled
from experiments.benchmarks.vehicles import EXTREME, Population, draw_effects
from experiments.gathering.beliefs import gather_all
from experiments.gathering.familiar import familiar_from, keep_usual
from experiments.gathering.recipe import Recipe
from experiments.made import RunConfig, SpreadConfig, tabulated, write_results
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
class LaneTrust(Recipe, SpreadConfig, RunConfig):
    """Which model, how many vehicles."""

    vehicles: int = 40
    """Of each population; of the extreme ones, one each."""
    first: int = 0
    """Index of the first vehicle of each population."""
    vehicle_seed: int = 0
    """Of the draw of the vehicles."""
    add_to: Path | None = None
    """File that what is usual is added to."""


class Found(NamedTuple):
    """Of a group's vehicles."""

    surprise: Array  # mean squared distance of the first informative drive
    identified: Array  # forecast error of the car that two drives identify, as it is; infinite where none was
    further: Array  # and with an additional fault, or as a double-track car, where that is asked for


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
        pairs = [
            (t.surprise, t.findings["identified"]) for t in taught.values() if t.surprise is not None and t.findings
        ]
        found[name] = Found(*np.array([(surprise, f.as_it_is, f.error) for surprise, f in pairs]).T)
    return found


def usual_of(found: dict[str, Found]) -> tuple[Familiar, Familiar]:
    """What is usual by the validation vehicles: (the first drive's distance, the identified car's forecast error)."""
    known = found["validation"]
    return familiar_from(known.surprise), familiar_from(known.identified)


def report(found: dict[str, Found], surprise: Familiar, error: Familiar) -> str:
    """Who would be refused, as Markdown."""
    first, limit = surprise.limit(SURPRISED), error.limit()
    lines = [
        f"Beyond its limit are, of vehicles as they should be, {SURPRISED:.1%} in the first drive's mean squared "
        f"distance ({first:.1f}), and {REFUSED:.1%} in the forecast error of the car that both identify ({limit:.4f}).",
        "",
    ]
    heads = ("vehicles", "mean squared distance, least / median / most", "refused by it",
             "forecast error, identified car as it is", "and further", "believed")  # fmt: skip
    rows = []
    for name, f in found.items():
        refused, count = int(np.sum(f.surprise > first)), len(f.surprise)
        believed = sum(Choice(Findings(None, value), limit).believed == "identified" for value in f.further)
        rows.append((name, spread(f.surprise, 1), f"{refused} of {count}", spread(f.identified, 3),
                     spread(f.further, 3), f"{believed} of {count}"))  # fmt: skip
    return "\n".join([*lines, *tabulated(heads, rows)])


def spread(values: Array, digits: int) -> str:
    """Least, median and most."""
    return " / ".join(f"{q:.{digits}f}" for q in np.quantile(values, [0.0, 0.5, 1.0], method="nearest"))


@styled
def draw(found: dict[str, Found], surprise: Familiar, error: Familiar) -> Figure:
    """Rows of points a group, limits as lines: the first drive's surprise, and the identified car's forecast errors."""
    figure = new_figure(7.0, 4.4)
    above, below = figure.subplots(2, 1)
    rng = np.random.default_rng(0)
    above.axvline(surprise.limit(SURPRISED), color=BOUND, linestyle="--")
    below.axvline(error.limit(), color=BOUND, linestyle="--")
    for axes, name, color, shift in (
        (above, "surprise", INK, 0.0), (below, "identified", INK, -0.2), (below, "further", RUNS[0], 0.2),
    ):  # fmt: skip
        for row, f in enumerate(found.values()):
            values = getattr(f, name)
            at = row + shift + rng.uniform(-0.1, 0.1, len(values))
            label = {"identified": "as it is", "further": "an additional fault, or two tracks"}.get(name)
            axes.scatter(values, at, s=12, color=color, alpha=0.7, linewidths=0, label=None if row else label)
    for axes in (above, below):
        axes.set_xscale("log")
        axes.set_yticks(range(len(found)), list(found))
        axes.invert_yaxis()
    above.set_xlabel("mean squared distance of the first informative drive [-]")
    below.set_xlabel("forecast error of the identified car after both drives [-]")
    below.legend()
    return figure


def main(config: LaneTrust) -> None:
    """Drives all vehicles, then writes numbers, a table and a picture."""
    config = config.resolved()
    folder = make_run_folder("lane_trust", config.out)
    learnt = load_model(config.checkpoint)
    settings = dataclasses.asdict(config) | {"checkpoint": learnt.content_hash()}
    keep_settings(folder, settings, ("vehicles", "first", "add_to", "run_on", "out"))
    found = judge(config, learnt, folder)
    surprise, error = usual_of(found)
    numbers: dict[str, Any] = {
        "surprise": surprise._asdict() | {"limit": surprise.limit(SURPRISED)},
        "identified": error._asdict() | {"limit": error.limit()},
        "found": {name: f._asdict() for name, f in found.items()},
    }
    write_results(folder, config, numbers, report(found, surprise, error))
    write_figure(draw(found, surprise, error), folder / "lane_trust.png")
    if config.add_to is not None:
        keep_usual(learnt, error, surprise, config.add_to)


if __name__ == "__main__":
    run_command(main, LaneTrust, __doc__)
