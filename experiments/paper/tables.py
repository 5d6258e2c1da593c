"""The paper's tables in full, and what else was compared: by state, by transition, by weight, one change at a time."""

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from experiments.benchmarks.intervals import by_vehicle
from experiments.drifting.improvements import ladder
from experiments.drifting.report import LABELS, paper_table, summarise
from experiments.drifting.runs import reference
from experiments.gathering.summary import PAPER
from experiments.made import tabulated
from experiments.paper.claims import Evidence, failed_at, transitions
from experiments.paper.parts import KINDS, Kind
from experiments.paper.verdicts import falls_short, more, ratio

STATES = ("r", "v", "beta", "omega_r", "total")
SAID: dict[Kind, str] = {"recipe": "under the paper's recipe", "shipped": "as shipped"}
ENTERED = ("online", "twice_info")


def table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Markdown."""
    return "\n".join(tabulated(header, rows))


def norms(found: dict[Kind, Evidence]) -> str:
    """Table I: norms of the covariances by state, medians over the vehicles with their intervals."""
    parts = []
    for kind in KINDS:
        rows = []
        for model in PAPER:
            drives = found[kind].driven(model)
            if drives.empty:
                continue
            cells = [model]
            for k, state in enumerate(STATES):
                column = "total" if state == "total" else f"norm_{state}"
                values = drives[column]
                low, high = by_vehicle(drives, column, lambda some: float(np.median(some)))
                spread = "" if low == high else f" ({low:.3g} to {high:.3g})"
                cells += [f"{PAPER[model][k]:g}", f"{np.median(values):.3g}{spread}"]
            rows.append(cells)
        header = ["model", *(word for state in STATES for word in (f"{state}, paper", "here"))]
        if rows:
            count = found[kind].drives["vehicle"].nunique()
            parts.append(f"{SAID[kind].capitalize()}, {count} vehicles:\n\n{table(header, rows)}")
    return "\n\n".join(parts)


def best_and_worst(found: dict[Kind, Evidence]) -> str:
    """Tables II and III."""
    parts = []
    for kind in KINDS:
        runs = found[kind].figure_8
        if runs.empty:
            continue
        runs = runs[runs["model"].isin(["once_ocp", "once_info", "twice_info"])]
        summary = summarise(runs)
        for name, error, unit in (
            ("II", "rms_e", "RMS e [m]"),
            ("III", "rms_sideslip_error", "RMS sideslip error [rad]"),
        ):
            if runs["noise_seed"].nunique() > 1:
                parts.append(f"Table {name}, {unit}, {SAID[kind]}; of a vehicle's attempts, in the median over the "
                             f"vehicles\n\n{paper_table(summary, error)}")  # fmt: skip
            parts.append(f"Table {name}, {unit}, {SAID[kind]}; over all vehicles and attempts, each run as far as it "
                         f"came\n\n{over_runs(runs, error)}")  # fmt: skip
    return "\n\n".join(parts)


def over_runs(runs: pd.DataFrame, error: str) -> str:
    """Best, median and worst over all runs, as far as they came."""
    models = [model for model in ("once_ocp", "once_info", "twice_info") if (runs["model"] == model).any()]
    digits = 2 if error == "rms_e" else 3
    rows = []
    for name, share in (("best", 0.0), ("median", 0.5), ("worst", 1.0)):
        values = (runs.loc[runs["model"] == model, error].quantile(share) for model in models)
        rows.append([name, *(f"{value:.{digits}f}" for value in values)])
    return table(["", *(LABELS[model] for model in models)], rows)


def failures(found: dict[Kind, Evidence]) -> str:
    """Where each run of the figure-8 that was not completed ended, and how."""
    course, parts = reference("figure_8"), []
    where = ", ".join(f"{begin:.0f} to {end:.0f} m" for begin, end in transitions(course))
    for kind in KINDS:
        runs = found[kind].figure_8
        if runs.empty:
            continue
        rows = []
        for model, group in runs.groupby("model", sort=False):
            failed = group[~group["completed"]].assign(place=failed_at(group, course))
            counts = failed.groupby(["place", "outcome"]).size().reset_index(name="count")
            said = "; ".join(f"{place}: {outcome}, {count}" for place, outcome, count in counts.to_numpy())
            rows.append([LABELS[str(model)], f"{len(failed)} of {len(group)}", said or "-"])
        parts.append(f"{SAID[kind].capitalize()}:\n\n{table(['model', 'not completed', 'where, how'], rows)}")
    return "\n\n".join([f"The transitions are at {where}.", *parts]) if parts else ""


def bolder(folder: Path) -> str:
    """By weight and objective: the first plan, and whether the second is bolder; empty without drives."""
    file = folder / "drives" / "drives.csv"
    if not file.exists():
        return ""
    drives = pd.read_csv(file)
    plans = json.loads((folder / "drives" / "plans.json").read_text())
    rows = []
    for variant, group in drives.groupby("variant", sort=False):
        once, twice = (group[group["model"] == model] for model in ("Once-Info", "Twice-Info"))
        both = once.merge(twice, on="vehicle", suffixes=("", "_2"))
        cells = [str(variant), f"{group['alpha'].iloc[0]:g}", f"{len(once)}", f"{len(both)}"]
        for name in ("planned_r", "planned_tau", "max_r", "max_beta", "max_e"):
            digits = 0 if name == "planned_tau" else 2
            cells.append(f"{once[name].median():.{digits}f}, {both[f'{name}_2'].median():.{digits}f}")
        cells += [
            f"{int((both[f'planned_{name}_2'] > both[f'planned_{name}']).sum())} of {len(both)}"
            for name in ("r", "tau")
        ]
        cells.append(f"{once['obtained'].median():.1f}, {both['obtained_2'].median():.1f}")
        kept = group[group["model"].isin(["Once-Info", "Twice-Info"])]["kept"].astype(bool)
        rows.append([*cells, f"{int(kept.sum())} of {len(kept)}"])
    header = ["variant", "alpha", "vehicles", "second plans", "planned yaw rate, first, second [rad/s]",
              "planned torque [N m]", "driven yaw rate", "driven sideslip [rad]", "driven e [m]",
              "second bolder in yaw rate", "in torque", "information [nat]", "drives kept in the lane"]  # fmt: skip
    text = table(header, rows)
    like = plans.get("total information", {}).get("unlike")
    if like is not None:
        text += (
            "\n\nThe first plan of the total information along the horizon differs from eq. (9)'s by "
            f"{like:.2f} of what sets that apart from the straight drive."
        )
    return text


def steps(folder: Path) -> str:
    """From the recipe to the shipped model, on the loops: where adapting alone begins to suffice; empty without."""
    file = folder / "steps" / "runs.csv"
    if not file.exists():
        return ""
    runs, rows = pd.read_csv(file), []
    newest: dict[str, pd.DataFrame] = {}
    for rung in ladder():
        own = runs[runs["rung"] == rung.name]
        newest |= {str(model): group for model, group in own.groupby("model")}
        if own.empty or len(newest) < len(ENTERED):
            continue
        online, twice = (newest[model] for model in ENTERED)
        cell = falls_short(online, twice)
        early = ratio(online, twice, "rms_e", 1.0, " m")
        rows.append([rung.what, more(twice, online, "completed").text, early.text, cell.verdict])
    return table(["each with what is above it", "completed, Twice-Info against adapting alone",
                  "RMS e as far as it came, adapting alone against Twice-Info", "claim (ii)"], rows)  # fmt: skip
