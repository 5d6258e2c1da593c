"""The report of an identification: one self-contained HTML file."""

from pathlib import Path

import jinja2
from markupsafe import Markup

from drift_drake.identification import report_figures as figures
from drift_drake.identification.calibration import Identification
from drift_drake.safe_files import write_text

TEMPLATE = Path(__file__).parent / "report.html"


def report_html(found: Identification) -> str:
    """The report's HTML; pictures are inline SVG, nothing is loaded from elsewhere."""
    c = found.calibration
    environment = jinja2.Environment(autoescape=True, undefined=jinja2.StrictUndefined)
    return environment.from_string(TEMPLATE.read_text(encoding="utf-8")).render(
        c=c,
        sentence=c.sentence(),
        untold=[direction.sentence() for direction in c.untold],
        rows=found.rows,
        intervals=Markup(figures.intervals(c.parameters)),
        errors=Markup(figures.errors(c.held_out)),
        correlations=Markup(figures.correlations(list(c.parameters), c.correlation)),
    )


def write_report(found: Identification, path: str | Path) -> None:
    """Writes the report."""
    write_text(path, report_html(found))
