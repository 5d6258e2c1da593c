"""The report of a diagnosis by the filter's likelihood: one self-contained HTML file, by verdict."""

from pathlib import Path
from typing import Any

from drift_drake.diagnosis.likelihood.diagnose import Diagnosis
from drift_drake.diagnosis.likelihood.isolability import Isolability, isolability
from drift_drake.diagnosis.reports import report_figures as figures
from drift_drake.diagnosis.reports.limit_rows import limit_rows
from drift_drake.diagnosis.shared.manoeuvres import shown_by
from drift_drake.diagnosis.shared.posterior import UNKNOWN, hypothesis_name
from drift_drake.diagnosis.shared.ranges import REACH
from drift_drake.estimation.fit import Fit
from drift_drake.estimation.freeform import misfit
from drift_drake.estimation.reduction import errors_of, share_removed
from drift_drake.pages.page import GLOSSARY, Source, page_html
from drift_drake.vehicle.catalogue import CATALOGUE

LEAST_EXCESS = 0.01  # of the innovations' mean square that must be gap for a ceiling to mean anything
LEAST_DEVIATION = 0.05  # tolerances: less reads as 0.0
MOST_SHOWN = 8  # hypotheses
LOOK_ALIKE = 0.9  # cosine of two signatures
TEMPLATE = Path(__file__).parent / "report.html"


def comparison(d: Diagnosis) -> dict[str, float]:
    """Shares of the gap at half a second that others than the causes take away, each at its best in these logs.

    The runner-up, the fitted single effect that explains least (a placebo), and functions of the state pushing the
    nominal car (the free-form ceiling; its share of the nominal car's excess innovations).
    """
    hypotheses = [f for f, _ in d.found.hypotheses()]
    named = set(d.answer.causes)
    best = hypotheses[0]
    floor = errors_of(d.problem, best.theta, best.names)
    before = errors_of(d.problem, d.fit.theta[: d.problem.nuisances], ())

    def removed(fit: Fit) -> float:
        return share_removed(before, errors_of(d.problem, fit.theta, fit.names), floor)

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
    """What shows the gap, and with a named cause what is left of it; nothing where there is none."""
    if d.answer.verdict == "none":
        return {}
    cars = figures.cars_of(d)
    errors = {name: figures.squares(d.problem, fit) for name, fit in cars.items()}
    charts = {
        "time_line": figures.time_line(d, errors),
        "heat_maps": figures.heat_maps(d, errors),
        "overlays": [(d.problem.runs[i].name, figures.overlay(d, i, cars)) for i in figures.worst_runs(d)],
        "correlations": figures.correlations(d, cars),
    }
    if d.answer.verdict == "effect":
        charts["by_horizon"] = figures.error_by_horizon(d)
    return charts


def doubtful(d: Diagnosis, unnamed: list[str]) -> list[str]:
    """Effects that another drive should show: rivals that are still open, or what these logs cannot name."""
    if d.answer.verdict == "none":
        return unnamed
    names = [name for names in d.answer.ambiguity for name in names.split("+") if name in CATALOGUE]
    return list(dict.fromkeys(names)) if len(d.answer.ambiguity) > 1 else []


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
        worst=d.problem.runs[figures.worst_runs(d, 1)[0]].name,
        removed=answer.details["reduction_by_state"] | answer.details["reduction_by_horizon"],
        comparison=comparison(d) if answer.verdict == "effect" else {},
        nearest=answer.details.get("nearest"),
        limits=limits,
        reach=REACH,
        unexcited=signatures.unexcited(),
        alike=look_alikes(signatures),
        isolability=figures.isolability_matrix(signatures),
        learned=learnt,
        uncertainty=figures.uncertainty(learnt["map"]) if learnt["map"] else "",
        drives=shown_by(doubtful(d, [row.name for row in limits if not row.named or row.share > 1.0])),
        unknown=answer.verdict == UNKNOWN,
        deviations={name: n for name, n in answer.tolerances.items() if abs(n) >= LEAST_DEVIATION},
    )
