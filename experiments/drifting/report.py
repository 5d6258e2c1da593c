"""What is reported of closed-loop runs: numbers by model, tables with the paper's, and pictures."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from drift_drake.car.parameters import VehicleParameters
from drift_drake.common.safe_files import write_figure
from drift_drake.drive.reference.trajectory import Reference
from drift_drake.view.pictures.time_series import time_series
from experiments.benchmarks.intervals import by_vehicle, share_by_vehicle
from experiments.drifting.runs import run_name
from experiments.made import tabulated
from experiments.pictures.overhead_panels import OverheadPanel, overhead_panels

LABELS = {
    "nominal": "nominal car",
    "prior": "prior",
    "once_ocp": "Once-OCP",
    "once_info": "Once-Info",
    "twice_info": "Twice-Info",
    "online": "prior, adapting",
    "offset_free": "prior, adapting, with an offset",
    "twice_online": "Twice-Info, adapting",
    "identified": "identified car",
    "chosen": "chosen by the drives",
    "chosen_once": "chosen by the first drive",
    "oracle": "oracle",
}
# Tables II and III of Davydov et al.: best, median and worst of three attempts of one car.
PAPER: dict[str, dict[str, tuple[float, float, float]]] = {
    "rms_e": {"once_ocp": (2.31, 3.19, 7.35), "once_info": (1.18, 1.31, 3.64), "twice_info": (0.61, 0.83, 1.29)},
    "rms_sideslip_error": {
        "once_ocp": (0.137, 0.261, 0.384), "once_info": (0.105, 0.348, 0.526), "twice_info": (0.068, 0.070, 0.084),
    },
}  # fmt: skip
QUANTILES = {"least": 0.0, "lower": 0.25, "median": 0.5, "upper": 0.75, "most": 1.0}
PICTURED = (
    "once_ocp",
    "once_info",
    "twice_info",
    "oracle",
)  # of those run: the paper's, and the oracle

RANKED = ("prior", "once_ocp", "once_info", "twice_info")  # by the paper's Tables I to III, the best last
FAR_OFF = 1.5  # times the oracle's error
STRAYED = 0.5  # [m] from the reference
DRIFTED = 0.9  # share of the steady drifts from which on a completed run held the drift throughout


def summarise(runs: pd.DataFrame, errors: tuple[str, ...] = ("rms_e", "rms_sideslip_error")) -> dict[str, Any]:
    """By model: how many runs completed the course, how many of them drifting, and errors over all runs.

    Intervals are 95 %, by vehicle. `NAME`: quantiles over all runs, one that was not completed ranking behind all
    others (infinite). `NAME_until_the_end`: of the runs as far as they came. `NAME_of_attempts`: the best, median and
    worst of a vehicle's attempts as far as they came, each in the median over the vehicles, which is what compares with
    the paper's three attempts of one car.
    """
    runs = runs.assign(drifted=held(runs))
    summary = {}
    for model, group in runs.groupby("model", sort=False):
        entry: dict[str, Any] = {
            "runs": len(group),
            "vehicles": group["vehicle"].nunique(),
            "attempts": int(group.groupby("vehicle").size().max()),
            "completed": float(group["completed"].mean()),
            "completed_interval": share_by_vehicle(group, "completed"),
            "drifted": float(group["drifted"].mean()),
            "drifted_interval": share_by_vehicle(group, "drifted"),
            "vehicles_always_drifted": int(group.groupby("vehicle")["drifted"].all().sum()),
            **{name: _spread(group[name]) for name in ("completion", "drifting")},
            "outcomes": {str(k): int(v) for k, v in group["outcome"].value_counts().items()},
            "solver_failures": int(group["solver_failures"].sum()),
            "solve_ms_median": float(group["solve_ms_median"].median()),
        }
        if "second_plan" in group:
            entry["without_second_plan"] = int((group["second_plan"] == False).sum())  # noqa: E712 (None counts not)
        if "refused" in group and group["refused"].notna().all():
            refused = group["refused"].astype(bool)
            entry["refused"] = int(refused.sum())
            entry["not_completed_and_not_refused"] = int((~refused & ~group["completed"]).sum())
        for name in errors:
            entry |= _errors(group, name)
        summary[str(model)] = entry
    return summary


def held(runs: pd.DataFrame) -> pd.Series:
    """Whether each run held the drift throughout."""
    return runs["completed"] & (runs["drifting"] >= DRIFTED)


def _errors(group: pd.DataFrame, name: str) -> dict[str, Any]:
    failing = group.assign(ranked=group[name].where(group["completed"], np.inf))
    attempts = group.groupby("vehicle")[name]
    return {
        name: _spread(failing["ranked"]),
        f"{name}_interval": by_vehicle(failing, "ranked", partial(_quantile, q=0.5)),
        f"{name}_until_the_end": _spread(group[name]),
        f"{name}_of_attempts": {
            "best": float(attempts.min().median()),
            "median": float(attempts.median().median()),
            "worst": float(attempts.max().median()),
        },
    }


def _spread(values: pd.Series) -> dict[str, float]:
    return {label: _quantile(values.to_numpy(), q) for label, q in QUANTILES.items()}


def _quantile(values: np.ndarray, q: float) -> float:
    # Where some are infinite none is interpolated: the worse of two neighbours, then.
    return float(np.quantile(values, q, method="linear" if np.isfinite(values).all() else "higher"))


def completion_table(summary: dict[str, Any]) -> str:
    """How many runs completed the course, and their errors, over all runs with 95 % intervals, as Markdown."""
    heads = ("the controller believes", "completed (95 %)", "drift held throughout (95 %)", "on all attempts", "spins",
             "RMS e, least / median (95 %) / most [m]", "RMS sideslip error, median (95 %) [rad]")  # fmt: skip
    rows = []
    for model, s in summary.items():
        e, b = ({q: _said(s[name][q], digits) for q in ("least", "median", "most")}
                for name, digits in (("rms_e", 2), ("rms_sideslip_error", 3)))  # fmt: skip
        between_e, between_b = (" to ".join(_said(value, digits) for value in s[f"{name}_interval"])
                                for name, digits in (("rms_e", 2), ("rms_sideslip_error", 3)))  # fmt: skip
        completed, drifted = (f"{s[name]:.0%} ({' to '.join(f'{value:.0%}' for value in s[f'{name}_interval'])})"
                              for name in ("completed", "drifted"))  # fmt: skip
        always = f"{s['vehicles_always_drifted']} of {s['vehicles']} vehicles"
        rows.append((LABELS.get(model, model), completed, drifted, always, s["outcomes"].get("spin", 0),
                     f"{e['least']} / {e['median']} ({between_e}) / {e['most']}",
                     f"{b['median']} ({between_b})"))  # fmt: skip
    return (
        "\n".join(tabulated(heads, rows))
        + "\n\nA run that was not completed (-) ranks behind all others in its errors."
    )


def _said(value: float, digits: int) -> str:
    return f"{value:.{digits}f}" if np.isfinite(value) else "-"


def plans_sentence(summary: dict[str, Any]) -> str:
    """How many second plans failed; empty where none did. Such a plan is not driven."""
    parts = [
        f"{LABELS.get(model, model)} {s['without_second_plan']} of {s['runs']}"
        for model, s in summary.items()
        if s.get("without_second_plan")
    ]
    if not parts:
        return ""
    return f"No second plan was found, and what Once-Info taught was driven with: {', '.join(parts)} runs.\n\n"


def refusal_sentence(summary: dict[str, Any]) -> str:
    """What the lane's logs said beforehand (`drift_drake.gap.choose.choice`); empty where it was not asked."""
    parts = [
        f"{LABELS.get(model, model)}: {s['refused']} of {s['runs']} runs refused beforehand, "
        f"{s['not_completed_and_not_refused']} of the others were not completed"
        for model, s in summary.items()
        if "refused" in s
    ]
    return f"By the informative drives' logs, {'; '.join(parts)}.\n\n" if parts else ""


def choice_sentence(runs: pd.DataFrame) -> str:
    """What was believed by the drives, and what they identified with an additional fault; empty if none was asked."""
    return "".join(_choice(runs[runs["model"] == model], LABELS[model]) for model in ("chosen_once", "chosen"))


def _choice(chosen: pd.DataFrame, label: str) -> str:
    if chosen.empty:
        return ""
    believed = ", ".join(f"{kind} {count}" for kind, count in chosen["believed"].value_counts().items())
    more = chosen["one_more"].fillna("").str.split(" ").str[0].loc[lambda names: names != ""].value_counts()
    named = ", ".join(f"{name} {count}" for name, count in more.items()) or "none"
    double = int(chosen["double_track"].sum())
    return (
        f"{label[0].upper()}{label[1:]}: {believed}; identified with an additional fault: {named}; "
        f"as a double-track car: {double}.\n\n"
    )


def over_oracle_table(runs: pd.DataFrame) -> str:
    """RMS e over the oracle's on the same attempts, of those that the oracle completes, as Markdown; empty without it.

    A run that was not completed is infinitely far off.
    """
    by_attempt = runs.assign(ranked=runs["rms_e"].where(runs["completed"], np.inf)).pivot(
        index=["vehicle", "noise_seed"], columns="model", values=["ranked", "max_e"]
    )
    if "oracle" not in by_attempt["ranked"]:
        return ""
    by_attempt = by_attempt[np.isfinite(by_attempt["ranked"]["oracle"])]
    errors, strays = by_attempt["ranked"], by_attempt["max_e"] > STRAYED
    heads = ("RMS e over the oracle's", "median", "most", f"above {FAR_OFF:g}",
             f"beyond {STRAYED:g} m where the oracle is not")  # fmt: skip
    rows = []
    for model in errors.columns.drop("oracle"):
        ratio = (errors[model] / errors["oracle"]).dropna()
        count, strayed = len(ratio), int((strays[model] & ~strays["oracle"]).sum())
        rows.append((LABELS.get(model, model), _said(_quantile(ratio.to_numpy(), 0.5), 2), _said(ratio.max(), 2),
                     f"{int((ratio > FAR_OFF).sum())} of {count}", f"{strayed} of {count}"))  # fmt: skip
    return "\n".join(tabulated(heads, rows)) + "\n\n"


def ordering_table(runs: pd.DataFrame) -> str:
    """Each of the paper's models less each that the paper ranks below it (`differences_table`); empty with fewer."""
    present = [model for model in RANKED if (runs["model"] == model).any()]
    pairs = [(model, below) for better, model in enumerate(present) for below in present[:better]]
    rows = [(f"{LABELS[model]} less {LABELS[below]}", *pair_of(runs, "model", model, below)) for model, below in pairs]
    return f"{differences_table(rows)}\n\n" if rows else ""


def pair_of(runs: pd.DataFrame, column: str, one: str, other: str) -> tuple[pd.DataFrame, pd.DataFrame]:
    """The runs of two values of a column."""
    return runs[runs[column] == one], runs[runs[column] == other]


def differences_table(rows: Sequence[tuple[str, pd.DataFrame, pd.DataFrame]]) -> str:
    """Runs less other runs of the same attempts, a labelled pair a row, as Markdown.

    Shares of runs with 95 % intervals by vehicle, and on how many of the vehicles where one is ahead it is the first by
    the median of its attempts' RMS e (a run that was not completed is infinitely far off).
    """
    found = []
    for label, *pair in rows:
        first, second = (runs.assign(drifted=held(runs), ranked=runs["rms_e"].where(runs["completed"], np.inf))
                         for runs in pair)  # fmt: skip
        cells = [_more(first, second, flag) for flag in ("completed", "drifted")]
        a, b = (scores.groupby("vehicle")["ranked"].median() for scores in (first, second))
        ahead, behind = int((a < b).sum()), int((b < a).sum())
        found.append((label, *cells, f"{ahead} of {ahead + behind} vehicles"))
    return "\n".join(tabulated(("", "runs completed", "drifts held throughout", "less RMS e on"), found))


def _more(first: pd.DataFrame, second: pd.DataFrame, flag: str) -> str:
    """By how much the first runs' share with a flag is above the second's."""
    more, low, high = share_difference(first, second, flag)
    return f"{more:+.0%} ({low:+.0%} to {high:+.0%})"


def share_difference(first: pd.DataFrame, second: pd.DataFrame, flag: str) -> tuple[float, float, float]:
    """The first runs' share with a flag less the second's of the same attempts, with its 95 % interval by vehicle."""
    # Both have the same attempts, so that the mean of the signed flags is half the difference of the shares.
    signed = pd.concat([first.assign(signed=2.0 * first[flag]), second.assign(signed=-2.0 * second[flag])])
    return float(signed["signed"].mean()), *by_vehicle(signed, "signed", lambda values: float(np.mean(values)))


def paper_table(summary: dict[str, Any], error: str) -> str:
    """Table II (`rms_e`) or III (`rms_sideslip_error`), the paper's figure and ours side by side, as Markdown."""
    models = sorted(summary, key=lambda model: model not in PAPER[error])  # the paper's first
    header, digits = ["of a vehicle's attempts"], 2 if error == "rms_e" else 3
    for model in models:
        label = LABELS.get(model, model)
        header += [f"{label}, paper", "here"] if model in PAPER[error] else [label]
    lines = []
    several = any(entry["attempts"] > 1 for entry in summary.values())
    for row, name in enumerate(("best", "median", "worst")):
        if not several and name != "median":
            continue  # of one attempt all three are the same
        cells = [name]
        for model in models:
            here = f"{summary[model][f'{error}_of_attempts'][name]:.{digits}f}"
            cells += [f"{PAPER[error][model][row]:.{digits}f}", here] if model in PAPER[error] else [here]
        lines.append(cells)
    return "\n".join(tabulated(header, lines))


def completed_of(runs: pd.DataFrame, models: Sequence[str]) -> pd.DataFrame:
    """The models' completed runs; where there is none at all, all of their runs."""
    of_models = runs[runs["model"].isin(list(models))]
    return of_models[of_models["completed"]] if of_models["completed"].any() else of_models


def pictured_vehicle(runs: pd.DataFrame, models: Sequence[str]) -> int:
    """Of the vehicles on which most of the models completed a run, the middle one by their RMS e."""
    errors = completed_of(runs, models).groupby(["vehicle", "model"])["rms_e"].median().groupby("vehicle")
    count = errors.size()
    ranked = errors.mean()[count == count.max()].sort_values()
    return int(ranked.index[(len(ranked) - 1) // 2])


def median_run(runs: pd.DataFrame) -> pd.Series:
    """The middle one by RMS e."""
    return runs.sort_values("rms_e").iloc[(len(runs) - 1) // 2]


def pictured_runs(runs: pd.DataFrame, models: Sequence[str]) -> dict[str, pd.Series]:
    """Each model's median completed run of one and the same vehicle; models without one on it are left out."""
    of_vehicle = completed_of(runs, models).loc[lambda some: some["vehicle"] == pictured_vehicle(runs, models)]
    found = {model: of_vehicle[of_vehicle["model"] == model] for model in models}
    return {model: median_run(group) for model, group in found.items() if not group.empty}


def pictured_models(runs: pd.DataFrame, pictured: Sequence[str]) -> list[str]:
    """Those of the models that were run; with fewer than two of them, the first four that were."""
    present = list(dict.fromkeys(runs["model"]))
    shown = [model for model in pictured if model in present]
    return shown if len(shown) > 1 else present[:4]


def picture_sentence(runs: pd.DataFrame, pictured: Sequence[str] = PICTURED) -> str:
    """What time_series.png shows."""
    shown = pictured_models(runs, pictured)
    vehicle, found = pictured_vehicle(runs, shown), pictured_runs(runs, shown)
    if not runs.loc[runs["model"].isin(shown), "completed"].any():
        return f"time_series.png: vehicle {vehicle}, each model's median run as far as it came: none was completed.\n\n"
    missing = [LABELS.get(model, model) for model in shown if model not in found]
    without = f" {', '.join(missing)}: none completed on it, none shown." if missing else ""
    return f"time_series.png: vehicle {vehicle}, each model's median completed run.{without}\n\n"


def draw(folder: Path, runs: pd.DataFrame, reference: Reference, pictured: Sequence[str] = PICTURED) -> None:
    """time_series.png (`pictured_runs`, transitions in grey) and overhead.png (all runs, a panel a model).

    Args:
        pictured: the models of the time series, see `pictured_models`.
    """
    parameters, shown = VehicleParameters(), pictured_models(runs, pictured)
    drawn = {LABELS.get(model, model): _read(folder, run) for model, run in pictured_runs(runs, shown).items()}
    write_figure(time_series(drawn, reference, parameters), folder / "time_series.png")
    panels = overhead_of(folder, runs, pictured_vehicle(runs, shown))
    write_figure(overhead_panels(panels, reference, parameters), folder / "overhead.png")


def overhead_of(folder: Path, runs: pd.DataFrame, vehicle: int) -> list[OverheadPanel]:
    """A panel a model: all of its runs, and its median one, of a vehicle where that one was completed."""
    panels = []
    for model, group in runs.groupby("model", sort=False):
        completed = group[group["completed"]]
        same = completed[completed["vehicle"] == vehicle]
        picked = next(candidates for candidates in (same, completed, group) if not candidates.empty)
        title = f"{LABELS.get(str(model), str(model))}: {held(group).sum()} of {len(group)} held the drift"
        tables = [_read(folder, run) for _, run in group.iterrows()]
        panels.append(OverheadPanel(title, tables, list(group["outcome"]), _read(folder, median_run(picked))))
    return panels


def _read(folder: Path, run: pd.Series) -> pd.DataFrame:
    return pd.read_csv(folder / f"{run_name(str(run['model']), int(run['vehicle']), int(run['noise_seed']))}.csv")
