"""What a closed-loop run leaves in its folder: numbers, table, pictures and the 3D replay."""

from pathlib import Path
from typing import Any

import pandas as pd

from drift_drake.pictures.overhead import overhead
from drift_drake.pictures.replay import replay
from drift_drake.pictures.solver_work import solver_work
from drift_drake.pictures.time_series import time_series
from drift_drake.reference.trajectory import Reference
from drift_drake.run_folder import write_json, write_versions
from drift_drake.safe_files import write_figure, write_table
from drift_drake.simulation.metrics import RunMetrics
from drift_drake.vehicle.parameters import VehicleParameters


def write_run_results(
    folder: Path,
    config: Any,
    metrics: RunMetrics,
    table: pd.DataFrame,
    reference: Reference,
    parameters: VehicleParameters,
    period: float,
) -> None:
    """Writes config.json, numbers.json, versions.json, run.csv, three PNG pictures and replay.html.

    Args:
        config: the dataclass that the run was made from.
        table: a row each control period, as `ClosedLoop.run` gives it.
        period: of the controller [s].
    """
    write_json(folder / "config.json", config)
    write_json(folder / "numbers.json", metrics)
    write_versions(folder)
    write_table(table, folder / "run.csv", index=False)
    runs = {"driven": table}
    write_figure(overhead(runs, reference, parameters), folder / "overhead.png")
    write_figure(time_series(runs, reference, parameters), folder / "time_series.png")
    statistics = table.filter(regex="^(t$|solve_)").rename(columns=lambda name: str(name).removeprefix("solve_"))
    write_figure(solver_work(statistics, period), folder / "solver.png")
    replay(runs, folder / "replay.html", reference, parameters)
