"""The report of another day: one self-contained HTML file."""

import dataclasses
import platform
import shlex
from importlib.metadata import version
from pathlib import Path

import jinja2
import numpy as np
from markupsafe import Markup

from drift_drake.diagnosis import day_report_figures as figures
from drift_drake.diagnosis.another_day import DayDiagnosis
from drift_drake.diagnosis.day_hypotheses import REACH
from drift_drake.diagnosis.detection_limits import RATE_LIMIT
from drift_drake.diagnosis.manoeuvres import shown_by
from drift_drake.diagnosis.posterior import UNKNOWN
from drift_drake.estimation.windows import HORIZONS, STRIDE, regimes
from drift_drake.safe_files import write_text
from drift_drake.vehicle.catalogue import CATALOGUE
from drift_drake.vehicle.parameters import VehicleParameters

TEMPLATE = Path(__file__).parent / "day_report.html"
PACKAGES = ("drift_drake", "numpy", "scipy", "numba")
REGIMES = (("speed", "m/s"), ("yaw rate times speed", "m/s²"), ("sideslip", "rad"), ("rim slip", "-"))
MOST_SHOWN = 8  # hypotheses


@dataclasses.dataclass(frozen=True)
class Source:
    """Where a diagnosis came from, as far as it is known."""

    command: str = ""
    case: Path | None = None  # folder of the logs
    vehicle: Path | None = None
    calibration: Path | None = None
    answer: Path | None = None

    def next_command(self) -> str:
        """What writes the corrected vehicle."""
        answer, vehicle = str(self.answer or "ANSWER.json"), str(self.vehicle or "CAR.yaml")
        return shlex.join(["drift-drake", "apply", answer, "--vehicle", vehicle, "--out", "corrected.yaml"])


@dataclasses.dataclass(frozen=True)
class LimitRow:
    """One bar of the detection limits."""

    name: str
    named: bool  # some magnitude within reach would be
    share: float  # of the end of the practical range; of the reach where none would be
    least: str
    taken_for: str


@dataclasses.dataclass(frozen=True)
class CoverageRow:
    """How far the day was driven in one regime, beside the day of calibration."""

    name: str
    unit: str
    covered: float
    driven: float
    beyond: float  # share of windows


def limit_rows(limits: dict[str, dict[str, object]], vehicle: VehicleParameters) -> list[LimitRow]:
    """Detection limits (`Answer.details["detection"]`) as bars, the smallest first; what cannot be named comes last."""
    rows = []
    for name, limit in limits.items():
        info, least = CATALOGUE[name], limit["least"]
        taken_for, unit = str(limit["taken_for"]), "" if info.unit == "-" else f" {info.unit}"
        if not isinstance(least, float):
            rows.append(LimitRow(name, False, REACH, "", taken_for))
            continue
        low, high = info.range_for(vehicle)
        # A rate limit acts the more the lower it is.
        share = low / least if name == RATE_LIMIT else least / max(abs(low), abs(high))
        text = f"{'up to ' if name == RATE_LIMIT else '±' if info.signed else ''}{least:.2g}{unit}"
        rows.append(LimitRow(name, True, share, text, taken_for))
    return sorted(rows, key=lambda row: (not row.named, row.share))


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
    near = d.ranked.leading.names if d.answer.verdict == UNKNOWN else ()
    return list(dict.fromkeys([*rivals, *near])) if len(d.answer.ambiguity) > 1 or near else []


def pictures(d: DayDiagnosis) -> dict[str, Markup]:
    """What shows the gap; nothing where there is none, and no corrected car where no cause is named."""
    if d.answer.verdict == "none":
        return {}
    day, normal = d.search.day, d.search.normal
    corrected = day.errors_with(d.ranked.leading.effects(day)) if d.answer.verdict == "effect" else None
    lines = figures.lines_of(day.errors, corrected)
    return {
        "overlay": Markup(figures.overlay(day, worst_run(d), lines)),
        "misses": Markup(figures.misses(day, normal, worst_run(d), lines)),
        "by_horizon": Markup(figures.by_horizon(normal, lines)),
        "time_line": Markup(figures.time_line(day, normal, lines, d.answer.where["onset"])),
    }


def report_html(d: DayDiagnosis, source: Source | None = None) -> str:
    """The report's HTML; pictures are inline SVG, nothing is loaded from elsewhere."""
    answer, search, source = d.answer, d.search, source or Source()
    limits = limit_rows(answer.details["detection"], search.vehicle)
    coverage, beyond = coverage_rows(d)
    environment = jinja2.Environment(autoescape=True, undefined=jinja2.StrictUndefined)
    return environment.from_string(TEMPLATE.read_text(encoding="utf-8")).render(
        answer=answer,
        sentence=answer.sentence(),
        catalogue=CATALOGUE,
        source=source,
        vehicle=search.vehicle,
        runs=[(run.name, len(run.y) * run.period, len(run.starts)) for run in search.day.runs],
        versions=[(name, version(name)) for name in PACKAGES] + [("Python", platform.python_version())],
        probabilities=[(name.replace("+", " + "), p) for name, p in list(answer.posterior.items())[:MOST_SHOWN]],
        at_least=answer.details["at_least"],
        brought_along=answer.details["with"],
        ahead=f"{HORIZONS * STRIDE:g} s",
        pictures=pictures(d),
        limits=limits,
        reach=REACH,
        coverage=coverage,
        beyond=beyond,
        drives=shown_by(asked(d, limits)),
    )


def write_day_report(diagnosis: DayDiagnosis, path: str | Path, source: Source | None = None) -> None:
    """Writes the report."""
    write_text(path, report_html(diagnosis, source))
