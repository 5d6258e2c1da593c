"""Recordings of one real car, each left out of its baseline in turn and diagnosed relative to the others.

    python -m experiments.real.left_out --vehicle car.yaml --logs logs/a logs/b logs/c --out runs/left_out

Where nothing is known to have changed, each answer but `none` is a false alarm. What is there is not done again.
"""

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from diagrams.command import run_command
from drift_drake.common.errors import DriftDrakeError
from drift_drake.gap.evidence.posterior import NONE
from drift_drake.gap.identification.options import Criterion
from experiments.made import RunConfig, begun, tabulated, write_report
from experiments.other_worlds.jobs import Ask, Calibrate, answer_of, ask, calibrate, done_once
from experiments.other_worlds.scoring import said_share, share


class TooFewRecordingsError(DriftDrakeError, ValueError):
    """Nothing is left to calibrate on, or two recordings have one name."""


@dataclasses.dataclass(frozen=True)
class LeaveOneOut(RunConfig):
    """Recordings of one car, each left out."""

    vehicle: Path
    """First guess of the car."""
    logs: tuple[Path, ...]
    """Folders of logs, one a recording, as `drift-drake import` writes them."""
    workers: int = 2
    """Processes."""
    criterion: Criterion = "prediction"
    """Of the calibrations, as `drift-drake identify` takes it."""


def text_of(answers: Mapping[str, Mapping[str, Any]]) -> str:
    """A table of the answers by recording, and how many are alarms of those that there are."""
    rows, alarms = [], []
    for name, answer in answers.items():
        posterior = {key: float(p) for key, p in answer["posterior"].items()}
        likely = sorted((key for key in posterior if key != NONE), key=lambda key: -posterior[key])[:2]
        none = f"{posterior[NONE]:.2f}" if posterior else answer["message"]
        decision = answer["details"].get("decision", answer["verdict"])
        rows.append((name, none, decision, ", ".join(f"{key} {posterior[key]:.2f}" for key in likely)))
        if posterior:
            alarms.append(answer["verdict"] != NONE)
    table = tabulated(("recording", "probability of none", "decision", "otherwise"), rows)
    return "\n".join([*table, "", f"Alarms: {said_share(share(alarms))}."])


def main(config: LeaveOneOut) -> None:
    """Calibrates on all but one, diagnoses that one, for each."""
    names = [log.name for log in config.logs]
    if len(names) < 2 or len(set(names)) < len(names):
        raise TooFewRecordingsError("--logs: give two folders or more, each of another name")
    folder = begun("left_out", config)
    cars = {}
    for log in config.logs:
        others = tuple(other for other in config.logs if other != log)
        at = folder / "cars" / f"without_{log.name}"
        cars[log] = Calibrate(others, config.vehicle, at, config.criterion)
    done_once(config.workers, calibrate, list(cars.values()), "car")
    asked = [Ask(log, cars[log].folder, folder / f"{log.name}.json") for log in config.logs]
    done_once(config.workers, ask, asked, "log")
    write_report(folder, text_of({job.case.name: answer_of(job.out) for job in asked}), config)


if __name__ == "__main__":
    run_command(main, LeaveOneOut, __doc__)
