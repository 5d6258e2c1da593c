"""`drift-drake check`: an assessment of logs before anything is fitted to them."""

import dataclasses
import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import tyro

from drift_drake.errors import InvalidOptionError, significant
from drift_drake.interruption import ended_at_once
from drift_drake.logs.cases import case_name
from drift_drake.logs.table import read_case, run_paths, stated_noise
from drift_drake.plain_files import check_file
from drift_drake.safe_files import try_outputs
from drift_drake.standard_output import said_to, write_results
from drift_drake.vehicle.catalogue import CATALOGUE
from drift_drake.vehicle.vehicle_file import read_vehicle, stated_tolerances

if TYPE_CHECKING:
    from drift_drake.diagnosis.check.for_calibration import ForCalibration
    from drift_drake.logs.screening.screened import RunQuality
    from drift_drake.logs.table import Run
    from drift_drake.vehicle.effects import Effects
    from drift_drake.vehicle.parameters import VehicleParameters

UNITS = {"speed": "m/s", "lateral acceleration": "m/s^2", "sideslip": "rad", "steering": "rad",
         "steering rate": "rad/s"}  # fmt: skip
LEAST_COVERED = 0.5  # [s] in an operating region that counts as driven


@dataclasses.dataclass(frozen=True)
class Check:
    """Assess logs before anything is fitted to them: quality, coverage, which effects they could show.

    drift-drake check logs/monday --vehicle car.yaml

    drift-drake check logs/monday --vehicle start.yaml --for-calibration

    drift-drake check logs/tuesday --vehicle car.yaml --calibration car.json

    Without a vehicle file: rates, columns, noise, bad samples, how hard the car was driven, and where columns that say
    the same disagree: by how much, and what would fix it. With one: the steering ratio and the torque too, which parts
    can be used, the operating regions, and for each effect of the
    catalogue the least magnitude that these logs would show; with the calibration, beside what is normal for the car.
    With --for-calibration: whether the logs are good enough for `drift-drake identify`, and which drive is missing.
    """

    logs: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="LOGS")]
    """Folder of runs (run_0.csv, run_1.csv, ...) of one car, or one run's file."""
    vehicle: Path | None = None
    """What the simulator believes of the car (YAML)."""
    calibration: Path | None = None
    """What `drift-drake identify --json` wrote of this car."""
    for_calibration: bool = False
    """Say whether a car can be calibrated on these logs, given its first guess: what would stay unknown, which drive is
    missing, and what more recordings would bring."""
    json: Path | None = None
    """Where to write all of it as JSON (-: standard output)."""
    workers: int = 2
    """Threads."""


@dataclasses.dataclass(frozen=True)
class Checked:
    """What was found; detection: by effect, as in an answer (`details.detection`); regions: seconds driven in each;
    unchecked: columns of which no other one tells whether they are right."""

    case: str
    runs: "list[RunQuality]"
    remarks: list[str]
    regions: dict[str, float] = dataclasses.field(default_factory=dict)
    detection: dict[str, dict[str, Any]] = dataclasses.field(default_factory=dict)
    unchecked: tuple[str, ...] = ()
    for_calibration: "ForCalibration | None" = None


def run_check(command: Check) -> None:
    if command.calibration is not None:
        check_file(command.calibration, InvalidOptionError, "write it with 'drift-drake identify --json'")
        if command.vehicle is None:
            raise InvalidOptionError("--calibration is of a vehicle file; give --vehicle too")
    if command.for_calibration and (command.vehicle is None or command.calibration is not None):
        raise InvalidOptionError("--for-calibration is of a first guess; give --vehicle, and no --calibration")
    given = None if command.vehicle is None else read_vehicle(command.vehicle)
    inputs = [path for path in (command.vehicle, command.calibration, *run_paths(command.logs)) if path is not None]
    try_outputs({"--json": command.json}, inputs)
    runs = read_case(command.logs)
    with ended_at_once():
        from drift_drake.logs.screening.consistency import consistency_of
        from drift_drake.logs.screening.repeated import without_repeated
        from drift_drake.logs.screening.screened import quality, screened

    once, repeated = without_repeated(runs)
    clean, bad = screened(once)
    agrees = consistency_of([one.run for one in clean], None if given is None else given[0])
    remarks = [*(doubt.sentence for doubt in agrees.doubts), *repeated, *bad]
    checked = Checked(case_name(command.logs), quality(once, clean), remarks, unchecked=agrees.unchecked)
    if given is not None:
        checked = with_vehicle(checked, runs, *given, command)
    print("\n".join(sentences(checked)), file=said_to(command.json))
    write_results(command.json, checked)


def with_vehicle(
    checked: Checked, runs: "Sequence[Run]", vehicle: "VehicleParameters", own: "Effects", command: Check
) -> Checked:
    """What can be said beside a vehicle file.

    Raises:
        InvalidLogError: no run can be used.
    """
    with ended_at_once():
        from drift_drake.diagnosis.check.limits import limits_by_filter, limits_by_prediction
        from drift_drake.diagnosis.shared.where import region_names, region_of
        from drift_drake.estimation.admitted import admit
        from drift_drake.identification.calibration import CarTrust, read_trust

    kept, doubts, warnings = admit(runs, vehicle)
    told = {doubt.sentence for doubt in doubts if doubt.column is not None}  # by what is asked of the columns already
    warnings = [warning for warning in warnings if warning not in told]
    names, grip = region_names(), vehicle.friction * vehicle.gravity
    seconds = np.zeros(len(names))
    for run in kept:
        beta = np.zeros(len(run)) if run.beta is None else run.beta
        np.add.at(seconds, region_of(run.v, run.r, beta, grip), run.period)
    regions = {name: float(s) for name, s in zip(names, seconds, strict=True) if s >= LEAST_COVERED}
    remarks = [*checked.remarks, *warnings]
    if command.for_calibration:
        from drift_drake.diagnosis.check.for_calibration import for_calibration

        assert command.vehicle is not None
        found = for_calibration(kept, vehicle, own, stated_tolerances(command.vehicle))
        remarks = list(dict.fromkeys(remarks))
        return dataclasses.replace(checked, remarks=remarks, regions=regions, for_calibration=found)
    trust = CarTrust(1.0, 1.0, 1.0, None) if command.calibration is None else read_trust(command.calibration)
    if command.calibration is not None:
        trust.check_knows(tuple(CATALOGUE), command.calibration)
    if trust.normal is not None:
        detection, more = limits_by_prediction(kept, vehicle, trust.normal, own, checked.case, command.workers)
    else:
        detection, more = limits_by_filter(kept, vehicle, own, stated_noise(command.logs), trust.options())
    remarks = list(dict.fromkeys([*remarks, *more]))
    return dataclasses.replace(checked, remarks=remarks, regions=regions, detection=detection)


def sentences(checked: Checked) -> list[str]:
    """What is said of it, a line each."""
    total = sum(run.seconds for run in checked.runs)
    lines = [f"{checked.case}: {len(checked.runs)} run{'s' if len(checked.runs) > 1 else ''}, {total:.1f} s"]
    for run in checked.runs:
        far = ", ".join(f"{name} {value:.3g} {UNITS[name]}" for name, value in run.reached.items())
        lines.append(f"  {run.name}: {run.seconds:.1f} s at {run.rate:.4g} Hz; up to {far}")
    levels: dict[str, list[float]] = {}
    for run in checked.runs:
        for name, level in run.noise.items():
            levels.setdefault(name, []).append(level)
    lines.append("noise (SI): " + ", ".join(f"{name} {np.median(level):.2g}" for name, level in levels.items()))
    missing = sorted({name for run in checked.runs for name in run.missing})
    lines.append(f"columns missing: {', '.join(missing)}" if missing else "columns: all of the log format")
    lines += [f"! {remark}" for remark in checked.remarks] or ["bad samples: none"]
    if checked.unchecked:
        lines.append(f"not checked, since no other column tells: {', '.join(checked.unchecked)}")
    if checked.regions:
        driven = sorted(checked.regions.items(), key=lambda item: -item[1])
        lines += ["driven:", *(f"  {seconds:5.1f} s  {name}" for name, seconds in driven)]
    if checked.for_calibration is not None:
        from drift_drake.diagnosis.check.for_calibration import said

        lines += said(checked.for_calibration)
    return lines + could_show(checked.detection)


def could_show(detection: dict[str, dict[str, Any]]) -> list[str]:
    """What the logs would show, what they could not, and what to drive for that."""
    from drift_drake.diagnosis.shared.manoeuvres import shown_by
    from drift_drake.diagnosis.shared.ranges import RATE_LIMIT

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
    if RATE_LIMIT not in detection:
        lines.append(f"not judged here: {RATE_LIMIT}, which acts the more the lower it is")
    return lines


def _wrapped(parts: list[str]) -> list[str]:
    text = ", ".join(part.replace(" ", "\u00a0") for part in parts)  # no break within one
    return [
        line.replace("\u00a0", " ") for line in textwrap.wrap(text, 100, initial_indent="  ", subsequent_indent="  ")
    ]
