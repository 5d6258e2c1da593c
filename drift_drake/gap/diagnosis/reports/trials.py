"""Effects to be tried in a report: what each would predict, at sizes that a slider goes through."""

import dataclasses
import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from markupsafe import Markup

from drift_drake.car.effects.catalogue import CATALOGUE, LIMITS
from drift_drake.gap.diagnosis.calibrated.diagnose_change import ChangeDiagnosis
from drift_drake.gap.diagnosis.likelihood.diagnose import Diagnosis
from drift_drake.gap.estimation.effort import is_slow
from drift_drake.gap.estimation.filtered import filter_case
from drift_drake.gap.estimation.fit import Fit, no_effects
from drift_drake.gap.estimation.freeform import with_more_process_noise
from drift_drake.gap.estimation.prior import range_of, tried_first
from drift_drake.gap.estimation.problem import Problem
from drift_drake.gap.estimation.reduction import HORIZONS as AHEAD
from drift_drake.gap.estimation.reduction import JUDGED, STATES, predicted_ahead, start_rows
from drift_drake.gap.estimation.unknowns import added
from drift_drake.gap.estimation.windows import HORIZONS, WindowedRun, errors, thinned
from drift_drake.gap.evidence.hypotheses import effects_of
from drift_drake.gap.evidence.posterior import hypothesis_name
from drift_drake.gap.evidence.search import Curve, Search
from drift_drake.view.colours import RUNS
from drift_drake.view.pages.charts import Line

TRIED = "with the effect tried"  # name of its lines
MOST = 150  # windows of a run
EMPTY = Line(TRIED, np.empty(0), np.empty(0), RUNS[3])  # which the page's script fills


def trials(d: ChangeDiagnosis, index: int, states: Sequence[tuple[int, str]]) -> Markup:
    """What the page's script draws effects from, as JSON: predictions of one run at the longest horizon.

    Args:
        index: of the run; states: their indices and names. A simulator that predicts slowly is asked for none.
    """
    day, search = d.search.day, d.search
    if is_slow(day.constants) or not search.curves:
        return Markup()
    (run,) = thinned(day.runs[index : index + 1], MOST)
    kept, at = [i for i, _ in states], run.starts + HORIZONS * run.stride_rows
    before = errors([run], day.constants, day.own)[:, -1, kept]
    effects = {}
    for curve, q in best_curves(search):
        known = d.answer.magnitudes.get(curve.name)
        effects[curve.name] = trial(search, curve, run, kept) | {
            "p": d.answer.posterior.get(hypothesis_name((curve.name,)), 0.0),
            "best": q if known is None else known.estimate,
        }  # fmt: skip
    return as_json(at * run.period, run.y[at][:, kept].T, before.T, search.normal.scales[-1, kept], effects)


def trials_by_likelihood(d: Diagnosis, index: int) -> Markup:
    """The same of a diagnosis by likelihood: rivals that were fitted, each from its own filter's states.

    Args:
        index: of the run.
    """
    problem = d.problem.replace(runs=d.problem.runs[index : index + 1])
    (run,) = problem.runs
    kept, nothing = np.flatnonzero(run.used[: len(STATES)]), no_effects(problem)
    rows, before = half_second_ahead(problem, nothing, 0)
    measured = run.y[rows][:, kept].T
    rivals = {fit.names[0]: fit.magnitudes[fit.names[0]] for fit, _ in d.found if len(fit.names) == 1}
    effects = {}
    for name, best in (rivals | {name: q.estimate for name, q in d.answer.magnitudes.items()}).items():
        none = () if name in LIMITS else (0.0,)  # whose zero is no limit at all
        sizes = np.unique([*none, best, *tried_first(range_of(name, problem.vehicle))])
        fits = [dataclasses.replace(nothing, names=(name,), theta=np.append(nothing.theta, q)) for q in sizes]
        errors = [short(measured - half_second_ahead(problem, fit, 0)[1][:, kept].T) for fit in fits]
        p = d.answer.posterior.get(name, 0.0)
        effects[name] = {"unit": CATALOGUE[name].suffix, "sizes": short(sizes), "errors": errors, "p": p, "best": best}
    if not effects:
        return Markup()
    return as_json(rows * run.period, measured, measured - before[:, kept].T, problem.noise[kept], effects)


def half_second_ahead(problem: Problem, fit: Fit, index: int) -> tuple[np.ndarray, np.ndarray]:
    """Rows [starts] and measurements [starts, 4] that a car predicts half a second ahead, from its filter's states."""
    rough = with_more_process_noise(problem)
    run, gains = rough.runs[index], filter_case(rough, fit.theta, fit.names)
    ahead = round(AHEAD[JUDGED] / run.period)
    starts = start_rows(run)
    starts = starts[starts + ahead < len(run.y)]
    out = predicted_ahead(rough, fit.theta, fit.names, index, gains, starts, np.array([ahead]))
    return starts + ahead, out[:, 0, : len(STATES)]


def as_json(
    t: np.ndarray, measured: np.ndarray, before: np.ndarray, normal: np.ndarray, effects: Mapping[str, Any]
) -> Markup:
    """What the page's script takes, the most probable effect first.

    Args:
        t: [windows] [s]; measured, before: readings and the car's errors [states, windows]; normal: usual sizes of
            errors [states].
    """
    order = sorted(effects, key=lambda name: -effects[name]["p"])
    data = {"t": short(t), "measured": short(measured), "before": short(before), "normal": short(normal),
            "effects": {name: effects[name] for name in order}}  # fmt: skip
    return Markup(json.dumps(data, separators=(",", ":")))


def best_curves(search: Search) -> list[tuple[Curve, float]]:
    """Of each effect, the curve that comes nearest to normal, and the magnitude where it does."""
    best: dict[str, tuple[float, Curve, float]] = {}
    for curve in search.curves:
        q, nats = curve.best(search)
        if curve.name not in best or nats < best[curve.name][0]:
            best[curve.name] = nats, curve, q
    return [(curve, q) for _, curve, q in best.values()]


def trial(search: Search, curve: Curve, run: WindowedRun, kept: Sequence[int]) -> dict[str, Any]:
    """One effect: its sizes, and the errors at each [sizes, states, windows]."""
    day, out = search.day, []
    for q in curve.magnitudes:
        moved = added(day.own, effects_of((curve.name,), np.array([q]), curve.follows, day))
        out.append(short(errors([run], day.constants, moved)[:, -1, kept].T))
    return {"unit": CATALOGUE[curve.name].suffix, "sizes": short(np.array(curve.magnitudes)), "errors": out}


def short(values: np.ndarray) -> list[Any]:
    """Four digits of each."""
    if values.ndim > 1:
        return [short(row) for row in values]
    return [float(f"{q:.4g}") for q in values]
