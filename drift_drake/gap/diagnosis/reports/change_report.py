"""The report of a change from a calibrated baseline: one self-contained HTML file."""

import dataclasses
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from markupsafe import Markup

from drift_drake.car.effects.catalogue import CATALOGUE, shown_by
from drift_drake.car.log.table import UNITS
from drift_drake.gap.diagnosis.answers.rivals import in_words
from drift_drake.gap.diagnosis.calibrated.changed_car import squares
from drift_drake.gap.diagnosis.calibrated.diagnose_change import ChangeDiagnosis
from drift_drake.gap.diagnosis.reports.report import in_doubt
from drift_drake.gap.diagnosis.reports.trials import EMPTY, trials
from drift_drake.gap.estimation.driven import all_driven
from drift_drake.gap.estimation.normal import LOST, Normal
from drift_drake.gap.estimation.prior import REACH
from drift_drake.gap.estimation.reduction import STATES
from drift_drake.gap.estimation.robust_fit import MAD
from drift_drake.gap.estimation.scores import Day
from drift_drake.gap.estimation.windows import HORIZONS, WindowedRun, regimes
from drift_drake.gap.evidence.limit_rows import limit_rows
from drift_drake.gap.evidence.posterior import UNKNOWN
from drift_drake.view.pages.charts import LOW, NORMAL, Line, Panel, placed, reach_of, side_by_side, stacked
from drift_drake.view.pages.driving import driving
from drift_drake.view.pages.page import GLOSSARY, Source, page_html

TEMPLATE = Path(__file__).parent / "change_report.html"
REGIMES = (("speed", "m/s"), ("yaw rate times speed", "m/s²"), ("sideslip", "rad"), ("rim slip", "-"))
MOST_SHOWN = 8  # hypotheses
OF_THE_FILTER = ("nominal car", "innovation", "nat", "rear slip", "free-form forces")  # words that this report has not

Cars = Mapping[str, np.ndarray]  # errors [windows, HORIZONS, channels] by the name of the car


@dataclasses.dataclass(frozen=True)
class CoverageRow:
    """How far the day was driven in one regime, relative to the baseline."""

    name: str
    unit: str
    covered: float
    driven: float
    beyond: float  # share of windows


def coverage_rows(d: ChangeDiagnosis) -> tuple[list[CoverageRow], float]:
    """By regime how far the day goes beyond what calibration drove, and the share of windows that do in any."""
    hard = np.concatenate([regimes(run) for run in d.search.day.runs])
    covered = d.search.normal.covered
    beyond = hard > covered
    rows = [
        CoverageRow(name, unit, float(covered[i]), float(np.max(hard[:, i])), float(np.mean(beyond[:, i])))
        for i, (name, unit) in enumerate(REGIMES)
    ]
    return rows, float(np.mean(np.any(beyond, axis=1)))


def worst_run(d: ChangeDiagnosis) -> int:
    """Index of the run that holds the largest share of the gap."""
    runs = d.answer.where["runs"]
    return max(range(len(d.search.day.runs)), key=lambda k: runs[d.search.day.runs[k].name])


def nearest_names(d: ChangeDiagnosis) -> tuple[str, ...]:
    """Effects of the nearest hypothesis to an unknown gap, if it removes some of it."""
    nearest = d.answer.details.get("nearest") or {}
    return d.ranked.leading.names if d.answer.verdict == UNKNOWN and (nearest.get("removes") or 0.0) > 0.0 else ()


def ends(run: WindowedRun) -> np.ndarray:
    """Rows [windows] that are predicted, at the longest horizon."""
    return np.asarray(run.starts + HORIZONS * run.stride_rows)


def judged_states(day: Day) -> list[tuple[int, str]]:
    """Indices and names of the states that every run measures and the car itself predicts."""
    return [(i, state) for i, state in enumerate(STATES) if all(run.used[i] for run in day.runs)]


def overlay(
    day: Day, normal: Normal, index: int, cars: Cars, onset: Mapping[str, float], tried: bool = False
) -> Markup:
    """One run as measured and as predicted at the longest horizon, and below each state what is left over.

    tried: with lines for an effect that is tried (`trials`).
    """
    run = day.runs[index]
    t, at = np.arange(len(run.y)) * run.period, ends(run)
    panels = []
    for i, state in judged_states(day):
        left = {name: errors[day.run == index][:, -1, i] for name, errors in cars.items()}
        predicted = [Line(name, at * run.period, run.y[at, i] - e, dots=True) for name, e in left.items()]
        measured = Line("measured", t, run.y[:, i])
        reach = reach_of(run.y[:, i], [line.y for line in predicted])
        panels.append(Panel(f"{state} [{UNITS[state]}]", [measured, *predicted], reach=reach))
        misses = [Line(name, at * run.period, e, dots=True) for name, e in left.items()]
        if tried:  # drawn by the page's script
            panels[-1] = dataclasses.replace(panels[-1], lines=[*panels[-1].lines, EMPTY])
            misses.append(EMPTY)
        title = f"measured less predicted [{UNITS[state]}]"
        panels.append(Panel(title, misses, LOW, normal=2.0 * float(normal.scales[-1, i])))
    return placed(stacked(panels, {"gap sets in": onset[run.name]} if run.name in onset else {}))


def by_horizon(day: Day, normal: Normal, cars: Cars) -> Markup:
    """Median absolute errors of each state against the horizon, with those of the baseline."""
    at, panels = np.array(day.runs[0].horizons), []
    for i, state in judged_states(day):
        usual = Line("day of calibration", at, normal.scales[:, i] / MAD, NORMAL)
        lines = [Line(name, at, np.median(np.abs(e[..., i]), axis=0), dots=True) for name, e in cars.items()]
        panels.append(Panel(f"{state} [{UNITS[state]}]", [usual, *lines], 140))
    return placed(side_by_side(panels, "ahead [s]"))


def time_line(day: Day, normal: Normal, cars: Cars, onset: Mapping[str, float]) -> Markup:
    """Errors at the longest horizon over time, run by run, in those of the day of calibration."""
    parts = {name: np.sqrt(squares(normal, errors, LOST)[:, -1].mean(axis=-1)) for name, errors in cars.items()}
    panels = []
    for k, run in enumerate(day.runs):
        t = run.starts * run.period
        lines = [Line("day of calibration", t[[0, -1]], np.ones(2), NORMAL)]
        lines += [Line(name, t, values[day.run == k]) for name, values in parts.items()]
        sets_in = f"; gap sets in at {onset[run.name]:.1f} s" if run.name in onset else ""
        panels.append(Panel(f"{run.name}: error, in normal ones{sets_in}", lines, 90, log=True))
    return placed(stacked(panels))


def pictures(d: ChangeDiagnosis) -> dict[str, Markup]:
    """What shows the gap, where there is one; no corrected car where no cause is named."""
    day, normal = d.search.day, d.search.normal
    cars = {"calibrated": day.errors}
    if d.answer.verdict == "effect":
        cars["corrected"] = day.errors_with(d.ranked.leading.effects(day))
    worst, onset = worst_run(d), d.answer.where["onset"]
    data = trials(d, worst, judged_states(day))
    chart = {"overlay": overlay(day, normal, worst, cars, onset, bool(data)), "trials": data}
    if d.answer.verdict == "none":
        return chart
    return chart | {
        "by_horizon": by_horizon(day, normal, cars),
        "time_line": time_line(day, normal, cars, onset),
    }


def report_html(d: ChangeDiagnosis, source: Source | None = None) -> str:
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
        probabilities=[(in_words(name), p) for name, p in list(answer.posterior.items())[:MOST_SHOWN]],
        at_least=answer.details["at_least"],
        brought_along=answer.details["with"],
        ahead=search.day.ahead[-1],
        pictures=pictures(d),
        limits=limits,
        how=driving(all_driven(d.runs, search.vehicle)) if d.runs else None,
        reach=REACH,
        coverage=coverage,
        beyond=beyond,
        drives=shown_by(in_doubt(answer, limits, nearest_names(d))),
    )
