"""The report of a diagnosis by the filter's likelihood: one self-contained HTML file, by verdict."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup

from drift_drake.car.effects.catalogue import CATALOGUE, shown_by
from drift_drake.car.log.table import UNITS
from drift_drake.gap.diagnosis.answers.answer import Answer
from drift_drake.gap.diagnosis.likelihood.diagnose import Diagnosis
from drift_drake.gap.diagnosis.likelihood.isolability import Isolability, isolability
from drift_drake.gap.diagnosis.reports.trials import EMPTY, half_second_ahead, trials_by_likelihood
from drift_drake.gap.estimation.driven import all_driven
from drift_drake.gap.estimation.filter_state import CHANNELS
from drift_drake.gap.estimation.filtered import filter_case
from drift_drake.gap.estimation.fit import Fit, no_effects
from drift_drake.gap.estimation.freeform import misfit
from drift_drake.gap.estimation.prior import REACH
from drift_drake.gap.estimation.problem import Problem
from drift_drake.gap.estimation.reduction import (
    HORIZONS,
    JUDGED,
    STATES,
    at_judged,
    errors_of,
    share_removed,
    start_rows,
)
from drift_drake.gap.evidence.limit_rows import LimitRow, limit_rows
from drift_drake.gap.evidence.posterior import UNKNOWN, hypothesis_name
from drift_drake.view.pages.charts import LOW, NORMAL, Line, Panel, heat_map, placed, reach_of, side_by_side, stacked
from drift_drake.view.pages.driving import driving
from drift_drake.view.pages.page import GLOSSARY, Source, page_html

LEAST_EXCESS = 0.01  # of the innovations' mean square that must be gap for a ceiling to mean anything
LEAST_DEVIATION = 0.05  # tolerances: less reads as 0.0
MOST_SHOWN = 8  # hypotheses
LOOK_ALIKE = 0.9  # cosine of two signatures
TEMPLATE = Path(__file__).parent / "report.html"
LONGEST_CORRELATION = 40  # rows
CELLS = 8  # of a map, along either axis
Cars = dict[str, Fit]  # the fits that are drawn, by the name of their car


def in_doubt(answer: Answer, limits: Sequence[LimitRow], nearest: Sequence[str] = ()) -> list[str]:
    """Effects that another drive should show: rivals that are still open, or those that these logs cannot name.

    Args:
        nearest: effects of the nearest hypothesis to an unknown gap.
    """
    if answer.verdict == "none":
        return [row.name for row in limits if not row.named or row.share > 1.0]
    rivals = [name for names in answer.ambiguity for name in names.split("+") if name in CATALOGUE]
    return list(dict.fromkeys([*rivals, *nearest])) if len(answer.ambiguity) > 1 or nearest else []


def worst_runs(d: Diagnosis, count: int = 2) -> list[int]:
    """Indices of the runs with the largest gap."""
    runs = d.problem.runs
    return sorted(range(len(runs)), key=lambda i: -d.answer.where["runs"].get(runs[i].name, 0.0))[:count]


def overlay(d: Diagnosis, index: int, cars: Cars, tried: bool = False) -> Markup:
    """One run as measured and as predicted half a second ahead, and below each state what is left over.

    tried: with lines for an effect that is tried (`trials`).
    """
    run = d.problem.runs[index]
    t = np.arange(len(run.y)) * run.period
    predicted = {name: half_second_ahead(d.problem, fit, index) for name, fit in cars.items()}
    onset = d.answer.where["onset"].get(run.name)
    panels = []
    for i, state in enumerate(STATES):
        measured = [Line("measured", t, run.y[:, i])] if run.used[i] else []
        lines = [Line(name, rows * run.period, values[:, i]) for name, (rows, values) in predicted.items()]
        reach = reach_of(run.y[:, i], [line.y for line in lines]) if run.used[i] else None
        more = [EMPTY] if tried and run.used[i] else []
        panels.append(Panel(f"{state} [{UNITS[state]}]", [*measured, *lines, *more], reach=reach))
        if run.used[i]:
            left = [Line(name, rows * run.period, run.y[rows, i] - values[:, i])
                    for name, (rows, values) in predicted.items()]  # fmt: skip
            panels.append(Panel(f"measured less predicted [{UNITS[state]}]", [*left, *more], LOW))
    return placed(stacked(panels, {} if onset is None else {"gap sets in": onset}))


def squares(problem: Problem, fit: Fit) -> list[np.ndarray]:
    """Mean square half-second errors [starts] of each run, in noise variances; NaN where the run ends sooner."""
    errors = errors_of(problem, fit.theta, fit.names)
    return [
        np.mean(e[:, JUDGED][:, run.used[: len(STATES)]], axis=-1) for run, e in zip(problem.runs, errors, strict=True)
    ]


def time_line(d: Diagnosis, errors: dict[str, list[np.ndarray]]) -> Markup:
    """Half-second errors over time, run by run."""
    panels = []
    for i, run in enumerate(d.problem.runs):
        lines = [Line(name, start_rows(run) * run.period, np.sqrt(by_run[i])) for name, by_run in errors.items()]
        panels.append(Panel(f"{run.name}: error at 0.5 s [noise levels]", lines, 90, log=True))
    return placed(stacked(panels))


def heat_maps(d: Diagnosis, errors: dict[str, list[np.ndarray]]) -> list[Markup]:
    """Half-second errors over (speed, lateral acceleration) and (sideslip, rear slip), with sample counts."""
    places = []
    for run in d.problem.runs:
        y = run.y[start_rows(run)]
        slip = (y[:, 3] - y[:, 1] * np.cos(y[:, 2])) / np.maximum(y[:, 3], 0.5)
        places.append(np.column_stack([y[:, 1], y[:, 1] * y[:, 0], y[:, 2], slip]))
    place = np.concatenate(places)
    top = float(np.sqrt(np.nanquantile(np.concatenate(errors["nominal"]), 0.98)))
    axes_of = [(0, 1, "speed [m/s]", "v r [m/s²]"), (2, 3, "sideslip [rad]", "rear slip")]
    maps = []
    for a, b, x_name, y_name in axes_of:
        edges = [np.linspace(place[:, k].min(), place[:, k].max() + 1e-9, CELLS + 1) for k in (a, b)]
        count, _, _ = np.histogram2d(place[:, a], place[:, b], bins=edges)
        texts = [[f"{n:.0f}" if n else "" for n in column] for column in count]
        for name, parts in errors.items():
            value = np.nan_to_num(np.concatenate(parts))
            total, _, _ = np.histogram2d(place[:, a], place[:, b], bins=edges, weights=value)
            mean = np.sqrt(np.where(count > 0, total / np.maximum(count, 1), np.nan))
            labels = (f"{name} car", x_name, y_name, "error [noise levels]")
            maps.append(placed(heat_map(edges[0].round(4), edges[1].round(4), mean, texts, labels, top)))
    return maps


def correlations(d: Diagnosis, cars: Cars) -> Markup:
    """Auto-correlation of the innovations and their cross-correlation with steering."""
    problem = d.problem
    lags = np.arange(LONGEST_CORRELATION) * problem.runs[0].period
    innovations = {name: filter_case(problem, fit.theta, fit.names).innovations for name, fit in cars.items()}
    panels = []
    for channel in (0, 2, 5):
        auto, cross = [], []
        for name, parts in innovations.items():
            of_runs = []
            for run, e in zip(problem.runs, parts, strict=True):
                signal, steering = e[run.counted, channel], run.delta[run.counted]
                of_runs.append([correlation(signal, other) for other in (signal, steering - np.mean(steering))])
            mean = np.mean(of_runs, axis=0)
            auto.append(Line(name, lags[1:], mean[0, 1:]))
            cross.append(Line(name, lags, mean[1]))
        panels += [Panel(f"{CHANNELS[channel]} with itself", auto, 130),
                   Panel(f"{CHANNELS[channel]} with steering", cross, 130)]  # fmt: skip
    return placed(side_by_side(panels, "lag [s]"))


def correlation(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Of one signal with the other [lags], the first later."""
    size = max(float(np.sqrt(np.mean(a**2) * np.mean(b**2))), 1e-12)
    return np.array([np.mean(a[lag:] * b[: len(b) - lag]) / size for lag in range(LONGEST_CORRELATION)])


def error_by_horizon(d: Diagnosis) -> Markup:
    """Root mean square error against the horizon: nominal, corrected on runs not fitted, floor."""
    r, horizons = d.reduction, np.array(HORIZONS)
    lines = [
        Line(label, horizons, np.sqrt(values), colour, dots=True)
        for values, colour, label in ((r.before, "", "nominal"), (r.after, "", "corrected"),
                                      (r.floor, NORMAL, "best fit to everything"))
    ]  # fmt: skip
    return placed(
        side_by_side([Panel("error [noise levels]", lines, 200, log=True)], "horizon [s]", columns=1, log_x=True)
    )


def isolability_matrix(found: Isolability) -> Markup:
    """How alike the effects' signatures are in these logs."""
    texts = [["" if q < 0.9 else f"{100 * q:.0f}" for q in row] for row in found.likeness]
    labels = ("", "", "", "likeness")
    return placed(heat_map(list(found.names), list(found.names), found.likeness, texts, labels, 1.0, 560))


def uncertainty(cells: dict[str, Any]) -> Markup:
    """The learnt model's predictive deviation over speed and sideslip, with sample counts."""
    texts: Sequence[Sequence[str]] = [[f"{n}" if n else "" for n in column] for column in cells["count"]]
    labels = ("", "speed [m/s]", "sideslip [rad]", "deviation [noise levels]")
    return placed(heat_map(cells["speed"], cells["sideslip"], np.array(cells["deviation"], dtype=float), texts, labels))


def comparison(d: Diagnosis) -> dict[str, float]:
    """Shares of the gap at half a second that others than the causes take away, each at its best in these logs.

    The runner-up, the fitted single effect that explains least (a placebo), and functions of the state pushing the
    nominal car (the free-form ceiling; its share of the nominal car's excess innovations).
    """
    hypotheses = [f for f, _ in d.found]
    named = set(d.answer.causes)
    best = hypotheses[0]
    floor = at_judged(errors_of(d.problem, best.theta, best.names))
    before = at_judged(errors_of(d.problem, d.fit.theta[: d.problem.nuisances], ()))

    def removed(fit: Fit) -> float:
        return share_removed(before, at_judged(errors_of(d.problem, fit.theta, fit.names)), floor)

    out = {}
    others = [f for f in hypotheses if f.names and not named <= set(f.names)]
    singles = [f for f in others if len(f.names) == 1]
    if others:
        out[f"runner-up: {hypothesis_name(others[0].names)}"] = removed(others[0])
    if singles and singles[-1] is not others[0]:
        out[f"placebo: {singles[-1].names[0]}"] = removed(singles[-1])
    nothing = next(f for f in hypotheses if not f.names)
    excess = 1.0 - best.mean_square / nothing.mean_square
    if excess > LEAST_EXCESS:
        out["free-form ceiling"] = misfit(d.problem, nothing, "functions").removed / excess
    return out


def look_alikes(found: Isolability) -> list[tuple[str, str, float]]:
    """Pairs of effects that these logs hardly tell apart, the most alike first."""
    pairs = [
        (a, b, float(found.likeness[i, j]))
        for i, a in enumerate(found.names)
        for j, b in enumerate(found.names[:i])
        if found.likeness[i, j] >= LOOK_ALIKE
    ]
    return sorted(pairs, key=lambda pair: -pair[2])


def gap_charts(d: Diagnosis) -> dict[str, Any]:
    """What shows the gap, and with a named cause what is left of it; where there is none, the predictions alone."""
    cars = {"nominal": no_effects(d.problem)} | ({"corrected": d.fit} if d.answer.verdict == "effect" else {})
    worst = worst_runs(d)
    data = trials_by_likelihood(d, worst[0])
    overlays = [(d.problem.runs[i].name, overlay(d, i, cars, bool(data) and i == worst[0])) for i in worst]
    if d.answer.verdict == "none":
        return {"overlays": overlays, "time_line": "", "trials": data}
    errors = {name: squares(d.problem, fit) for name, fit in cars.items()}
    charts = {
        "time_line": time_line(d, errors),
        "heat_maps": heat_maps(d, errors),
        "overlays": overlays,
        "trials": data,
        "correlations": correlations(d, cars),
    }
    if d.answer.verdict == "effect":
        charts["by_horizon"] = error_by_horizon(d)
    return charts


def report_html(d: Diagnosis, source: Source | None = None) -> str:
    """The report's HTML; nothing is loaded from elsewhere."""
    answer = d.answer
    signatures = isolability(d.problem, d.fit, tuple(CATALOGUE))
    limits = limit_rows(answer.details["detection"], d.problem.vehicle) if answer.verdict == "none" else []
    learnt = answer.details["learned"]
    return page_html(
        TEMPLATE,
        tuple(GLOSSARY),
        answer=answer,
        source=source or Source(),
        runs=[(run.name, len(run.y) * run.period) for run in d.problem.runs],
        probabilities=[(name.replace("+", " + "), p) for name, p in list(answer.posterior.items())[:MOST_SHOWN]],
        catalogue=CATALOGUE,
        charts=gap_charts(d),
        ahead="0.5 s",
        worst=d.problem.runs[worst_runs(d, 1)[0]].name,
        removed=answer.details["reduction_by_state"] | answer.details["reduction_by_horizon"],
        comparison=comparison(d) if answer.verdict == "effect" else {},
        nearest=answer.details.get("nearest"),
        limits=limits,
        how=driving(all_driven(d.runs, d.problem.vehicle)) if d.runs else None,
        reach=REACH,
        unexcited=signatures.unexcited(),
        alike=look_alikes(signatures),
        isolability=isolability_matrix(signatures),
        learned=learnt,
        uncertainty=uncertainty(learnt["map"]) if learnt["map"] else "",
        drives=shown_by(in_doubt(answer, limits)),
        unknown=answer.verdict == UNKNOWN,
        deviations={name: n for name, n in answer.tolerances.items() if abs(n) >= LEAST_DEVIATION},
    )
