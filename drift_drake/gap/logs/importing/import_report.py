"""The report of an import: one self-contained HTML file."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from markupsafe import Markup

from drift_drake.car.log.driving import UsedStretch
from drift_drake.car.log.table import UNITS, Run
from drift_drake.gap.logs.importing.import_logs import Imported
from drift_drake.gap.logs.importing.importer import PERIOD, RunReport
from drift_drake.gap.logs.screening.overlays import overlays, panels_of
from drift_drake.view.colours import RUNS
from drift_drake.view.pages.charts import LOW, Line, Panel, placed, stacked
from drift_drake.view.pages.driving import Driven, accelerations, driven, steering
from drift_drake.view.pages.page import Source, page_html

TEMPLATE = Path(__file__).parent / "import_report.html"
WORDS = ("sideslip (beta)", "yaw rate (r)", "omega_r")
SIGNALS = ("r", "v", "beta", "omega_r", "ax", "ay", "delta_cmd", "tau_cmd")
MOST_DRAWN = 8  # runs
LEAST_GAP = 2.0 * PERIOD  # [s] between runs


def report_html(found: Imported, case: str, source: Source | None = None) -> str:
    """The report's HTML; nothing is loaded from elsewhere. case: what it is called."""
    report, how = found.report, [driven(run, name=f"run_{k}") for k, run in enumerate(found.runs)]
    remarks = dict[str, list[str]]()
    for remark in report.remarks:
        name, sentence = remark.split(": ", 1)
        remarks.setdefault(sentence, []).append(name)
    columns = [{name: run.column(name) for name in UNITS if run.column(name) is not None} for run in found.runs]
    compared = overlays(columns, PERIOD)
    return page_html(
        TEMPLATE,
        WORDS,
        case=case,
        source=source or Source(),
        report=report,
        remarks=remarks,
        recordings=by_recording(report.runs),
        clocks=[(one, name, clock) for one, several in report.clocks.items() for name, clock in several.items()],
        compared=compared,
        overlays=placed(stacked(panels_of(compared))) if compared else "",
        accelerations=placed(accelerations(how)),
        steering=placed(steering(how)),
        signals=[(f"run_{k}", signals(run)) for k, run in enumerate(found.runs[:MOST_DRAWN])],
        more=max(len(found.runs) - MOST_DRAWN, 0),
    )


def signals(run: Run) -> Markup:
    """All columns of a run over time."""
    known = [(name, values) for name in SIGNALS if (values := run.column(name)) is not None]
    return placed(stacked([Panel(f"{name} [{UNITS[name]}]", [Line("", run.t, values, RUNS[0])], LOW)
                           for name, values in known]))  # fmt: skip


def by_recording(runs: Sequence[RunReport]) -> list[Driven]:
    """A line a recording, with its runs and what lies before and between them."""
    nothing = np.empty(0)
    found = []
    for name in dict.fromkeys(run.recording for run in runs):
        parts, at = list[UsedStretch](), 0.0
        for run in sorted((run for run in runs if run.recording == name), key=lambda run: run.start):
            if run.start - at > LEAST_GAP:
                parts.append(UsedStretch(at, run.start, "no driving, or no readings"))
            parts.append(UsedStretch(run.start, run.end, ""))
            at = run.end
        found.append(Driven(name, 0.0, at, parts, (nothing, nothing), (nothing, nothing)))
    return found
