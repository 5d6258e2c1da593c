"""The report of an identification: one self-contained HTML file."""

from pathlib import Path

from drift_drake.identification import report_figures as figures
from drift_drake.identification.calibration import Identification
from drift_drake.pages.page import Source, page_html

TEMPLATE = Path(__file__).parent / "report.html"
WORDS = ("95 % interval", "innovation", "held out", "calibrated car", "sideslip (beta)", "yaw rate (r)", "omega_r")


def report_html(found: Identification, source: Source | None = None) -> str:
    """The report's HTML; nothing is loaded from elsewhere."""
    c = found.calibration
    return page_html(
        TEMPLATE,
        WORDS,
        c=c,
        source=source or Source(),
        sentence=c.sentence(),
        not_identified=[direction.sentence() for direction in c.not_identified],
        rows=found.rows,
        intervals=figures.intervals(c.parameters),
        errors=figures.error_chart(c.held_out),
        correlations=figures.correlations(list(c.parameters), c.correlation),
    )
