"""The report of a diagnosis: one self-contained HTML file."""

from pathlib import Path

import jinja2
from markupsafe import Markup

from drift_drake.diagnosis import report_figures as figures
from drift_drake.diagnosis.diagnose import Diagnosis
from drift_drake.diagnosis.isolability import isolability
from drift_drake.vehicle.effects import CATALOGUE

TEMPLATE = Path(__file__).parent / "report.html"


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
        posterior=Markup(figures.posterior_bars(answer.posterior)),
        time_line=Markup(figures.time_line(d, before, after)),
        heat_maps=Markup(figures.heat_maps(d, before, after)),
        overlays=Markup(figures.overlays(d)),
        by_horizon=Markup(figures.error_by_horizon(d)),
        correlations=Markup(figures.correlations(d)),
        isolability=Markup(figures.isolability_matrix(signatures)),
    )


def write_report(d: Diagnosis, path: str | Path) -> None:
    """Writes the report."""
    Path(path).write_text(report_html(d))
