"""`drift-drake apply`: the corrected vehicle file."""

import dataclasses
import sys
from pathlib import Path
from typing import Annotated

import tyro

from drift_drake.car.effects.magnitudes import magnitudes_of
from drift_drake.car.given_vehicle import vehicle_given
from drift_drake.car.vehicle_file import check_effects, check_plausible, write_vehicle
from drift_drake.common.safe_files import try_outputs
from drift_drake.common.standard_output import said_to, write_results
from drift_drake.gap.diagnosis.answers.answer import read_answer
from drift_drake.gap.diagnosis.answers.apply import corrected_vehicle
from drift_drake.gap.diagnosis.answers.provenance import check_diagnosed


@dataclasses.dataclass(frozen=True)
class Apply:
    """Write the corrected vehicle: an answer's effects, with magnitudes, added to a vehicle file.

    drift-drake apply answer.json --vehicle car.yaml --out corrected.yaml
    """

    answer: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="ANSWER")]
    """Answer of `drift-drake diagnose --json`."""
    vehicle: Path
    """The vehicle file that was diagnosed."""
    out: Path
    """Where to write the corrected vehicle file."""
    tolerances: bool = True
    """Apply the deviations within tolerance that were found in addition to the effects."""
    force: bool = False
    """Apply to a vehicle file that is not the one that was diagnosed."""
    json: Path | None = None
    """Where to write what was applied, as JSON (-: standard output)."""


def run_apply(command: Apply) -> None:
    answer = read_answer(command.answer)
    given = vehicle_given(command.vehicle)
    nominal, own = given.parameters, given.effects
    if not command.force and (warning := check_diagnosed(answer, nominal, own, command.vehicle)):
        print(f"warning: {warning}", file=sys.stderr)
    vehicle, effects = corrected_vehicle(nominal, answer, command.tolerances, own)
    check_plausible(vehicle.single_track(), f"{command.vehicle} with {command.answer}")
    check_effects(effects, vehicle.single_track(), f"{command.vehicle} with {command.answer}")
    try_outputs({"--out": command.out, "--json": command.json}, [command.answer])
    kept = given.single_track and corrected_vehicle(given.single_track[0], answer, False, given.single_track[1])
    write_vehicle(command.out, vehicle, effects, kept)
    print(f"{command.out}: {answer.sentence()}", file=said_to(command.json))
    applied = {"out": command.out, "verdict": answer.verdict, "effects": magnitudes_of(effects), "vehicle": vehicle}
    write_results(command.json, applied)
