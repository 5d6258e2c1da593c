"""The report of another day: one self-contained HTML file."""

import html
from pathlib import Path

from drift_drake.diagnosis.another_day import DayDiagnosis
from drift_drake.safe_files import write_text


def write_day_report(diagnosis: DayDiagnosis, path: str | Path) -> None:
    """Writes the report."""
    write_text(path, f"<!doctype html><p>{html.escape(diagnosis.answer.sentence())}</p>")
