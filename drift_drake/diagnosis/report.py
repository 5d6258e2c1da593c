"""The report of a diagnosis: one self-contained HTML file."""

from pathlib import Path

import jinja2
from markupsafe import Markup

from drift_drake.diagnosis import report_figures as figures
from drift_drake.diagnosis.diagnose import Diagnosis
from drift_drake.diagnosis.isolability import isolability
from drift_drake.diagnosis.posterior import hypothesis_name
from drift_drake.estimation.fit import Fit
from drift_drake.estimation.freeform import misfit
from drift_drake.estimation.reduction import errors_of, share_removed
from drift_drake.safe_files import write_text
from drift_drake.vehicle.catalogue import CATALOGUE

LEAST_EXCESS = 0.01  # of the innovations' mean square that must be gap for a ceiling to mean anything
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
        out["free-form ceiling"] = min(misfit(d.problem, nothing, "functions").removed / excess, 1.0)
    return out


def report_html(d: Diagnosis) -> str:
    """The report's HTML; pictures are inline SVG, nothing is loaded from elsewhere."""
    answer, where = d.answer, d.answer.where
    before = figures.squares(d.problem, figures.nothing(d.problem))
    after = figures.squares(d.problem, d.fit)
    signatures = isolability(d.problem, d.fit, tuple(CATALOGUE))
    unexcited = signatures.unexcited()
    warnings = list(answer.warnings)
    if unexcited:
        warnings.append(f"These logs hardly excite {', '.join(unexcited)}: nothing can be said of them.")
    warnings.append("Logs of feedback driving: the driver answers to the car, so that causes and commands correlate.")
    learnt = answer.details["learned"]
    tables = [("state", where["states"]), ("force", where["channels"]), ("run", where["runs"])]
    environment = jinja2.Environment(autoescape=True, undefined=jinja2.StrictUndefined)
    return environment.from_string(TEMPLATE.read_text()).render(
        answer=answer,
        sentence=answer.sentence(),
        warnings=warnings,
        catalogue=CATALOGUE,
        tables=tables,
        removed=answer.details["reduction_by_state"] | answer.details["reduction_by_horizon"],
        unexcited=unexcited,
        comparison=comparison(d),
        posterior=Markup(figures.posterior_bars(answer.posterior)),
        time_line=Markup(figures.time_line(d, before, after)),
        heat_maps=Markup(figures.heat_maps(d, before, after)),
        overlays=Markup(figures.overlays(d)),
        by_horizon=Markup(figures.error_by_horizon(d)),
        correlations=Markup(figures.correlations(d)),
        learned=learnt,
        uncertainty=Markup(figures.uncertainty(learnt["map"])) if learnt["map"] else "",
        isolability=Markup(figures.isolability_matrix(signatures)),
    )


def write_report(d: Diagnosis, path: str | Path) -> None:
    """Writes the report."""
    write_text(path, report_html(d))
