"""Drifts linked loops that the controller enters from grip (section IV-C): adapting online against gathering first.

    python -m experiments.drifting.loops

The prior that adapts as it drives against Twice-Info, not adapting and adapting; see `drifting.runs` for the
models. In addition to what the figure-8 reports: the distance from the beginning of the initiation until the drift is
established, which for the paper's adapting prior was "upward of 150 meters". Broken off, it goes on where it was (give
--out).
"""

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from diagrams.command import run_command
from drift_drake.common.safe_files import write_table
from drift_drake.drive.loop.metrics import GRID, STEADY_SIDESLIP
from drift_drake.drive.reference.trajectory import Reference
from experiments.drifting.report import (
    LABELS,
    completion_table,
    draw,
    picture_sentence,
    plans_sentence,
    refusal_sentence,
    summarise,
)
from experiments.drifting.runs import Model, ModelsConfig, opened, reference, run_models, run_name
from experiments.made import tabulated, write_results

# A drift is established where the car is this near to the reference's, and stays so for a while.
MAX_SIDESLIP_ERROR = 0.15  # [rad], a quarter of the drift's
MAX_LATERAL_ERROR = 1.0  # [m], a third of the lane's half width
HELD = 20.0  # [m]
PICTURED = ("online", "twice_info", "twice_online", "oracle")


@dataclasses.dataclass(frozen=True)
class LoopsConfig(ModelsConfig):
    """Which vehicles, how often, with which models."""

    models: tuple[Model, ...] = ("online", "twice_info", "twice_online", "oracle")


def initiation(reference: Reference) -> tuple[float, float]:
    """Path positions [m] at which the transition to the first steady drift begins and ends."""
    grid = np.arange(0.0, reference.distance, GRID)
    drifting = np.abs(reference.state(grid)[:, 2]) > STEADY_SIDESLIP
    changing = reference.transition(grid)
    end = int(np.flatnonzero(drifting & ~changing)[0])
    begin = int(np.flatnonzero(~changing[:end])[-1]) + 1
    return float(grid[begin]), float(grid[end])


def established_after(table: pd.DataFrame, reference: Reference) -> float:
    """Distance [m] from the beginning of the initiation to where the first drift is established; inf if it never is.

    Established: from there on, over `HELD`, sideslip and lateral position are near the reference's. Since the reference
    itself drifts steadily at the initiation's end only, no distance is shorter than the initiation.
    """
    begin, end = initiation(reference)
    s = np.maximum.accumulate(table["s"].to_numpy(dtype=float))
    grid = np.arange(end, s[-1], GRID)
    beta, e = (np.interp(grid, s, table[name].to_numpy(dtype=float)) for name in ("beta", "e"))
    near = (np.abs(beta - reference.state(grid)[:, 2]) < MAX_SIDESLIP_ERROR) & (np.abs(e) < MAX_LATERAL_ERROR)
    length = round(HELD / GRID)
    if len(near) < length:
        return float("inf")
    held = np.convolve(near, np.ones(length), "valid") == length
    return float(grid[np.argmax(held)] - begin) if held.any() else float("inf")


def with_initiation(runs: pd.DataFrame, folder: Path, reference: Reference) -> pd.DataFrame:
    """The runs with a column `established_after` [m]."""
    tables = (pd.read_csv(folder / f"{run_name(m, v, n)}.csv")
              for m, v, n in zip(runs["model"], runs["vehicle"], runs["noise_seed"], strict=True))  # fmt: skip
    return runs.assign(established_after=[established_after(table, reference) for table in tables])


def summarise_loops(runs: pd.DataFrame) -> dict[str, Any]:
    """`summarise`, and quantiles of the distance until the drift is established (infinite for runs without)."""
    summary = summarise(runs)
    for model, group in runs.groupby("model", sort=False):
        distance = group["established_after"].to_numpy(dtype=float)
        # Quantiles that are members of the sample: none can be interpolated where some are infinite.
        summary[str(model)]["established_after"] = {
            name: float(np.quantile(distance, share, method="higher"))
            for name, share in (("least", 0.0), ("median", 0.5), ("upper", 0.9), ("most", 1.0))
        }
        summary[str(model)]["never_established"] = int(np.isinf(distance).sum())
    return summary


def initiation_table(summary: dict[str, Any]) -> str:
    """The distances until the drift is established, as Markdown."""
    rows = []
    for model, s in summary.items():
        values = (s["established_after"][name] for name in ("least", "median", "upper", "most"))
        text = " / ".join(f"{value:.0f}" if np.isfinite(value) else "never" for value in values)
        rows.append((LABELS.get(model, model), text, f"{s['never_established']} of {s['runs']}"))
    heads = ("the controller believes", "drift established after, least / median / 90 % / most [m]", "never")
    return "\n".join(tabulated(heads, rows))


def main(config: LoopsConfig) -> None:
    """Runs what is missing, then writes numbers and pictures."""
    config = config.resolved()
    folder = opened("loops", config)
    course = reference("loops")
    runs = with_initiation(run_models(config, "loops", folder), folder, course)
    write_table(runs, folder / "runs.csv", index=False)
    summary = summarise_loops(runs)
    begin, end = initiation(course)
    report = (
        f"{completion_table(summary)}\n\n{refusal_sentence(summary)}"
        f"The initiation is {end - begin:.0f} m long: no distance is less.\n\n{initiation_table(summary)}\n\n"
        f"{plans_sentence(summary)}{picture_sentence(runs, PICTURED)}"
    )
    write_results(folder, config, summary, report)
    draw(folder, runs, course, PICTURED)


if __name__ == "__main__":
    run_command(main, LoopsConfig)
