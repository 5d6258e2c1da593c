"""`drift-drake diagnose`: logs and the vehicle file of their simulator to where it is wrong, and why."""

import dataclasses
import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TextIO

import tyro

from drift_drake.car.car_file import read_car
from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.car.log.cases import case_folders, case_name
from drift_drake.car.log.table import InvalidLogError, run_paths
from drift_drake.car.parameters import CarParameters, InvalidVehicleError
from drift_drake.common import safe_files
from drift_drake.common.errors import DriftDrakeError, InvalidOptionError, meant
from drift_drake.common.executors import ExecutorConfig
from drift_drake.common.interruption import ended_at_once
from drift_drake.common.run_folder import write_results_table
from drift_drake.common.standard_output import (
    STANDARD_OUTPUT,
    command_line,
    progress_bar,
    said_to,
    write_results,
    write_text,
)
from drift_drake.gap.diagnosis.answers.answer import Answer, answer_row
from drift_drake.gap.diagnosis.answers.provenance import all_answered
from drift_drake.gap.diagnosis.options import check_options, check_trust
from drift_drake.gap.estimation.usable import MOST_SECONDS

if TYPE_CHECKING:
    from drift_drake.gap.diagnosis.calibrated.diagnose_change import ChangeDiagnosis
    from drift_drake.gap.diagnosis.likelihood.diagnose import Diagnosis

GAP_FOUND = 3  # exit code, where it is asked for


@dataclasses.dataclass(frozen=True)
class Diagnose:
    """Find where a simulator is wrong, which effect is missing from it, and how far adding it reduces the gap.

    drift-drake diagnose logs/monday --vehicle car.yaml --json answer.json --report answer.html

    CASE is a folder of runs (run_0.csv, run_1.csv, ...) of one car, or a folder of such folders.
    """

    case: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="CASE")]
    """Folder of runs, or of cases; or one run's file."""
    vehicle: Path
    """Vehicle file or simulator file of the simulator (YAML)."""
    json: Path | None = None
    """Where to write the answer as JSON (-: standard output); for a folder of cases, a folder that gets NAME.json each
    and a table of all, results.parquet or results.csv (-: a list of all)."""
    report: Path | None = None
    """Where to write an HTML report of one case."""
    process_scale: float = 1.0
    """Factor on the process noise: above one for a real car, as `drift-drake identify` found it."""
    noise_scale: float = 1.0
    """Factor on the sensors' noise: above one where it is not white, as `drift-drake identify` found it."""
    tempering: float = 1.0
    """Likelihood tempering exponent, in (0, 1]: below one for a real car, as `drift-drake identify` found it. A model
    discrepancy as large as on the day of calibration is then no gap."""
    calibration: Path | None = None
    """Calibration of this car, as `drift-drake identify --json` wrote it, in place of the three options above. Forces
    of the model discrepancy are subtracted too."""
    false_alarms: float | None = None
    """False-alarm rate, with a --calibration by prediction: the share of days without a change that may be reported as
    a gap; 0.05 if it is not given."""
    effects: tuple[str, ...] = tuple(CATALOGUE)
    """Effects to consider."""
    exclude: tuple[str, ...] = ()
    """Effects not to consider."""
    without: tuple[str, ...] = ()
    """Columns of the logs to leave out."""
    every: int = 1
    """Take every n-th row of the logs: 2 reads a log of 100 Hz at 50 Hz."""
    most_seconds: float = MOST_SECONDS
    """Seconds of logs that are used at most: of longer logs evenly spread pieces, with a warning. Each second takes
    1 MB of memory and half a second of time. A --calibration by prediction has a limit of its own."""
    workers: int = 2
    """Threads for one case; processes for a folder of cases."""
    scheduler: str | None = None
    """Address of a Dask scheduler (tcp://HOST:8786) whose workers answer a folder of cases and see the same logs."""
    again: bool = False
    """Diagnose all cases of a folder again, also those whose answers, from the same logs and files, --json holds."""
    exit_code: bool = False
    """End with exit code 3 where there is a gap (a named effect, or unknown), with 0 where there is none."""
    quiet: bool = False
    """No progress bar."""


def run_diagnose(command: Diagnose) -> int:
    """`drift-drake diagnose`; returns its exit code."""
    vehicle, own = read_car(command.vehicle)
    effects = chosen_effects(command)
    check_options(effects, command.without, command.every, command.most_seconds, command.workers)
    trusting = (
        command.calibration, command.process_scale, command.noise_scale, command.tempering, command.false_alarms
    )  # fmt: skip
    check_trust(*trusting)
    folders = case_folders(command.case)
    with ended_at_once():
        from drift_drake.gap.diagnosis.diagnose import trust_options
    options: dict[str, Any] = {
        "own": own, "catalogue": effects, "without": tuple(command.without), "every": command.every,
        "most_seconds": command.most_seconds, **trust_options(*trusting, effects),
    }  # fmt: skip
    if folders != [command.case]:
        answers = _diagnose_many(command, vehicle, folders, options)
    else:
        answers = [_diagnose_one(command, vehicle, options)]
    return GAP_FOUND if command.exit_code and any(answer.verdict != "none" for answer in answers) else 0


def chosen_effects(command: Diagnose) -> tuple[str, ...]:
    """Effects to consider.

    Raises:
        InvalidVehicleError: a name that the catalogue does not have, or none is left.
    """
    for name in (*command.effects, *command.exclude):
        if name not in CATALOGUE:
            raise InvalidVehicleError(f"unknown effect {name}; {meant(name, CATALOGUE)}")
    chosen = tuple(name for name in command.effects if name not in command.exclude)
    if not chosen:
        raise InvalidVehicleError("--exclude leaves no effect to consider; exclude fewer")
    return chosen


def _diagnose_one(command: Diagnose, vehicle: CarParameters, options: Mapping[str, Any]) -> Answer:
    inputs = [command.vehicle, *([command.calibration] if command.calibration else []), *run_paths(command.case)]
    safe_files.try_outputs({"--json": command.json, "--report": command.report}, inputs)
    with ended_at_once():
        from drift_drake.gap.diagnosis.diagnose import answer_folder
    with progress_bar(command.quiet) as show:
        diagnosis = answer_folder(command.case, vehicle, command.workers, progress=show, **options)
    _say(diagnosis.answer, to=said_to(command.json))
    if command.json is not None:
        write_text(command.json, diagnosis.answer.to_json())
    if command.report is not None:
        _report(command, diagnosis, command.report)
    return diagnosis.answer


def _report(command: Diagnose, diagnosis: "Diagnosis | ChangeDiagnosis", path: Path) -> None:
    from drift_drake.gap.diagnosis.calibrated.diagnose_change import ChangeDiagnosis
    from drift_drake.gap.diagnosis.reports import change_report, report
    from drift_drake.view.pages.page import Source

    said = command_line("diagnose", command, "case")
    answer = None if command.json == STANDARD_OUTPUT else command.json
    source = Source(said, command.case, command.vehicle, command.calibration, answer)
    if isinstance(diagnosis, ChangeDiagnosis):
        safe_files.write_text(path, change_report.report_html(diagnosis, source))
    else:
        safe_files.write_text(path, report.report_html(diagnosis, source))


def _diagnose_many(
    command: Diagnose, vehicle: CarParameters, folders: Sequence[Path], options: Mapping[str, Any]
) -> list[Answer]:
    """A folder of cases; those that `--json` holds the answers to already are left as they are."""
    count, before = len(folders), dict[Path, Answer]()
    if command.report is not None:
        raise InvalidOptionError(f"--report is for one case; give one of the {count} folders in {command.case}")
    into = None if command.json == STANDARD_OUTPUT else command.json
    if into is not None:
        safe_files.try_folder(into, "--json")
        names = {folder: into / f"{case_name(folder)}.json" for folder in folders}
        before = all_answered(names, vehicle, options)
    if command.again:
        before = {}
    if before:
        print(f"{len(before)} of {count} cases are answered in {into}; --again redoes them", file=sys.stderr)
    with ended_at_once():
        from drift_drake.gap.diagnosis.diagnose import diagnose_all
    only = [folder for folder in folders if folder not in before]
    run_on = ExecutorConfig("processes" if command.scheduler is None else "dask", command.workers, command.scheduler)

    def done(answer: Answer) -> None:
        if into is not None:
            answer.write(into / f"{answer.case}.json")

    refused: list[DriftDrakeError] = []
    answers = diagnose_all(
        command.case, vehicle, run_on, progress=done, refused=refused.append, only=only, quiet=command.quiet, **options
    )
    answers = [*before.values(), *answers]
    for answer in answers:
        _say(answer, to=said_to(command.json))
    if command.json == STANDARD_OUTPUT:
        write_results(command.json, [json.loads(answer.to_json()) for answer in answers])
    if into is not None and answers:
        write_results_table(into, [answer_row(answer) for answer in sorted(answers, key=lambda answer: answer.case)])
    if refused:
        raise InvalidLogError(f"{len(refused)} of {count} cases cannot be used: " + "; ".join(map(str, refused)))
    return answers


def _say(answer: Answer, to: TextIO | None = None) -> None:
    print(answer.sentence(), file=to)
    for warning in answer.warnings:
        print(f"  warning: {warning}", file=to)
