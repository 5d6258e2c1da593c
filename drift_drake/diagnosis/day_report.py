"""The report of another day: one self-contained HTML file."""

import html
from pathlib import Path

from drift_drake.diagnosis.another_day import DayDiagnosis


def write_day_report(diagnosis: DayDiagnosis, path: str | Path) -> None:
    """Writes the report."""
    Path(path).write_text(f"<!doctype html><p>{html.escape(diagnosis.answer.sentence())}</p>", encoding="utf-8")
