"""`drift-drake plan-next`: the drive that distinguishes rival hypotheses."""

import dataclasses
import sys
from pathlib import Path
from typing import Annotated

import tyro

from drift_drake.car.given_vehicle import on_one_track, vehicle_given
from drift_drake.common.interruption import ended_at_once
from drift_drake.common.safe_files import try_outputs
from drift_drake.common.standard_output import said_to, write_results
from drift_drake.gap.diagnosis.answers.answer import read_answer
from drift_drake.gap.diagnosis.answers.provenance import check_diagnosed


@dataclasses.dataclass(frozen=True)
class PlanNext:
    """Plan the drive that distinguishes an answer's rival hypotheses best, within a straight lane.

    drift-drake plan-next answer.json --vehicle car.yaml --out plan.csv
    """

    answer: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="ANSWER")]
    """Answer of `drift-drake diagnose --json`."""
    vehicle: Path
    """The vehicle file that was diagnosed."""
    out: Path = Path("plan.csv")
    """Where to write the plan: commands at 100 Hz and the states that they are expected to lead to."""
    v_start: float = 7.5
    """Speed at the start [m/s]."""
    v_end: float = 20.0
    """Speed at the end, which the plan approaches [m/s]."""
    half_width: float = 3.0
    """Half width of the lane [m]."""
    json: Path | None = None
    """Where to write the evidence that the drive is expected to bring, as JSON (-: standard output)."""


def run_plan_next(command: PlanNext) -> None:
    answer = read_answer(command.answer)
    given = vehicle_given(command.vehicle)
    car = on_one_track(given, command.vehicle)
    for warning in (check_diagnosed(answer, given.parameters, given.effects, command.vehicle), car.remark):
        if warning:
            print(f"warning: {warning}", file=sys.stderr)
    try_outputs({"--out": command.out, "--json": command.json}, [command.answer, command.vehicle])
    with ended_at_once():
        from drift_drake.gap.next_drive.foresight import beliefs_of
        from drift_drake.gap.next_drive.plan import NextDriveConfig, plan_from_answer

    lane = NextDriveConfig(v_start=command.v_start, v_end=command.v_end, half_width=command.half_width)
    beliefs_of(answer)  # refuses an answer without rivals before anything is compiled
    drive = plan_from_answer(answer, car.parameters, lane, car.effects, given.effects)
    drive.write(command.out)
    print(f"{command.out}: {drive.sentence()}", file=said_to(command.json))
    write_results(command.json, drive.expectations())
