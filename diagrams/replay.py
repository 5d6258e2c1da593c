"""A log next to what the nominal and the corrected simulator make of its commands: one diagram, restarted every second.

python -m diagrams.replay RUN.csv --vehicle car.yaml --corrected corrected.yaml
python -m diagrams.replay RUN.csv --vehicle car.yaml --corrected corrected.yaml --graph    # draws the diagram
"""

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

import numpy as np
import pandas as pd
import tyro
from matplotlib.figure import Figure

from diagrams.command import run_command
from drift_drake.car.car_file import read_car
from drift_drake.common.run_folder import make_run_folder, write_json, write_versions
from drift_drake.common.safe_files import write_figure, write_table
from drift_drake.view.pictures.graph import draw_graph
from drift_drake.view.pictures.overhead import overhead
from drift_drake.view.playback.play import compare, describe, drawn, prepare, write_replay
from drift_drake.view.playback.side_by_side import CarModel, Played
from drift_drake.view.style import DEGREES, KMH, check_runs, colours_of, legend_above, new_figure, styled

COLUMNS = ("t", "x", "y", "r", "v", "beta", "omega_r", "delta")
SMALLEST_REACH = 1.0  # of the axes: that a simulated car may leave the real one's range by, at least


@dataclasses.dataclass(frozen=True)
class ReplayConfig:
    """What to replay."""

    log: Annotated[Path, tyro.conf.Positional]
    """One run in the log format."""
    vehicle: Path
    """What the simulator believes of the car."""
    corrected: Path | None = None
    """The corrected vehicle, as `drift-drake apply` writes it."""
    restart: float = 1.0
    """[s] after which the simulated cars are put back onto the real one, over and over; 0: never."""
    out: Path | None = None
    """Folder for the results; runs/replay-DATE-TIME without."""
    graph: bool = False
    """Only draw the diagram."""


def wide_table(played: Played) -> pd.DataFrame:
    """One table: t, window, then each column of the real car, as measured, and of the cars, under their names."""
    out = played.real[["t", "window"]].copy()
    for name, table in {"real": played.real, **played.cars}.items():
        kept = table.drop(columns=["t", "window", "delta"])
        out = pd.concat([out, kept.add_prefix(f"{name}_")], axis=1)
    return out.assign(delta_cmd=played.real["delta"])


@styled
def side_by_side(runs: Mapping[str, pd.DataFrame]) -> Figure:
    """Draws states, steering command and distance from the first run, which is the real car, row for row.

    Args:
        runs: tables with t, x, y, r, v, beta, omega_r, delta (SI) by name, all with the same rows; NaN breaks a line.

    Raises:
        ValueError: there is no run; a run lacks a column or has no row.
    """
    check_runs(runs, COLUMNS)
    real, colours = next(iter(runs.values())), colours_of(runs)
    figure = new_figure(7.5, 5.4)
    grid = figure.subplots(3, 2, sharex=True)
    lines = (
        ("sideslip [deg]", "beta", DEGREES),
        ("yaw rate [deg/s]", "r", DEGREES),
        ("speed [km/h]", "v", KMH),
        ("rear rim speed [km/h]", "omega_r", KMH),
    )
    for axes, (label, column, unit) in zip(grid.ravel(), lines, strict=False):
        for index, (name, run) in enumerate(runs.items()):
            # The real car is beneath, wide and pale: a car that does the same is seen on it.
            look = {"linewidth": 2.4, "alpha": 0.45} if index == 0 else {"linewidth": 1.0}
            axes.plot(run["t"], run[column] * unit, color=colours[index], label=name, **look)
        axes.set_ylabel(label)
        if real[column].notna().any():
            low, high = float(real[column].min()) * unit, float(real[column].max()) * unit
            reach = max(0.5 * (high - low), SMALLEST_REACH)
            bottom, top = axes.get_ylim()
            axes.set_ylim(max(bottom, low - reach), min(top, high + reach))
    steering, distance = grid[-1]
    steering.plot(real["t"], real["delta"] * DEGREES, color=colours[0])
    steering.set_ylabel("steering command [deg]")
    for index, run in enumerate(runs.values()):
        if index > 0:
            away = np.hypot(run["x"] - real["x"], run["y"] - real["y"])
            distance.plot(run["t"], away, color=colours[index], linewidth=1.0)
    distance.set_ylabel("distance from the real car [m]")
    for axes in grid[-1]:
        axes.set_xlabel("time [s]")
    for axes in grid.ravel():
        axes.margins(x=0.0)
    legend_above(grid[0, 0], len(runs))
    return figure


def main(config: ReplayConfig) -> None:
    """Replays, and leaves table, errors, pictures and the 3D replay in the run folder."""
    files = {"nominal": config.vehicle} | ({} if config.corrected is None else {"corrected": config.corrected})
    vehicles = {name: CarModel(*read_car(path)) for name, path in files.items()}
    prepared = prepare(config.log, vehicles)
    folder = make_run_folder("replay", config.out)
    if config.graph:
        for path in draw_graph(prepared.diagram, folder / "replay"):
            print(path)
        return
    played = prepared.run(config.restart)
    comparison = compare(played)
    write_json(folder / "config.json", config)
    write_json(folder / "numbers.json", comparison)
    write_versions(folder)
    write_table(wide_table(played), folder / "replay.csv", index=False)
    runs, parameters = drawn(played), vehicles["nominal"].parameters.single_track()
    write_figure(side_by_side(runs), folder / "time_series.png")
    write_figure(overhead(runs, parameters=parameters, car_every=1.5), folder / "overhead.png")
    write_replay(played, folder / "replay.html", config.log.name, config.restart, parameters)
    print(describe(config.log.name, comparison, config.restart))
    print(f"results in {folder}")


if __name__ == "__main__":
    run_command(main, ReplayConfig)
