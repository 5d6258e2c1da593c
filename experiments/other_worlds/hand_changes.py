"""Real logs with changes put in by hand: what is said of them, compared with the logs as they are.

    python -m experiments.other_worlds.hand_changes --data ../shared/data --out runs/hand_changes

A car is calibrated by prediction on some recordings and diagnosed on others: as they are, and with each of `CHANGES`
at twice the detection limit that the answer to those states, of both signs where there are two. Each part of the
calibration's recordings, left out of it, is diagnosed too. What is done is kept: start again to go on.
"""

import dataclasses
import itertools
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from diagrams.command import run_command
from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.car.log.table import IMPORT_REPORT, Run, read_case, write_run
from drift_drake.common.errors import DriftDrakeError
from drift_drake.common.safe_files import write_text
from drift_drake.gap.identification.options import Criterion
from drift_drake.gap.logs.importing.import_logs import write_case
from drift_drake.gap.logs.importing.importer import import_recordings
from drift_drake.gap.logs.importing.mapping import RecorderMapping, read_mapping
from drift_drake.view.style import save
from experiments.made import RunConfig, begun, made
from experiments.other_worlds.calibrations import calibration_row, calibration_scores, calibrations_text
from experiments.other_worlds.changes import CHANGES
from experiments.other_worlds.hand_scores import write_scores
from experiments.other_worlds.jobs import Ask, Calibrate, answer_of, ask, calibrate, done_once
from experiments.other_worlds.pictures import draw_rows
from experiments.other_worlds.scoring import Row
from experiments.real.cars import RIM_NOISE, RIM_SPEED, VEHICLES

TIMES = 2.0  # the detection limit, that a change is
RACER_PARTS = ((0.0, 50.0), (50.0, 100.0), (100.0, 150.0), (150.0, 300.0))  # [s] of the only recording


@dataclasses.dataclass(frozen=True)
class HandChanges(RunConfig):
    """Real logs, changed by hand."""

    data: Path
    """Folder with `dart/` and `revs_250lm/`."""
    workers: int = 2
    """Processes."""
    every: int = 2
    """Rows of the logs that make one here: 2 is 50 Hz."""
    criterion: Criterion = "prediction"
    """Of the calibration, as `drift-drake identify` takes it."""
    studies: tuple[str, ...] = ()
    """Names of the studies to do; all without."""


@dataclasses.dataclass(frozen=True)
class Study:
    """A car calibrated on some cases and asked about another."""

    name: str
    start: Path  # first guess
    calibrated_on: tuple[str, ...]
    asked: str
    changed: bool = False  # asked with changes, too


class NoDataError(DriftDrakeError, FileNotFoundError):
    """A folder of a data set has no recordings."""


SMALL, RACER = VEHICLES / "small_car.yaml", VEHICLES / "racer.yaml"


def studies_of(floor_a: Sequence[str], racer: Sequence[str]) -> list[Study]:
    """All studies.

    Args:
        floor_a: cases of the small car's recordings on one floor; racer: of the parts of the racer's, the last asked.
    """
    half = len(floor_a) // 2
    studies = [
        Study("small_car_split", SMALL, tuple(floor_a[:half]), "floor_a_rest", changed=True),
        Study("small_car_free_driving", SMALL, tuple(floor_a), "free_driving", changed=True),
        Study("small_car_floor_b", SMALL, tuple(floor_a), "floor_b"),
        Study("racer", RACER, tuple(racer[:-1]), racer[-1], changed=True),
    ]
    for start, cases in ((SMALL, floor_a), (RACER, racer[:-1])):
        studies += [Study(f"without_{out}", start, tuple(case for case in cases if case != out), out) for out in cases]
    return studies


def prepared(folder: Path, recordings: Sequence[Path], mapping: RecorderMapping, every: int, **part: Any) -> None:
    """Imports recordings once, as a case folder of thinned runs whose report states the rim speed's noise too."""
    if folder.exists():
        return
    runs, report = import_recordings(recordings, mapping, **part)
    if "omega_r" in mapping.formulas:
        noisy = [dataclasses.replace(r, std=r.std | RIM_NOISE) for r in report.runs]
        report = dataclasses.replace(report, runs=noisy)
    write_case(folder, [run.thinned(every) for run in runs], report, mapping)


def import_all(config: HandChanges, logs: Path) -> tuple[list[str], list[str]]:
    """Makes all cases; names of the small car's recordings on floor a, and of the racer's parts.

    Raises:
        NoDataError: a folder has no recordings.
    """
    for part in ("dart/floor_a", "dart/floor_b", "dart/free_driving", "revs_250lm"):
        if not any((config.data / part).glob("*.csv")):
            raise NoDataError(
                f"{config.data / part}: has no recordings (*.csv); give the folder of both data sets (--data)"
            )
    dart = read_mapping("dart")
    dart = dataclasses.replace(dart, formulas={**dart.formulas, **RIM_SPEED})
    recordings = {name: sorted((config.data / "dart" / name).glob("*.csv"))
                  for name in ("floor_a", "floor_b", "free_driving")}  # fmt: skip
    floor_a = []
    for i, path in enumerate(recordings["floor_a"]):
        floor_a.append(f"floor_a_{i}")
        prepared(logs / floor_a[-1], [path], dart, config.every)
    prepared(logs / "floor_a_rest", recordings["floor_a"][len(floor_a) // 2 :], dart, config.every)
    for name in ("floor_b", "free_driving"):
        prepared(logs / name, recordings[name], dart, config.every)
    racer = []
    for i, (start, end) in enumerate(RACER_PARTS):
        racer.append(f"racer_{i}")
        prepared(logs / racer[-1], sorted((config.data / "revs_250lm").glob("*.csv")), read_mapping("revs_250lm"),
                 config.every, start=start, end=end)  # fmt: skip
    return floor_a, racer


def magnitudes_of(answer: dict[str, Any]) -> tuple[dict[str, list[float]], dict[str, str]]:
    """Magnitudes of each change on logs whose answer is this, and why others are left out."""
    limits = answer["details"].get("detection", {})
    chosen, skipped = {}, {}
    for name in CHANGES:
        if name not in limits:
            skipped[name] = "not considered: a column is missing" if limits else "no detection limits in the answer"
        elif limits[name]["least"] is None:
            skipped[name] = "these logs have no detection limit"
        else:
            q = float(f"{TIMES * limits[name]['least']:.3g}")
            chosen[name] = [q, -q] if CATALOGUE[name].signed else [q]
    return chosen, skipped


def write_changed(case: Path, folder: Path, name: str, magnitude: float) -> None:
    """A case with a change put in, once."""
    if folder.exists():
        return
    runs: list[Run] = [CHANGES[name](run, magnitude) for run in read_case(case)]
    folder.mkdir(parents=True)
    for number, run in enumerate(runs):
        write_run(run, folder / f"run_{number}.csv")
    (folder / IMPORT_REPORT).write_text((case / IMPORT_REPORT).read_text())


def changed_cases(study: Study, logs: Path, folder: Path) -> tuple[dict[str, dict[str, float]], dict[str, str]]:
    """Writes the changed cases of a study: {case: effect}, and the changes that are left out."""
    chosen, skipped = magnitudes_of(answer_of(folder / study.name / f"{study.asked}.json"))
    cases = {}
    for name, magnitudes in chosen.items():
        for q in magnitudes:
            case = f"{study.asked}-{name}{q:+.3g}"
            write_changed(logs / study.asked, folder / study.name / "logs" / case, name, q)
            cases[case] = {name: q}
    return cases, skipped


def main(config: HandChanges) -> None:
    """All studies."""
    folder = begun("hand_changes", config)
    logs = folder / "logs"
    studies = [s for s in studies_of(*import_all(config, logs)) if not config.studies or s.name in config.studies]
    # Studies that calibrate on the same logs share the car.
    cars = {s.calibrated_on: Calibrate(tuple(logs / case for case in s.calibrated_on), s.start,
                                       folder / "cars" / "+".join(s.calibrated_on), config.criterion)
            for s in studies}  # fmt: skip
    done_once(config.workers, calibrate, list(cars.values()), "car")

    def asked(study: Study, case: str, at: Path) -> Ask:
        return Ask(at / case, cars[study.calibrated_on].folder, folder / study.name / f"{case}.json")

    done_once(config.workers, ask, [asked(s, s.asked, logs) for s in studies], "log")
    changed, skipped = {}, {}
    for study in studies:
        if study.changed:
            changed[study.name], skipped[study.name] = changed_cases(study, logs, folder)
    asks = [[asked(s, case, folder / s.name / "logs") for case in changed.get(s.name, {})] for s in studies]
    done_once(config.workers, ask, list(itertools.chain(*asks)), "log")
    rows = []
    for study in studies:
        cases: dict[str, dict[str, float]] = {study.asked: {}} | changed.get(study.name, {})
        rows += [Row(study.name, study.start.stem, case, effects, answer_of(folder / study.name / f"{case}.json"))
                 for case, effects in cases.items()]  # fmt: skip
    calibrations = {job.folder.name: calibration_row(job, own_figures=False) for job in cars.values()}
    over_all = calibration_scores(list(calibrations.values()))
    write_scores(rows, skipped, {"calibration": over_all, "calibrations": calibrations},
                 calibrations_text(over_all, calibrations), folder)  # fmt: skip
    save(draw_rows(rows), folder / "said.png")
    text = f"{(folder / 'scores.md').read_text()}\n{made(config)}\n"
    write_text(folder / "scores.md", text)
    print(text)


if __name__ == "__main__":
    run_command(main, HandChanges, __doc__)
