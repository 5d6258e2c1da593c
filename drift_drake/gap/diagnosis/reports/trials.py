"""Effects to be tried in a report: what each would predict, at sizes that a slider goes through."""

import json
from collections.abc import Sequence
from typing import Any

import numpy as np
from markupsafe import Markup

from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.car.log.table import UNITS
from drift_drake.gap.diagnosis.calibrated.diagnose_change import ChangeDiagnosis
from drift_drake.gap.estimation.effort import is_slow
from drift_drake.gap.estimation.unknowns import added
from drift_drake.gap.estimation.windows import HORIZONS, WindowedRun, errors, thinned
from drift_drake.gap.evidence.hypotheses import effects_of
from drift_drake.gap.evidence.posterior import hypothesis_name
from drift_drake.gap.evidence.search import Curve, Search

TRIED = "with the effect tried"  # name of its lines
MOST = 150  # windows of a run


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
    order = sorted(effects, key=lambda name: -effects[name]["p"])
    data = {
        "t": short(at * run.period), "measured": short(run.y[at][:, kept].T), "before": short(before.T),
        "normal": short(search.normal.scales[-1, kept]), "states": [f"{name} [{UNITS[name]}]" for _, name in states],
        "effects": {name: effects[name] for name in order},
    }  # fmt: skip
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
