"""Whether stated probabilities hold: of no gap, of something that the catalogue lacks, and of the cause that is named.

    python -m experiments.other_worlds.reliability ROAD_FOLDER ... --out reliability.png --table stated.csv

A ROAD_FOLDER is a run folder of `road` (or one of `baselines`), whose worlds are still where they were. Days are sorted
by what was said into five bins of equal width; in each, what happened is held against the mean of what was stated.
"""

import dataclasses
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
import pandas as pd
import tyro
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from diagrams.command import run_command
from drift_drake.common.errors import DriftDrakeError
from drift_drake.common.safe_files import write_table
from drift_drake.gap.evidence.posterior import NONE, UNKNOWN
from drift_drake.view.colours import REFERENCE, RUNS
from drift_drake.view.style import new_figure, save
from experiments.benchmarks.intervals import binomial
from experiments.made import tabulated
from experiments.other_worlds.road import rows_of
from experiments.other_worlds.scoring import TOO, Row
from experiments.pictures.look import SMALL, WIDTH, for_pages

BINS = 5
Stated = tuple[float, bool]  # a probability, and whether it happened
Panels = dict[str, list[Stated]]  # by what is stated


@dataclasses.dataclass(frozen=True)
class Reliability:
    """Reliability of probabilities over run folders."""

    folders: Annotated[tuple[Path, ...], tyro.conf.Positional]
    """Run folders of `road`."""
    out: Path = Path("reliability.png")
    """The picture."""
    table: Path | None = None
    """CSV of all stated probabilities, which `experiments.pictures reliability` draws."""


class InvalidRoadError(DriftDrakeError, ValueError):
    """A folder that is no run folder of `road`; the message names it and the remedy."""


class Bin(NamedTuple):
    """Days whose stated probability lies between two edges."""

    low: float
    high: float
    days: int
    stated: float  # mean
    happened: float  # share
    least: float  # its exact 95 % interval
    most: float

    @property
    def inside(self) -> bool:
        """Whether the interval of what happened holds the mean of what was stated."""
        return self.least <= self.stated <= self.most


def of_none(rows: Sequence[Row]) -> list[Stated]:
    """Probability of no gap, and whether there was none."""
    return [(float(row.answer["posterior"].get(NONE, 0.0)), row.truth == NONE) for row in rows]


def of_something_else(rows: Sequence[Row]) -> list[Stated]:
    """Probability of something that the catalogue lacks, alone or with a cause, and whether it was there."""
    out = []
    for row in rows:
        p, left = row.answer["posterior"], row.answer["details"].get("left_over") or {}
        stated = sum(float(q) for name, q in p.items() if name == UNKNOWN or name.endswith(TOO))
        if row.answer["verdict"] == "effect" and left:  # the cause has the probability of both, then
            stated += float(p.get(row.said, 0.0)) * float(left["probability"])
        out.append((min(stated, 1.0), row.strange is not None))
    return out


def of_cause(rows: Sequence[Row]) -> list[Stated]:
    """Probability of the named cause, with something else or without it, and whether that cause was there."""
    return [(row.probability, row.said == row.truth) for row in rows if row.answer["verdict"] == "effect"]


PANELS = {"no gap": of_none, "a fault outside the catalogue": of_something_else, "the named cause": of_cause}


def panels_of(rows: Sequence[Row]) -> Panels:
    """All that is stated of days."""
    return {name: stated(rows) for name, stated in PANELS.items()}


def write_panels(panels: Panels, path: Path) -> None:
    """A row each: what is stated, its probability, whether it happened."""
    rows = [(name, round(p, 4), int(there)) for name, stated in panels.items() for p, there in stated]
    write_table(pd.DataFrame(rows, columns=["what", "stated", "happened"]), path, index=False)


def read_panels(path: Path) -> Panels:
    """What `write_panels` has written."""
    table = pd.read_csv(path)
    return {str(name): [(float(p), bool(there)) for p, there in zip(some["stated"], some["happened"], strict=True)]
            for name, some in table.groupby("what", sort=False)}  # fmt: skip


def binned(pairs: Sequence[Stated]) -> list[Bin]:
    """Bins of equal width, those without a day too: nothing is stated there, and anything may happen."""
    edges = np.linspace(0.0, 1.0, BINS + 1)
    place = np.clip(np.searchsorted(edges, [p for p, _ in pairs], side="right") - 1, 0, BINS - 1)
    out = []
    for k in range(BINS):
        some = [pair for pair, at in zip(pairs, place, strict=True) if at == k]
        stated = float(np.mean([p for p, _ in some])) if some else float("nan")
        happened, least, most = binomial(sum(there for _, there in some), len(some))
        out.append(Bin(float(edges[k]), float(edges[k + 1]), len(some), stated, happened, least, most))
    return out


def reliability_text(panels: Panels) -> str:
    """All bins as a Markdown table."""
    rows = []
    for name, stated in panels.items():
        for b in binned(stated):
            edges = f"{b.low:.1f} to {b.high:.1f}"
            figures = ["-"] * 4
            if b.days:
                figures = [f"{b.stated:.2f}", f"{b.happened:.2f}", f"{b.least:.2f} to {b.most:.2f}",
                           "yes" if b.inside else "no"]  # fmt: skip
            rows.append((name, edges, b.days, *figures))
    heads = ("probability of", "bin", "days", "stated, mean", "happened", "95 % interval", "inside")
    return "\n".join(tabulated(heads, rows)) + "\n"


@for_pages
def draw_reliability(panels: Panels) -> Figure:
    """A panel each for what is stated: share that happened over the mean that was stated, with its interval."""
    figure = new_figure(WIDTH, 2.1 * WIDTH)
    axes = figure.subplots(len(panels), 1, sharex=True, sharey=True)
    for ax, (name, stated) in zip(axes, panels.items(), strict=True):
        draw_panel(ax, binned(stated))
        ax.set(title=name, ylabel="share that happened [-]")
    axes[-1].set_xlabel("stated probability [-] (grey: number of logs)")
    axes[1].legend(loc="upper left")
    return figure


def draw_panel(ax: Axes, bins: Sequence[Bin]) -> None:
    """Bins with a day; filled where the interval holds what was stated; the number of days below."""
    ax.plot([0, 1], [0, 1], color=REFERENCE, lw=0.8, ls="--", zorder=1)
    for inside, label in ((True, "as stated"), (False, "not as stated")):
        some = [b for b in bins if b.days and b.inside == inside]
        x, y = [b.stated for b in some], [b.happened for b in some]
        error = [[b.happened - b.least for b in some], [b.most - b.happened for b in some]]
        colour = RUNS[0] if inside else RUNS[1]
        ax.errorbar(x, y, yerr=error, fmt="o" if inside else "s", ms=4, color=colour, elinewidth=1.0, capsize=2,
                    mfc=colour if inside else "white", label=label, zorder=2)  # fmt: skip
    for b in bins:
        ax.text(0.5 * (b.low + b.high), -0.085, f"{b.days}", ha="center", va="center", fontsize=SMALL, color=REFERENCE)
    ax.set(xlim=(-0.03, 1.03), ylim=(-0.13, 1.05), xticks=np.linspace(0.0, 1.0, BINS + 1))


def rows_of_road(folder: Path) -> list[Row]:
    """Every answered day of a run folder, by the labels of its worlds.

    Raises:
        InvalidRoadError: it is none, or its worlds are not there.
    """
    config = folder / "config.json"
    if not config.is_file():
        raise InvalidRoadError(f"{folder}: has no config.json; give a run folder of 'experiments.other_worlds.road'")
    rows = []
    for world in map(Path, json.loads(config.read_text()).get("worlds", [])):
        if not (world / "labels.json").is_file():
            raise InvalidRoadError(f"{config}: world {world} is not there; run from where the road was run")
        rows += rows_of(world.resolve().name, world, folder)
    return [row for row in rows if not row.failed]


def main(config: Reliability) -> None:
    """Table and picture."""
    rows = [row for folder in config.folders for row in rows_of_road(folder)]
    if not rows:
        raise InvalidRoadError("no answered day in these folders; run 'experiments.other_worlds.road' first")
    panels = panels_of(rows)
    if config.table is not None:
        write_panels(panels, config.table)
    save(draw_reliability(panels), config.out)
    print(reliability_text(panels))


if __name__ == "__main__":
    run_command(main, Reliability, __doc__)
