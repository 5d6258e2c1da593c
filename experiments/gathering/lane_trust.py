"""What is usual of a first informative drive for the vehicles that a model was made for, and who would be refused.

    python -m experiments.gathering.lane_trust
    python -m experiments.gathering.lane_trust --checkpoint runs/bayesian_model.npz --keep runs/lane_trust.json

The mean squared distance of the drive's innovations (`drift_drake.gathering.trust`) on validation vehicles gives the
limit; held-out, `wide` and `extreme` vehicles are then judged by it. Written: numbers.json, report.md, lane_trust.png.
With --keep, what is usual is added to a file, as the package's data/lane_trust.json holds it for the shipped models.
"""

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from tqdm import tqdm

from diagrams.command import run_command
from drift_drake.drives.vehicles import EXTREME, Population, draw_effects
from drift_drake.gathering.gather import drive_samples, gather
from drift_drake.gathering.plan import plan_drive
from drift_drake.gathering.recipe import Recipe
from drift_drake.gathering.trust import REFUSED, familiar_from, keep_familiar, squared_distances
from drift_drake.model.checkpoint import BayesianModel, load_model
from drift_drake.pictures.style import BOUND, INK, new_figure, styled
from drift_drake.run_folder import make_run_folder, write_json, write_versions
from drift_drake.safe_files import write_figure
from drift_drake.vehicle.parameters import VehicleParameters
from experiments.made import write_report

Array = NDArray[np.float64]
JUDGED: tuple[Population, ...] = ("held_out", "wide", "extreme")


@dataclasses.dataclass(frozen=True)
class LaneTrust(Recipe):
    """Which model, how many vehicles."""

    vehicles: int = 60
    """Of each population; of the extreme ones, one each."""
    first: int = 0
    """Index of the first vehicle of each population."""
    vehicle_seed: int = 0
    """Of the draw of the vehicles."""
    keep: Path | None = None
    """File that what is usual is added to."""
    out: Path | None = None


def surprises(config: LaneTrust, learnt: BayesianModel) -> dict[Population, Array]:
    """Mean squared distances [vehicles] of first informative drives, by population."""
    parameters, prior, gathering = VehicleParameters(), learnt.prior(), config.gathering
    info = plan_drive(learnt, prior, gathering, gathering.alpha)
    found: dict[Population, Array] = {}
    for population in ("validation", *JUDGED):
        last = config.first + (len(EXTREME) if population == "extreme" else config.vehicles)
        values = []
        for index in tqdm(range(config.first, last), desc=population, unit="vehicle"):
            effects = draw_effects(population, index, config.vehicle_seed)
            table = gather(info, effects, parameters, gathering, index)[0]
            values.append(float(np.mean(squared_distances(learnt, prior, drive_samples(table, gathering)))))
        found[population] = np.array(values)
    return found


def report(found: dict[Population, Array], limit: float) -> str:
    """Who would be refused, as Markdown."""
    lines = [
        f"Refused beyond a mean squared distance of {limit:.1f}: {REFUSED:.1%} of vehicles like those trained on.",
        "",
        "| vehicles | mean squared distance, least / median / most | refused |",
        "| --- | --- | --- |",
    ]
    for population, values in found.items():
        least, median, most = np.quantile(values, [0.0, 0.5, 1.0])
        lines.append(f"| {population.replace('_', '-')} | {least:.1f} / {median:.1f} / {most:.1f} "
                     f"| {int(np.sum(values > limit))} of {len(values)} |")  # fmt: skip
    return "\n".join(lines)


@styled
def draw(found: dict[Population, Array], limit: float) -> Figure:
    """A row of points a population, the limit as a line."""
    figure = new_figure(7.0, 2.4)
    axes = figure.subplots()
    rng = np.random.default_rng(0)
    for row, values in enumerate(found.values()):
        axes.scatter(values, row + rng.uniform(-0.15, 0.15, len(values)), s=12, color=INK, alpha=0.7, linewidths=0)
    axes.axvline(limit, color=BOUND, linestyle="--")
    axes.set_xscale("log")
    axes.set_yticks(range(len(found)), [name.replace("_", "-") for name in found])
    axes.invert_yaxis()
    axes.set_xlabel("mean squared distance of the first informative drive [-]")
    return figure


def main(config: LaneTrust) -> None:
    """Drives all vehicles, then writes numbers, a table and a picture."""
    config = config.resolved()
    folder = make_run_folder("lane_trust", config.out)
    write_json(folder / "config.json", config)
    write_versions(folder)
    learnt = load_model(config.checkpoint)
    found = surprises(config, learnt)
    familiar = familiar_from(found["validation"])
    limit = familiar.limit()
    numbers: dict[str, Any] = {"usual": familiar._asdict(), "limit": limit, "mean_squared_distance": found}
    write_json(folder / "numbers.json", numbers)
    write_report(folder, report(found, limit), config)
    write_figure(draw(found, limit), folder / "lane_trust.png")
    if config.keep is not None:
        keep_familiar(learnt, familiar, config.keep)
    print(report(found, limit))
    print(f"results in {folder}")


if __name__ == "__main__":
    run_command(main, LaneTrust, __doc__)
