"""Pictures of the information gathering experiment."""

from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

from drift_drake.car.parameters import VehicleParameters
from drift_drake.common.safe_files import write_figure
from drift_drake.drive.gathering.config import GatheringConfig, lane
from drift_drake.drive.learnt.checkpoint import BayesianModel
from drift_drake.drive.learnt.posterior import Posterior
from drift_drake.view.pictures.overhead import overhead
from drift_drake.view.pictures.time_series import time_series
from experiments.benchmarks.vehicles import Population, draw_effects
from experiments.gathering.recipe import lane_for_pictures
from experiments.model.uncertainties import draw_uncertainties

FILES = {"OCP": "once-ocp", "Info-OCP": "round_1", "second Info-OCP": "round_2"}


def draw_all(
    folder: Path,
    results: list[dict[str, Any]],
    model: BayesianModel,
    population: Population,
    drives_seed: int,
    config: GatheringConfig,
) -> None:
    """All pictures; of trajectories and uncertainties those of the vehicle whose Twice-Info norm is the median."""
    ranked = sorted(results, key=lambda result: result["rounds"][-1]["total"])
    vehicle = ranked[len(ranked) // 2]["vehicle"]
    parameters = VehicleParameters()
    reference = lane(config)
    tables = {
        label: pd.read_csv(path)
        for label, name in FILES.items()
        if (path := folder / f"{name}-{vehicle:03d}.csv").exists()
    }
    write_figure(overhead(tables, lane_for_pictures(config, tables.values()), parameters), folder / "overhead.png")
    write_figure(time_series(tables, reference, parameters, against="t"), folder / "time_series.png")
    beliefs = {"prior": model.prior()}
    for name in ("once", "twice"):
        path = folder / f"belief-{name}-{vehicle:03d}.npz"
        if path.exists():
            with np.load(path) as stored:
                beliefs[f"{name.capitalize()}-Info"] = Posterior(**{key: stored[key] for key in Posterior._fields})
    effects = draw_effects(population, vehicle, drives_seed)
    draw_uncertainties(model, beliefs, effects, f"vehicle {vehicle}, {population}", folder / "uncertainties.png")
    draw_rounds(results, folder / "rounds.png")


def draw_rounds(results: list[dict[str, Any]], file: Path) -> None:
    """Gain, norm, and error in drifts against the round: every vehicle, and the median."""
    figure, axes = plt.subplots(1, 3, figsize=(12, 3.4), constrained_layout=True)
    count = max(len(result["rounds"]) for result in results)
    for axis, key, title in (
        (axes[0], "obtained", "information gained [nat]"),
        (axes[1], "total", "total covariance norm"),
        (axes[2], "one_step_scaled", "one-step error in held-out drifts"),
    ):
        start = 0 if key != "obtained" else 1
        rows = [
            ([result["prior"][key]] if start == 0 else []) + [one[key] for one in result["rounds"]]
            for result in results
        ]
        for row in rows:
            axis.plot(range(start, start + len(row)), row, color="0.8", lw=0.8)
        medians = [np.median([row[k] for row in rows if len(row) > k]) for k in range(count + 1 - start)]
        axis.plot(range(start, count + 1), medians, "o-", color="tab:blue", label="median")
        axis.set_title(title)
        axis.set_xlabel("rounds")
        axis.grid(alpha=0.3)
    predicted = [
        np.median([result["rounds"][k]["predicted"] for result in results if len(result["rounds"]) > k])
        for k in range(count)
    ]
    axes[0].plot(range(1, count + 1), predicted, "s--", color="tab:orange", label="predicted, median")
    axes[0].set_yscale("log")
    axes[1].set_yscale("log")
    axes[0].legend(fontsize=8)
    write_figure(figure, file, dpi=110)
    plt.close(figure)
