"""How many runs a calibration needs: the same days diagnosed with cars calibrated on the first 1, 4, 8, 12 runs.

    python -m experiments.other_worlds.baselines WORLD ... --counts 1 4 8 12 --out runs/baselines

A WORLD is one of `road`, with as many runs of day_one as the largest count (`make_worlds --first-runs 12`). The run
folder has a run folder of `road` for each count, a table (baselines.md) and its curve (baselines.png). What is done is
kept: start again to go on.
"""

import dataclasses
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from diagrams.command import run_command
from drift_drake.car.log.table import run_paths
from drift_drake.common.run_folder import write_json
from drift_drake.common.safe_files import write_text
from drift_drake.view.colours import REFERENCE, RUNS
from drift_drake.view.style import legend_above, new_figure, save, styled
from experiments.made import begun, made, tabulated
from experiments.other_worlds.jobs import Calibrate
from experiments.other_worlds.road import InvalidWorldError, Road, answered, score, worlds_by_name
from experiments.other_worlds.scoring import median_of, said_value, share

RIGHT, ALARMS, INTERVALS = "right", "days with none: false alarms", "intervals that hold the magnitude"
FIGURES = (RIGHT, "effects named", ALARMS, INTERVALS, "without an answer")
OF_STRANGE = "strange faults: "  # before the names of their figures
STRANGE_RIGHT = f"{OF_STRANGE}unknown, or a cause and something else"
CURVES = {RIGHT: "right", ALARMS: "false alarms", STRANGE_RIGHT: "strange faults"}
GOALS = {4: 0.9, 12: 0.95}  # of days right


@dataclasses.dataclass(frozen=True)
class Baselines(Road):
    """Right days over the runs that a car is calibrated on."""

    counts: tuple[int, ...] = (1, 4, 8, 12)
    """Runs of a baseline, the first ones of its folder."""

    def __post_init__(self) -> None:
        if not self.counts or min(self.counts) < 1:
            raise ValueError(f"counts are {self.counts}; give one or more numbers of runs, 1 or more each")


def first_runs(world: Path, baseline: str, count: int, folder: Path) -> Path:
    """A folder with copies of the first runs of a baseline.

    Raises:
        InvalidWorldError: there are fewer.
    """
    paths = run_paths(world / baseline)
    if len(paths) < count:
        raise InvalidWorldError(
            f"{world / baseline}: holds {len(paths)} runs, {count} are asked for; make the world with "
            f"'--first-runs {count}', or give smaller --counts"
        )
    folder.mkdir(parents=True, exist_ok=True)
    for path in paths[:count]:
        shutil.copy(path, folder / path.name)
    return folder


def road_of(count: int, worlds: Mapping[str, Path], config: Baselines, folder: Path) -> dict[str, Any]:
    """The road with one number of runs: calibrated, asked and scored, in a folder of its own."""
    part = folder / f"runs_{count}"
    part.mkdir(parents=True, exist_ok=True)
    write_json(part / "config.json", Road(config.worlds, config.baseline, config.workers, config.criterion, out=part))
    cars = [
        Calibrate((first_runs(world, config.baseline, count, folder / "baselines" / name / f"first_{count}"),),
                  world / "start.yaml", part / name, config.criterion)
        for name, world in worlds.items()
    ]  # fmt: skip
    answered(worlds, cars, part, config.workers)
    return score(worlds, cars, part)


def figures(result: Mapping[str, Any]) -> dict[str, Any]:
    """A row of the table, from what `road.score` gives."""
    done = [row for row in result["calibrations"].values() if "failed" not in row]
    return {
        **{name: result["all"][name] for name in FIGURES},
        STRANGE_RIGHT: share([]),  # where there are none
        **{f"{OF_STRANGE}{name}": value for name, value in result["strange faults"].items()},
        "calibrations that failed": result["calibration"]["failed"],
        "seconds of CPU a calibration, median": median_of(row["cpu_seconds"] for row in done),
        "seconds of CPU a case, median": result["all"]["seconds of CPU a case, median"],
    }


def baselines_text(rows: Mapping[int, Mapping[str, Any]], worlds: Mapping[str, Mapping[int, Any]]) -> str:
    """Figures over all worlds by number of runs, and days right by world, as Markdown.

    Args:
        rows: `figures` by number of runs; worlds: shares of right days by world, then by number of runs.
    """
    counts = sorted(rows)
    names = [(name, *(said_value(rows[count].get(name)) for count in counts)) for name in rows[counts[0]]]
    right = [(world, *(said_value(by[count]) for count in counts)) for world, by in worlds.items()]
    heads = [str(count) for count in counts]
    both = [*tabulated(("runs of the baseline", *heads), names), "", *tabulated(("days right", *heads), right)]
    return "\n".join(both) + "\n"


@styled
def draw_baselines(rows: Mapping[int, Mapping[str, Any]], worlds: Mapping[str, Mapping[int, Any]]) -> Figure:
    """Over the runs of a baseline: shares over all worlds with their intervals; days right in each world."""
    figure = new_figure(7.0, 3.0)
    left, right = figure.subplots(1, 2, sharex=True, sharey=True)
    draw_shares(left, rows)
    for i, (world, by) in enumerate(worlds.items()):
        counts = sorted(by)
        right.plot(counts, [by[c]["share"] for c in counts], color=RUNS[i % len(RUNS)], marker="osD^v"[i % 5], ms=3.5,
                   ls=("-", "--", ":")[i // len(RUNS) % 3], label=world)  # fmt: skip
    right.set(xlabel="runs of the baseline (days right, by world)", xticks=sorted(rows))
    legend_above(right, 2)
    return figure


def draw_shares(ax: Axes, rows: Mapping[int, Mapping[str, Any]]) -> None:
    """Shares by number of runs; those of nothing are left out."""
    for (name, label), colour, marker in zip(CURVES.items(), (RUNS[0], RUNS[1], RUNS[2]), "osD", strict=True):
        counts = [c for c in sorted(rows) if rows[c][name]["count"]]
        some = [rows[c][name] for c in counts]
        if counts:
            error = [[s["share"] - s["low"] for s in some], [s["high"] - s["share"] for s in some]]
            ax.errorbar(counts, [s["share"] for s in some], yerr=error, color=colour, marker=marker, ms=4,
                        elinewidth=0.8, capsize=2, label=label)  # fmt: skip
    goals = {c: q for c, q in GOALS.items() if c in rows}
    if goals:
        ax.plot(list(goals), list(goals.values()), ls="", marker="_", ms=12, color=REFERENCE, label="goal, right")
    ax.set(xlabel="runs of the baseline", ylabel="share of days [-]", ylim=(-0.03, 1.03), xticks=sorted(rows))
    legend_above(ax, 2)


def written(results: Mapping[int, Mapping[str, Any]], names: Sequence[str], folder: Path, sentence: str) -> str:
    """Writes table, picture and numbers; returns the table.

    Args:
        results: of `road.score` by number of runs; names: of the worlds; sentence: how it was made.
    """
    rows = {count: figures(result) for count, result in results.items()}
    worlds = {name: {c: result["by world"].get(name, {}).get(RIGHT, share([])) for c, result in results.items()}
              for name in names}  # fmt: skip
    write_json(folder / "baselines.json", {str(count): row for count, row in rows.items()})
    text = f"{baselines_text(rows, worlds)}\n{sentence}\n"
    write_text(folder / "baselines.md", text)
    save(draw_baselines(rows, worlds), folder / "baselines.png")
    return text


def main(config: Baselines) -> None:
    """Everything."""
    worlds = worlds_by_name(config.worlds, config.baseline)
    folder = begun("baselines", config)
    results = {count: road_of(count, worlds, config, folder) for count in sorted(set(config.counts))}
    print(written(results, list(worlds), folder, made(config)))


if __name__ == "__main__":
    run_command(main, Baselines, __doc__)
