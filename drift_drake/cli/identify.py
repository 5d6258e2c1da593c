"""`drift-drake identify`: a car's logs and a first guess of it to a calibrated vehicle file."""

import dataclasses
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from drift_drake.car.car_file import read_car
from drift_drake.car.log.table import case_paths
from drift_drake.car.vehicle_file import write_vehicle
from drift_drake.common.errors import significant, unit_suffix
from drift_drake.common.interruption import ended_at_once
from drift_drake.common.safe_files import try_outputs, write_text
from drift_drake.common.standard_output import STANDARD_OUTPUT, command_line, progress_bar, said_to, write_results
from drift_drake.gap.identification.options import EFFECTS, KNOWN, AskedKind, Criterion

if TYPE_CHECKING:
    from drift_drake.gap.identification.calibration import Identification, Parameter


@dataclasses.dataclass(frozen=True)
class Identify:
    """Calibrate a vehicle file on logs: parameters, tolerances, lags, and what the logs cannot identify.

    drift-drake identify logs/monday logs/tuesday --vehicle start.yaml --out car.yaml --json car.json --report car.html

    Calibrate a simulator before its gap is diagnosed (`drift-drake diagnose`). LOGS are folders of runs
    (run_0.csv, run_1.csv, ...) of one car, one for each day. A parameter's prior is as wide as two tolerances that the
    vehicle file states for it; parameters without one get broad priors.
    """

    logs: Annotated[tyro.conf.Positional[tuple[Path, ...]], tyro.conf.arg(metavar="LOGS")]
    """Folders of runs, one for each day."""
    vehicle: Path
    """First guess of the car (YAML)."""
    out: Path | None = None
    """Where to write the calibrated vehicle file."""
    json: Path | None = None
    """Where to write estimates, intervals and correlations as JSON (-: standard output)."""
    report: Path | None = None
    """Where to write an HTML report."""
    known: tuple[str, ...] = KNOWN
    """Parameters whose tolerance in the vehicle file is trusted; with the likelihood, the others get broad priors."""
    effects: tuple[str, ...] = EFFECTS
    """Effects that may belong to the car, in addition to those in the vehicle file."""
    criterion: Criterion = "auto"
    """Criterion of the fit: the filter's likelihood, exact where innovations are white, or prediction errors half a
    second ahead; auto chooses by the logs, and says which."""
    car: AskedKind = "auto"
    """Kind of car, with the criterion prediction: auto fits both kinds, takes the double-track car where it predicts
    held-out parts better, and says which; a car of another kind in the vehicle file is calibrated as it is."""
    validation: tuple[str, ...] = ()
    """Runs that nothing is fitted to, and that the car is judged by: NAME, or NAME:START-END [s] for a part of one
    (DAY/NAME where several folders are given). Without it, every fourth 1.5 s of all runs is held out for that."""
    force: bool = False
    """Calibrate and write the files even if the logs are too gentle, a known parameter's estimate is far from its
    prior, or held-out parts are predicted worse than by the first guess."""
    quiet: bool = False
    """No progress bar."""


def run_identify(command: Identify) -> None:
    read_car(command.vehicle)  # what is wrong with it is said before outputs are tried
    outputs = {"--out": command.out, "--json": command.json, "--report": command.report}
    logs = [path for folder in command.logs for path in case_paths(folder)]
    try_outputs(outputs, [command.vehicle, *logs])
    with ended_at_once():
        from drift_drake.gap.identification.identify import identify
    with progress_bar(command.quiet) as show:
        found = identify(
            command.logs, command.vehicle, known=command.known, effects=command.effects, criterion=command.criterion,
            car=command.car, force=command.force, watching=command.json is not None,
            validation=command.validation, progress=show,
        )  # fmt: skip
    print(summary(found, command.json), file=said_to(command.json))
    if found.calibration.held_out.ratio > 1.0 and not command.force:
        print("nothing is written; --force writes the files nevertheless", file=sys.stderr)
        return
    if command.out is not None:
        write_vehicle(command.out, found.vehicle, found.effects, found.single_track)
    if command.json is not None:
        write_results(command.json, found.calibration)
    if command.report is not None:
        from drift_drake.gap.identification.report import report_html  # plotly is slow to import
        from drift_drake.view.pages.page import Source

        said = command_line("identify", command, "logs")
        calibration = None if command.json == STANDARD_OUTPUT else command.json
        vehicle_file = command.out or command.vehicle
        folder = command.logs[0] if len(command.logs) == 1 else None  # of several, the command says which
        write_text(command.report, report_html(found, Source(said, folder, vehicle_file, calibration)))


def summary(found: "Identification", json: Path | None = None) -> str:
    """The calibration in sentences; `json` is where it goes."""
    from drift_drake.gap.identification.calibration import grouped
    from drift_drake.gap.identification.outlook import sentences as outlook_sentences

    c = found.calibration
    lines = [c.sentence()]
    for name, p in c.parameters.items():
        lines.append(f"  {name:<30}{row(p, name in c.disagreed)}")
    if c.left_out:
        lines.append(f"Not significant, and left out of the vehicle file: {', '.join(c.left_out)}.")
    lines += [f"Not identified: {sentence}." for sentence in grouped(c.not_identified, c.disagreed)]
    lines += [f"Identified only together: {a} and {b} (correlation {q:+.3f})." for a, b, q in c.tied]
    where = json if json not in (None, STANDARD_OUTPUT) else "CAR.json"
    if c.driving is not None:
        lines += [f"{sentence}." for sentence in outlook_sentences(c.outlook, c.driving.recordings)]
        lines += [f"Not shown well: {one.sentence()}." for one in c.driving.missing() if not one.grave]
    if c.normal is not None:
        lines.append(f"For 'drift-drake diagnose' of later logs of this car: --calibration {where}")
        return "\n".join([*lines, *(f"  warning: {warning}" for warning in c.warnings)])
    scales = f"--noise-scale {c.trust.noise:.2g} --process-scale {c.trust.process:.2g} --tempering {c.tempering:.2g}"
    lines.append(f"For 'drift-drake diagnose' on this car: {scales}")
    if c.discrepancy is not None:
        lines.append(f"or, with its model discrepancy and a tempering exponent of {c.discrepancy.tempering:.2g}: "
                     f"--calibration {where}")  # fmt: skip
    return "\n".join([*lines, *(f"  warning: {warning}" for warning in c.warnings)])


def row(p: "Parameter", disagreed: bool = False) -> str:
    """Estimate, interval and first guess of one parameter; disagreed: the recordings ask for different values."""
    unit = unit_suffix(p.unit)
    note = {"known": ", held by its tolerance", "unseen": ", kept: not shown by these drives"}.get(p.kind, "")
    note += "; recordings disagree" if disagreed else ""
    estimate, low, high, start = (significant(value, 4) for value in (p.estimate, p.low, p.high, p.start))
    return f"{estimate}{unit} (95 %: {low} to {high}; first guess {start}{note})"
