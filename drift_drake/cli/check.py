"""`drift-drake check`: an assessment of logs before anything is fitted to them."""

import dataclasses
import textwrap
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import tyro

from drift_drake.car.car_file import read_car
from drift_drake.car.effects.catalogue import CATALOGUE, LIMITS, shown_by
from drift_drake.car.log.table import run_paths
from drift_drake.common.errors import InvalidOptionError, significant
from drift_drake.common.interruption import ended_at_once
from drift_drake.common.plain_files import check_file
from drift_drake.common.safe_files import try_outputs, write_text
from drift_drake.common.standard_output import command_line, said_to, write_results

if TYPE_CHECKING:
    from drift_drake.gap.diagnosis.check.check import Checked


@dataclasses.dataclass(frozen=True)
class Check:
    """Assess logs before anything is fitted to them: quality, coverage, which effects they could show.

    drift-drake check logs/monday --vehicle car.yaml

    drift-drake check logs/monday --vehicle start.yaml --for-calibration

    drift-drake check logs/tuesday --vehicle car.yaml --calibration car.json

    Without a vehicle file: rates, columns, noise, bad samples, how hard the car was driven, and where columns that say
    the same disagree: by how much, and what would fix it. With one: the steering ratio and the torque too, which parts
    can be used, the operating regions, and for each effect of the
    catalogue the least magnitude that these logs would show; with the calibration, relative to its baseline.
    With --for-calibration: whether the logs are good enough for `drift-drake identify`, and which drive is missing.
    """

    logs: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="LOGS")]
    """Folder of runs (run_0.csv, run_1.csv, ...) of one car, or one run's file."""
    vehicle: Path | None = None
    """Vehicle file or simulator file of the simulator (YAML)."""
    calibration: Path | None = None
    """What `drift-drake identify --json` wrote of this car."""
    for_calibration: bool = False
    """Say whether a car can be calibrated on these logs, given its first guess: what would stay unknown, which drive is
    missing, and what more recordings would bring."""
    json: Path | None = None
    """Where to write all of it as JSON (-: standard output)."""
    report: Path | None = None
    """Where to write an HTML report: what is used, how it was driven, what it would show."""
    workers: int = 2
    """Threads."""


def run_check(command: Check) -> None:
    if command.calibration is not None:
        check_file(command.calibration, InvalidOptionError, "write it with 'drift-drake identify --json'")
    if command.vehicle is not None:
        read_car(command.vehicle)
    inputs = [path for path in (command.vehicle, command.calibration, *run_paths(command.logs)) if path is not None]
    try_outputs({"--json": command.json, "--report": command.report}, inputs)
    with ended_at_once():
        from drift_drake.gap.diagnosis.check.check import check

    checked = check(
        command.logs, command.vehicle, command.calibration, for_calibration=command.for_calibration,
        workers=command.workers,
    )  # fmt: skip
    print("\n".join(sentences(checked)), file=said_to(command.json))
    write_results(command.json, checked)
    if command.report is not None:
        from drift_drake.car.log.cases import logs_given
        from drift_drake.gap.diagnosis.check.check_report import report_html
        from drift_drake.view.pages.page import Source

        car = None if command.vehicle is None else read_car(command.vehicle)[0]
        source = Source(command_line("check", command, "logs"), command.logs, command.vehicle, command.calibration)
        write_text(command.report, report_html(checked, logs_given(command.logs).runs, car, source))


def sentences(checked: "Checked") -> list[str]:
    """What is said of it, a line each."""
    from drift_drake.gap.logs.screening.screened import REACHED_UNITS

    total = sum(run.seconds for run in checked.runs)
    lines = [f"{checked.case}: {len(checked.runs)} run{'s' if len(checked.runs) > 1 else ''}, {total:.1f} s"]
    for run in checked.runs:
        far = ", ".join(f"{name} {value:.3g} {REACHED_UNITS[name]}" for name, value in run.reached.items())
        lines.append(f"  {run.name}: {run.seconds:.1f} s at {run.rate:.4g} Hz; up to {far}")
    levels: dict[str, list[float]] = {}
    for run in checked.runs:
        for name, level in run.noise.items():
            levels.setdefault(name, []).append(level)
    lines.append("noise (SI): " + ", ".join(f"{name} {np.median(level):.2g}" for name, level in levels.items()))
    missing = sorted({name for run in checked.runs for name in run.missing})
    lines.append(f"columns missing: {', '.join(missing)}" if missing else "columns: all of the log format")
    lines += [f"! {remark}" for remark in checked.remarks] or ["bad samples: none"]
    if checked.unchecked or checked.undecided:
        lines.append(f"not checked, since no other column can: {', '.join([*checked.unchecked, *checked.undecided])}")
    if checked.regions:
        driven = sorted(checked.regions.items(), key=lambda item: -item[1])
        lines += ["driven:", *(f"  {seconds:5.1f} s  {name}" for name, seconds in driven)]
    if checked.for_calibration is not None:
        from drift_drake.gap.diagnosis.check.with_vehicle import said

        lines += said(checked.for_calibration)
    return lines + could_show(checked.detection)


def could_show(detection: dict[str, dict[str, Any]]) -> list[str]:
    """What the logs would show, what they could not, and what to drive for that."""
    if not detection:
        return []
    shown = {name: limit for name, limit in detection.items() if limit["least"] is not None}
    blind = [name for name in detection if name not in shown]
    parts = [f"{name} {significant(limit['least'], 2)}{CATALOGUE[name].suffix}" for name, limit in shown.items()]
    lines = ["would be named, from this magnitude on (95 %, to first order):", *_wrapped(parts or ["nothing"])]
    if blind:
        taken = {
            name: f"taken for {detection[name]['taken_for']}".replace("taken for none", "unseen") for name in blind
        }
        others = [f"{name} ({why})" for name, why in taken.items()]
        lines += ["could not be named, however large within their practical ranges:", *_wrapped(others)]
        lines += [f"  to see {', '.join(names)}: {words}" for words, names in shown_by(blind)]
    lines += [
        f"not judged here: {name}, an upper limit, which acts more the smaller it is"
        for name in sorted(LIMITS - set(detection))
    ]
    return lines


def _wrapped(parts: list[str]) -> list[str]:
    text = ", ".join(part.replace(" ", "\u00a0") for part in parts)  # no break within one
    return [
        line.replace("\u00a0", " ") for line in textwrap.wrap(text, 100, initial_indent="  ", subsequent_indent="  ")
    ]
