"""`drift-drake simulator check`: a simulator of yours tried before anything is calibrated with it."""

import dataclasses
from pathlib import Path
from typing import Annotated, Literal

import tyro

from drift_drake.car.car_file import read_simulator_car
from drift_drake.common.safe_files import try_outputs
from drift_drake.common.standard_output import said_to, write_results

MARKS = {"wrong": "!", "doubtful": "?", "good": " "}
SOMETHING_WRONG = 1  # exit code


@dataclasses.dataclass(frozen=True)
class CheckSimulator:
    """Try a simulator of yours: signs, units, starts, steps, memory, crashes, and what one roll-out costs.

    drift-drake simulator check simulator.yaml

    Ends with exit code 1 where something has to be put right (marked !).
    """

    action: Annotated[tyro.conf.Positional[Literal["check"]], tyro.conf.arg(metavar="check")]
    """What to do."""
    file: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="SIMULATOR")]
    """The simulator file (YAML)."""
    json: Path | None = None
    """Where to write all of it as JSON (-: standard output)."""


def run_simulator(command: CheckSimulator) -> int:
    from drift_drake.car.foreign.check import check_simulator

    car = read_simulator_car(command.file)
    try_outputs({"--json": command.json}, [command.file])
    checked = check_simulator(car)
    to = said_to(command.json)
    for one in checked.findings:
        print(f"{MARKS[one.grade]} {one.sentence}", file=to)
    for sentence in car.simulator.left_out():
        print(f"  left out: {sentence}", file=to)
    print(f"{command.file}: {checked.wrong or 'nothing'} to be put right; a roll-out of 0.8 s takes "
          f"{1e3 * checked.seconds_per_rollout:.2g} ms", file=to)  # fmt: skip
    write_results(command.json, checked)
    return SOMETHING_WRONG if checked.wrong else 0
