"""The HTML report of a diagnosis or a calibration: the function behind `--report`."""

from pathlib import Path

from drift_drake.common.errors import InvalidOptionError
from drift_drake.common.safe_files import write_text
from drift_drake.gap.diagnosis.calibrated.diagnose_change import ChangeDiagnosis
from drift_drake.gap.diagnosis.likelihood.diagnose import Diagnosis
from drift_drake.gap.diagnosis.reports import change_report
from drift_drake.gap.diagnosis.reports import report as likelihood_report
from drift_drake.gap.identification import report as calibration_report
from drift_drake.gap.identification.calibration import Identification
from drift_drake.view.pages.page import Source


def report(
    found: Diagnosis | ChangeDiagnosis | Identification, path: str | Path | None = None, source: Source | None = None
) -> str:
    """The report of what `diagnose` or `identify` found, as HTML that loads nothing from elsewhere.

    Examples:
        >>> found = diagnose("logs/monday", "car.yaml")  # doctest: +SKIP
        >>> page = report(found, "answer.html")  # doctest: +SKIP

    Args:
        path: where to write it, too; source: what the page says of where it came from.

    Raises:
        InvalidOptionError: what was given has no report; OutputError: the file cannot be written.
    """
    if isinstance(found, ChangeDiagnosis):
        html = change_report.report_html(found, source)
    elif isinstance(found, Diagnosis):
        html = likelihood_report.report_html(found, source)
    elif isinstance(found, Identification):
        html = calibration_report.report_html(found, source)
    else:
        raise InvalidOptionError(
            f"found: there is no report of {type(found).__name__}; give what 'diagnose' or 'identify' returned"
        )
    if path is not None:
        write_text(Path(path), html)
    return html
