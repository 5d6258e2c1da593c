"""A log next to what the nominal and the corrected simulator make of its commands: one diagram, restarted every second.

python -m diagrams.replay RUN.csv --vehicle car.yaml --corrected corrected.yaml
python -m diagrams.replay RUN.csv --vehicle car.yaml --corrected corrected.yaml --graph    # draws the diagram
"""

import dataclasses
from pathlib import Path
from typing import Annotated

import pandas as pd
import tyro

from diagrams.command import run_command
from drift_drake.car.car_file import read_car
from drift_drake.common.run_folder import make_run_folder, write_json, write_versions
from drift_drake.common.safe_files import write_figure, write_table
from drift_drake.view.pictures.graph import draw_graph
from drift_drake.view.pictures.overhead import overhead
from drift_drake.view.pictures.time_series import side_by_side
from drift_drake.view.playback.play import compare, describe, drawn, prepare, write_replay
from drift_drake.view.playback.side_by_side import CarModel, Played


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
