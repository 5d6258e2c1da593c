"""The report of another day: one self-contained HTML file."""

import dataclasses
from pathlib import Path

import numpy as np
from markupsafe import Markup

from drift_drake.diagnosis.another_day.diagnose_day import DayDiagnosis
from drift_drake.diagnosis.reports import day_report_figures as figures
from drift_drake.diagnosis.reports.limit_rows import LimitRow, limit_rows
from drift_drake.diagnosis.shared.manoeuvres import shown_by
from drift_drake.diagnosis.shared.posterior import UNKNOWN
from drift_drake.diagnosis.shared.ranges import REACH
from drift_drake.estimation.windows import regimes
from drift_drake.pages.page import GLOSSARY, Source, page_html
from drift_drake.vehicle.catalogue import CATALOGUE

TEMPLATE = Path(__file__).parent / "day_report.html"
REGIMES = (("speed", "m/s"), ("yaw rate times speed", "m/s²"), ("sideslip", "rad"), ("rim slip", "-"))
MOST_SHOWN = 8  # hypotheses
OF_THE_FILTER = ("nominal car", "innovation", "nat", "rear slip", "free-form forces")  # words that this report has not


@dataclasses.dataclass(frozen=True)
class CoverageRow:
    """How far the day was driven in one regime, beside the day of calibration."""

    name: str
    unit: str
    covered: float
    driven: float
    beyond: float  # share of windows


def coverage_rows(d: DayDiagnosis) -> tuple[list[CoverageRow], float]:
    """By regime how far the day goes beyond what calibration drove, and the share of windows that do in any."""
    hard = np.concatenate([regimes(run) for run in d.search.day.runs])
    covered = d.search.normal.covered
    beyond = hard > covered
    rows = [
        CoverageRow(name, unit, float(covered[i]), float(np.max(hard[:, i])), float(np.mean(beyond[:, i])))
        for i, (name, unit) in enumerate(REGIMES)
    ]
    return rows, float(np.mean(np.any(beyond, axis=1)))


def worst_run(d: DayDiagnosis) -> int:
    """Index of the run that holds the largest share of the gap."""
    runs = d.answer.where["runs"]
    return max(range(len(d.search.day.runs)), key=lambda k: runs[d.search.day.runs[k].name])


def asked(d: DayDiagnosis, limits: list[LimitRow]) -> list[str]:
    """Effects that another drive should show: those still in doubt, or those that these logs cannot name."""
    if d.answer.verdict == "none":
        return [row.name for row in limits if not row.named or row.share > 1.0]
    rivals = [name for names in d.answer.ambiguity for name in names.split("+") if name in CATALOGUE]
    nearest = d.answer.details.get("nearest") or {}
    near = d.ranked.leading.names if d.answer.verdict == UNKNOWN and (nearest.get("removes") or 0.0) > 0.0 else ()
    return list(dict.fromkeys([*rivals, *near])) if len(d.answer.ambiguity) > 1 or near else []


def pictures(d: DayDiagnosis) -> dict[str, Markup]:
    """What shows the gap; nothing where there is none, and no corrected car where no cause is named."""
    if d.answer.verdict == "none":
        return {}
    day, normal = d.search.day, d.search.normal
    cars = {"calibrated": day.errors}
    if d.answer.verdict == "effect":
        cars["corrected"] = day.errors_with(d.ranked.leading.effects(day))
    worst, onset = worst_run(d), d.answer.where["onset"]
    return {
        "overlay": figures.overlay(day, normal, worst, cars, onset),
        "by_horizon": figures.by_horizon(day, normal, cars),
        "time_line": figures.time_line(day, normal, cars, onset),
    }


def report_html(d: DayDiagnosis, source: Source | None = None) -> str:
    """The report's HTML; nothing is loaded from elsewhere."""
    answer, search, source = d.answer, d.search, source or Source()
    limits = limit_rows(answer.details["detection"], search.vehicle)
    coverage, beyond = coverage_rows(d)
    return page_html(
        TEMPLATE,
        tuple(word for word in GLOSSARY if word not in OF_THE_FILTER),
        answer=answer,
        sentence=answer.sentence(),
        catalogue=CATALOGUE,
        source=source,
        vehicle=search.vehicle,
        runs=[(run.name, len(run.y) * run.period, len(run.starts)) for run in search.day.runs],
        worst=search.day.runs[worst_run(d)].name,
        probabilities=[(name.replace("+", " + "), p) for name, p in list(answer.posterior.items())[:MOST_SHOWN]],
        at_least=answer.details["at_least"],
        brought_along=answer.details["with"],
        ahead=search.day.ahead[-1],
        pictures=pictures(d),
        limits=limits,
        reach=REACH,
        coverage=coverage,
        beyond=beyond,
        drives=shown_by(asked(d, limits)),
    )
