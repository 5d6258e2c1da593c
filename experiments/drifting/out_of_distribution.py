"""Out-of-distribution detection during drives: false alarms in distribution, detection out of it.

    python -m experiments.drifting.out_of_distribution

The figure-8 under the adapting controller, watched by the detector (`drift_drake.drive.learnt.adapter`). Its
threshold comes from drives of validation vehicles, for a chosen share of false alarms a drive; then it is judged on
held-out vehicles (in distribution), on `wide` ones (spreads half as wide again, and effects that training never saw),
and on held-out ones whose friction drops at once on the way. Broken off, it goes on where it was (give --out).
"""

import dataclasses
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from diagrams.command import run_command
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.parameters import VehicleParameters
from drift_drake.common.safe_files import write_figure, write_table
from drift_drake.drive.learnt.adapter import BayesianAdapter
from drift_drake.drive.learnt.checkpoint import BayesianModel, load_model
from drift_drake.drive.learnt.command_lag import TIME_STEP
from drift_drake.drive.learnt.out_of_distribution import (
    WINDOW,
    NullDistribution,
    OutOfDistributionDetector,
    calibrate,
    statistics,
)
from drift_drake.drive.learnt.quality import step_model
from drift_drake.drive.loop.closed_loop import ClosedLoop, ControlConfig
from drift_drake.drive.loop.faults import Change
from drift_drake.drive.loop.metrics import before_spin
from drift_drake.view.colours import INK
from drift_drake.view.style import BOUND, new_figure, styled
from experiments.benchmarks.intervals import binomial
from experiments.benchmarks.vehicles import Population, draw_effects
from experiments.drifting.runs import DriftConfig, opened, reference
from experiments.made import tabulated, write_results
from experiments.settings import run_kept

Group = Literal["calibration", "in distribution", "wide", "friction drop"]
GROUPS: dict[Group, Population] = {"calibration": "validation", "in distribution": "held_out", "wide": "wide",
                                   "friction drop": "held_out"}  # fmt: skip


@dataclasses.dataclass(frozen=True)
class DetectionConfig(DriftConfig):
    """How many vehicles of each population, and the detector."""

    vehicles: int = 10
    noise_seeds: int = 1
    adapting: bool = True
    """Whether the belief adapts on the way, as the controller's; else it stays the prior."""
    window: int = WINDOW
    """Samples of 0.1 s."""
    false_alarms: float = 0.05
    """Share of drives in distribution that may raise an alarm."""
    drop: float = 0.2
    """By how much friction falls, as a share of the nominal car's."""
    drop_time: float = 12.0
    """[s] into the drive."""


@dataclasses.dataclass(frozen=True)
class WatchJob:
    """One watched drive."""

    group: Group
    vehicle: int
    noise_seed: int
    effects: Effects
    change: Change | None
    model: BayesianModel
    adapting: bool
    control: ControlConfig

    @property
    def name(self) -> str:
        """Of its file."""
        return f"{self.group.replace(' ', '_')}-{self.vehicle:03d}-{self.noise_seed}"


def watch(job: WatchJob) -> dict[str, Any]:
    """A drive's d^2 (one each 0.1 s, until a spin begins), and how it ended."""
    model, parameters = job.model, VehicleParameters()
    adapter = BayesianAdapter(model)
    detector = OutOfDistributionDetector(model, threshold=np.inf)
    loop = ClosedLoop(parameters, reference("figure_8"), step_model(model, model.prior()), job.effects,
                      control=job.control, adapter=adapter, detector=detector)  # fmt: skip
    context = loop.initial_context(seed=job.noise_seed)
    adapter.set_frozen(adapter.GetMyMutableContextFromRoot(context), not job.adapting)
    run = loop.run(context, change=job.change)
    table = before_spin(run.table, parameters.steering_limit) if run.outcome == "spin" else run.table
    t, distance = table["t"].to_numpy(dtype=float), table["ood_distance"].to_numpy(dtype=float)
    # Read half-way between the ticks, from the first that has a step behind it.
    ticks = TIME_STEP * np.arange(1, int(t[-1] / TIME_STEP))
    return {
        "group": job.group,
        "vehicle": job.vehicle,
        "noise_seed": job.noise_seed,
        "outcome": run.outcome,
        "duration": float(t[-1]),
        "distances": distance[np.searchsorted(t, ticks + 0.5 * TIME_STEP)],
    }


def drives(config: DetectionConfig, folder: Path) -> list[dict[str, Any]]:
    """All watched drives, made where the folder lacks them."""
    model = load_model(config.checkpoint)
    jobs = []
    for group, population in GROUPS.items():
        for vehicle, seed in config.attempts():
            effects, change = draw_effects(population, vehicle, config.vehicle_seed), None
            if group == "friction drop":
                change = Change(config.drop_time, effects._replace(friction_level=effects.friction_level - config.drop))
            jobs.append(WatchJob(group, vehicle, seed, effects, change, model, config.adapting, config.control))
    return run_kept(config.run_on, watch, jobs, lambda job: folder / f"{job.name}.json", "drive")


def alarm_time(distances: list[float], threshold: float, window: int, since: float = 0.0) -> float:
    """Time [s] of the first alarm after `since` [s]; infinite without one."""
    values = statistics(np.array(distances, dtype=float), window)
    times = TIME_STEP * np.arange(1, len(values) + 1)
    raised = np.flatnonzero((values > threshold) & (times > since))
    return float(times[raised[0]]) if len(raised) else float("inf")


def share(count: int, total: int) -> dict[str, float]:
    """A share and its 95 % interval."""
    p, low, high = binomial(count, total)
    return {"count": count, "total": total, "share": p, "low": low, "high": high}


def judge(results: list[dict[str, Any]], config: DetectionConfig) -> dict[str, Any]:
    """The threshold, and by group: alarms, when they came, and how many of the lost drives had one before."""
    calibration = calibrate([np.array(r["distances"]) for r in results if r["group"] == "calibration"], config.window)
    threshold = calibration.threshold(config.false_alarms, reference("figure_8").duration)
    summary: dict[str, Any] = {"calibration": calibration, "threshold": threshold, "groups": {}}
    for group in GROUPS:
        # A drive that was lost before the drop says nothing of it.
        since = config.drop_time if group == "friction drop" else 0.0
        runs = [r for r in results if r["group"] == group and r["duration"] > since]
        alarms = np.array([alarm_time(r["distances"], threshold, config.window, since) - since for r in runs])
        lost = np.array([r["outcome"] != "completed" for r in runs], dtype=bool)
        raised = np.isfinite(alarms)
        summary["groups"][group] = {
            "alarms": share(int(raised.sum()), len(runs)) if runs else None,
            "median_time": float(np.median(alarms[raised])) if raised.any() else None,
            "lost": int(lost.sum()),
            "lost_with_alarm": int((lost & raised).sum()),
        }
    return summary


def report(summary: dict[str, Any], config: DetectionConfig) -> str:
    """The verdict as Markdown."""
    calibration: NullDistribution = summary["calibration"]
    threshold = (
        f"Threshold {summary['threshold']:.1f}, for at most {config.false_alarms:.0%} false alarms a drive. On the "
        f"calibration's drives the mean of d^2 over {config.window} samples is {calibration.mean:.1f} (4 where the "
        f"model's covariance is right), with the spread of {calibration.freedom:.1f} degrees of freedom "
        f"({4 * config.window}, were samples independent)."
    )
    rows = []
    for group, s in summary["groups"].items():
        a = s["alarms"]
        if a is None:
            rows.append((group, "no drive came so far", "", ""))
            continue
        time = f"{s['median_time']:.1f}" if s["median_time"] is not None else ""
        raised = f"{a['count']} of {a['total']} ({a['low']:.0%} to {a['high']:.0%})"
        rows.append((group, raised, time, f"{s['lost']}, {s['lost_with_alarm']}"))
    heads = ("drives", "alarm raised (95 % interval)", "after, median [s]", "lost drives, with an alarm before")
    return "\n".join([threshold, "", *tabulated(heads, rows)])


@styled
def picture(results: list[dict[str, Any]], summary: dict[str, Any], config: DetectionConfig) -> Figure:
    """The statistic over time, a panel a group, every drive a line, the threshold, and the drop in grey."""
    figure = new_figure(7.5, 4.6)
    grid = figure.subplots(2, 2, sharex=True, sharey=True)
    for axes, group in zip(grid.ravel(), GROUPS, strict=True):
        for r in results:
            if r["group"] == group:
                values = statistics(np.array(r["distances"], dtype=float), config.window)
                axes.plot(TIME_STEP * np.arange(1, len(values) + 1), values, color=INK, linewidth=0.7, alpha=0.5)
        axes.axhline(summary["threshold"], color=BOUND, linewidth=1.0, label="threshold")
        if group == "friction drop":
            axes.axvline(config.drop_time, color="#888888", linewidth=0.8, linestyle=(0, (4, 3)), label="drop")
        axes.set(yscale="log", title=group)
    for axes in grid[-1]:
        axes.set_xlabel("time [s]")
    for axes in grid[:, 0]:
        axes.set_ylabel(f"mean d² of {TIME_STEP * config.window:g} s")
    grid[1, 1].legend(loc="lower right")
    return figure


def main(config: DetectionConfig) -> None:
    """Drives what is missing, calibrates, judges."""
    folder = opened("out_of_distribution", config)
    results = drives(config, folder)
    summary = judge(results, config)
    write_results(folder, config, summary, report(summary, config))
    write_figure(picture(results, summary, config), folder / "statistic.png")
    write_table(
        pd.DataFrame([{k: v for k, v in r.items() if k != "distances"} for r in results]),
        folder / "runs.csv",
        index=False,
    )


if __name__ == "__main__":
    run_command(main, DetectionConfig)
