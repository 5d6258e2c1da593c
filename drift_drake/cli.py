"""The command line `drift-drake`: a car's logs in, what its simulator lacks out, and the corrected car driven again.

drift-drake COMMAND --help says what a command does and shows an example. Bad input ends with one sentence and exit
code 2.
"""

import dataclasses
import signal
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, TextIO

import tyro
from tqdm import tqdm

from drift_drake.command_line import command_line
from drift_drake.diagnosis.another_day import DayDiagnosis
from drift_drake.diagnosis.answer import Answer, read_answer
from drift_drake.diagnosis.correction import corrected_vehicle
from drift_drake.diagnosis.diagnose import answer_folder, case_folders, case_name, diagnose_all
from drift_drake.diagnosis.provenance import all_answered, check_diagnosed
from drift_drake.drives.command import Simulate, run_simulate
from drift_drake.errors import DriftDrakeError, InvalidOptionError, one_line
from drift_drake.identification.calibration_file import LARGEST_SCALE, CarTrust, InvalidCalibrationError, read_trust
from drift_drake.identification.command import Identify, run_identify
from drift_drake.interruption import ENDS, TerminatedError, terminable
from drift_drake.logs.importing.command import Import, run_import
from drift_drake.logs.table import OPTIONAL, InvalidLogError, run_paths
from drift_drake.model.command import Train, run_train
from drift_drake.playback.command import Replay, run_replay
from drift_drake.safe_files import try_folder, try_outputs
from drift_drake.standard_output import STANDARD_OUTPUT, said_to, write_text
from drift_drake.vehicle.catalogue import CATALOGUE
from drift_drake.vehicle.effects import Effects
from drift_drake.vehicle.parameters import InvalidVehicleError, VehicleParameters
from drift_drake.vehicle.plausible import check_effects, check_plausible
from drift_drake.vehicle.vehicle_file import read_vehicle, write_vehicle

BAD_INPUT = 2  # exit code for input that cannot be used


@dataclasses.dataclass(frozen=True)
class Diagnose:
    """Say where a simulator is wrong, which effect it lacks and how far the gap shrinks once it is added.

    drift-drake diagnose logs/monday --vehicle car.yaml --json answer.json --report answer.html

    CASE is a folder of runs (run_0.csv, run_1.csv, ...) of one car, or a folder of such folders.
    """

    case: tyro.conf.Positional[Path]
    """Folder of runs, or of cases."""
    vehicle: Path
    """What the simulator believes of the car (YAML)."""
    json: Path | None = None
    """Where to write the answer (-: standard output); for a folder of cases, a folder that gets NAME.json each."""
    report: Path | None = None
    """Where to write an HTML report of one case."""
    process_scale: float = 1.0
    """Factor on the process noise: above one for a real car, as `drift-drake identify` found it."""
    noise_scale: float = 1.0
    """Factor on the sensors' noise: above one where it is not white, as `drift-drake identify` found it."""
    row_weight: float = 1.0
    """What one row is worth, in (0, 1]: below one for a real car, as `drift-drake identify` found it. The misfit that
    the calibrated car had on the day it was calibrated is then no gap; only what goes beyond it is."""
    calibration: Path | None = None
    """In place of the three: what `drift-drake identify --json` wrote of this car. The forces of its everyday misfit
    are taken out too, so that a row is worth more."""
    effects: tuple[str, ...] = tuple(CATALOGUE)
    """Effects to consider."""
    exclude: tuple[str, ...] = ()
    """Effects to leave out of them."""
    without: tuple[str, ...] = ()
    """Columns of the logs to leave out."""
    every: int = 1
    """Rows of the logs that make one here: 2 reads a log of 100 Hz at 50 Hz."""
    workers: int = 2
    """Threads for one case; a folder of cases is spread over processes."""
    again: bool = False
    """Diagnose anew the cases of a folder that --json holds answers to, found from the same logs and files."""
    quiet: bool = False
    """No progress bar."""


@dataclasses.dataclass(frozen=True)
class PlanNext:
    """Plan the drive that tells best which of an answer's rival hypotheses is true, within a straight lane.

    drift-drake plan-next answer.json --vehicle car.yaml --out plan.csv
    """

    answer: tyro.conf.Positional[Path]
    """Answer of `drift-drake diagnose --json`."""
    vehicle: Path
    """The vehicle file that was diagnosed."""
    out: Path = Path("plan.csv")
    """Where to write the plan: commands at 100 Hz and the states that they are expected to lead to."""
    v_start: float = 7.5
    """Speed at the start [m/s]."""
    v_end: float = 20.0
    """Speed that the drive is led towards [m/s]."""
    half_width: float = 3.0
    """Of the lane [m]."""


@dataclasses.dataclass(frozen=True)
class Apply:
    """Write the corrected vehicle: an answer's effects, with magnitudes, added to a vehicle file.

    drift-drake apply answer.json --vehicle car.yaml --out corrected.yaml
    """

    answer: tyro.conf.Positional[Path]
    """Answer of `drift-drake diagnose --json`."""
    vehicle: Path
    """The vehicle file that was diagnosed."""
    out: Path
    """Where to write the corrected vehicle file."""
    tolerances: bool = True
    """Apply the deviations within tolerance that were found beside the effects, too."""
    force: bool = False
    """Apply to a vehicle file that is not the one that was diagnosed."""


def trust_in(command: Diagnose) -> CarTrust:
    """How far to trust sensors and model, from the calibration or the factors.

    Raises:
        InvalidCalibrationError: both are given, or a factor is out of range.
    """
    factors = CarTrust(command.noise_scale, command.process_scale, command.row_weight, None)
    if command.calibration is not None:
        if factors != CarTrust(1.0, 1.0, 1.0, None):
            raise InvalidCalibrationError("--calibration has the scales and the row weight; give it or them, not both")
        return read_trust(command.calibration)
    if not 0.0 < factors.row_weight <= 1.0:
        raise InvalidCalibrationError(f"--row-weight {factors.row_weight:g}: give a number above 0, up to 1")
    if not all(0.0 < factor <= LARGEST_SCALE for factor in (factors.noise_scale, factors.process_scale)):
        raise InvalidCalibrationError(f"--noise-scale and --process-scale are factors above 0, up to {LARGEST_SCALE:g}")
    return factors


def chosen_effects(command: Diagnose) -> tuple[str, ...]:
    """Effects to consider.

    Raises:
        InvalidVehicleError: a name that the catalogue does not have, or none is left.
    """
    for name in (*command.effects, *command.exclude):
        if name not in CATALOGUE:
            raise InvalidVehicleError(f"unknown effect {name}; the catalogue has {', '.join(CATALOGUE)}")
    chosen = tuple(name for name in command.effects if name not in command.exclude)
    if not chosen:
        raise InvalidVehicleError("--exclude leaves no effect to consider; name fewer")
    return chosen


def checked_columns(names: Sequence[str]) -> tuple[str, ...]:
    """Columns that may be left out; InvalidLogError where one may not."""
    for name in names:
        if name not in OPTIONAL:
            raise InvalidLogError(
                f"--without {name}: no column that can be left out; choose from {', '.join(OPTIONAL)}"
            )
    return tuple(names)


def checked_every(every: int) -> int:
    """Rows that make one; InvalidLogError below one."""
    if every < 1:
        raise InvalidLogError(f"--every {every}: give 1 or more")
    return every


def run_diagnose(command: Diagnose) -> None:
    """`drift-drake diagnose`."""
    vehicle, own = read_vehicle(command.vehicle)
    if command.workers < 1:
        raise InvalidOptionError(f"--workers {command.workers}: give 1 or more")
    trust = trust_in(command)
    options: dict[str, Any] = {
        "own": own,
        "catalogue": chosen_effects(command),
        "without": checked_columns(command.without),
        "every": checked_every(command.every),
        "normal": trust.normal,
    }
    if trust.normal is None:
        options |= trust.options()
    folders = case_folders(command.case)
    if folders != [command.case]:
        _diagnose_many(command, vehicle, folders, options)
        return
    inputs = [command.vehicle, *([command.calibration] if command.calibration else []), *run_paths(command.case)]
    try_outputs({"--json": command.json, "--report": command.report}, inputs)
    with tqdm(total=100, disable=command.quiet, file=sys.stderr, bar_format="{l_bar}{bar}| {elapsed}") as bar:

        def show(stage: str, share: float) -> None:
            bar.set_description(stage)
            bar.update(round(100 * share) - bar.n)

        diagnosis = answer_folder(command.case, vehicle, command.workers, progress=show, **options)
    _say(diagnosis.answer, to=said_to(command.json))
    if command.json is not None:
        write_text(command.json, diagnosis.answer.to_json())
    if command.report is not None:
        if isinstance(diagnosis, DayDiagnosis):
            from drift_drake.diagnosis.day_report import Source, write_day_report  # matplotlib is slow to import

            said = command_line("diagnose", command, "case")
            source = Source(said, command.case, command.vehicle, command.calibration, command.json)
            write_day_report(diagnosis, command.report, source)
        else:
            from drift_drake.diagnosis.report import write_report

            write_report(diagnosis, command.report)


def _diagnose_many(
    command: Diagnose, vehicle: VehicleParameters, folders: Sequence[Path], options: Mapping[str, Any]
) -> None:
    """A folder of cases; those that `--json` holds the answers to already are left as they are."""
    count, before = len(folders), dict[Path, Answer]()
    if command.report is not None:
        raise InvalidOptionError(f"--report is for one case; give one of the {count} folders in {command.case}")
    if command.json is not None:
        if command.json == STANDARD_OUTPUT:
            raise InvalidLogError(f"{command.case} holds {count} cases; give --json a folder for their answers")
        try_folder(command.json, "--json")
        names = {folder: command.json / f"{case_name(folder)}.json" for folder in folders}
        before = all_answered(names, vehicle, options)
    if command.again:
        before = {}
    if before:
        print(f"{len(before)} of {count} cases are answered in {command.json}; --again redoes them", file=sys.stderr)
    only = [folder for folder in folders if folder not in before]
    with tqdm(total=len(only), disable=command.quiet, file=sys.stderr, unit="case") as bar:

        def done(answer: Answer) -> None:
            bar.update()
            if command.json is not None:
                answer.write(command.json / f"{answer.case}.json")

        refused: list[InvalidLogError] = []
        answers = diagnose_all(command.case, vehicle, progress=done, refused=refused.append, only=only, **options)
    for answer in [*before.values(), *answers]:
        _say(answer)
    if refused:
        raise InvalidLogError(f"{len(refused)} of {count} cases cannot be used: " + "; ".join(map(str, refused)))


def _say(answer: Answer, to: TextIO | None = None) -> None:
    print(answer.sentence(), file=to)
    for warning in answer.warnings:
        print(f"  warning: {warning}", file=to)


def run_plan_next(command: PlanNext) -> None:
    """`drift-drake plan-next`."""
    from drift_drake.diagnosis.next_drive import NextDriveConfig, plan_from_answer  # Drake is slow to import

    answer = read_answer(command.answer)
    vehicle, own = read_vehicle(command.vehicle)
    _check_diagnosed(answer, vehicle, own, command.vehicle)
    try_outputs({"--out": command.out}, [command.answer, command.vehicle])
    lane = NextDriveConfig(v_start=command.v_start, v_end=command.v_end, half_width=command.half_width)
    drive = plan_from_answer(answer, vehicle, lane, own)
    drive.write(command.out)
    print(f"{command.out}: {drive.sentence()}")


def run_apply(command: Apply) -> None:
    """`drift-drake apply`."""
    answer = read_answer(command.answer)
    nominal, own = read_vehicle(command.vehicle)
    if not command.force:
        _check_diagnosed(answer, nominal, own, command.vehicle)
    vehicle, effects = corrected_vehicle(nominal, answer, command.tolerances, own)
    check_plausible(vehicle, f"{command.vehicle} with {command.answer}")
    check_effects(effects, vehicle, f"{command.vehicle} with {command.answer}")
    try_outputs({"--out": command.out}, [command.answer])
    write_vehicle(command.out, vehicle, effects)
    print(f"{command.out}: {answer.sentence()}")


def _check_diagnosed(answer: Answer, vehicle: VehicleParameters, own: Effects, source: Path) -> None:
    warning = check_diagnosed(answer, vehicle, own, source)
    if warning:
        print(f"warning: {warning}", file=sys.stderr)


Command = (
    Annotated[Import, tyro.conf.subcommand("import")]
    | Annotated[Diagnose, tyro.conf.subcommand("diagnose")]
    | Annotated[Identify, tyro.conf.subcommand("identify")]
    | Annotated[PlanNext, tyro.conf.subcommand("plan-next")]
    | Annotated[Apply, tyro.conf.subcommand("apply")]
    | Annotated[Simulate, tyro.conf.subcommand("simulate")]
    | Annotated[Replay, tyro.conf.subcommand("replay")]
    | Annotated[Train, tyro.conf.subcommand("train")]
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point of `drift-drake`; bad input ends with one sentence and exit code 2."""
    try:
        with terminable():
            command = tyro.cli(Command, prog="drift-drake", args=arguments, description=__doc__)  # type: ignore[arg-type]
            _run(command)
    except DriftDrakeError as error:
        print(f"drift-drake: {one_line(error)}", file=sys.stderr)
        return BAD_INPUT
    except (KeyboardInterrupt, TerminatedError) as end:
        how, code = ENDS[signal.SIGINT if isinstance(end, KeyboardInterrupt) else signal.SIGTERM]
        print(f"drift-drake: {how}; files are as they were before, or complete", file=sys.stderr)
        return code
    return 0


def _run(command: Any) -> None:
    if isinstance(command, Import):
        run_import(command)
    elif isinstance(command, Diagnose):
        run_diagnose(command)
    elif isinstance(command, Identify):
        run_identify(command)
    elif isinstance(command, Simulate):
        run_simulate(command)
    elif isinstance(command, Replay):
        run_replay(command)
    elif isinstance(command, PlanNext):
        run_plan_next(command)
    elif isinstance(command, Train):
        run_train(command)
    else:
        run_apply(command)


if __name__ == "__main__":
    sys.exit(main())
