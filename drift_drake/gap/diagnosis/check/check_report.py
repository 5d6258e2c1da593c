"""The report of a check: one self-contained HTML file."""

from collections.abc import Sequence
from pathlib import Path

from drift_drake.car.effects.catalogue import shown_by
from drift_drake.car.log.table import Run
from drift_drake.car.parameters import CarParameters
from drift_drake.gap.diagnosis.check.check import Checked
from drift_drake.gap.estimation.driven import all_driven
from drift_drake.gap.estimation.prior import REACH
from drift_drake.gap.evidence.limit_rows import limit_rows, outlook_rows
from drift_drake.gap.logs.screening.screened import REACHED_UNITS
from drift_drake.view.pages.driving import driving
from drift_drake.view.pages.page import Source, page_html

TEMPLATE = Path(__file__).parent / "check_report.html"
WORDS = ("detection limit", "effect", "sideslip (beta)", "yaw rate (r)", "omega_r")


def report_html(c: Checked, runs: Sequence[Run], car: CarParameters | None = None, source: Source | None = None) -> str:
    """The report's HTML; nothing is loaded from elsewhere.

    Args:
        runs: that were checked; car: that they were checked relative to.
    """
    rows = []
    if car is not None:
        outlook = c.for_calibration.outlook if c.for_calibration is not None else {}
        rows = limit_rows(c.detection, car.single_track()) or outlook_rows(outlook, car.single_track())
    return page_html(
        TEMPLATE,
        WORDS,
        c=c,
        asked=c.for_calibration,
        source=source or Source(),
        how=None if car is None else driving(all_driven(runs, car)),
        limits=rows,
        reach=REACH,
        drives=shown_by([row.name for row in rows if not row.named or row.share > 1.0]),
        reached={name: unit for name, unit in REACHED_UNITS.items() if any(name in run.reached for run in c.runs)},
    )
