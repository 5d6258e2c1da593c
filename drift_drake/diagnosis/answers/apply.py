"""`drift-drake apply`: the corrected vehicle file."""

import dataclasses
import sys
from pathlib import Path
from typing import Annotated

import tyro

from drift_drake.diagnosis.answers.answer import Answer, read_answer
from drift_drake.diagnosis.answers.provenance import check_diagnosed
from drift_drake.safe_files import try_outputs
from drift_drake.standard_output import said_to, write_results
from drift_drake.vehicle.effects import Effects, combined, magnitudes_of, make_effects
from drift_drake.vehicle.parameters import RELATIVE, VehicleParameters
from drift_drake.vehicle.vehicle_file import check_effects, check_plausible, read_vehicle, write_vehicle


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
    """Apply the deviations within tolerance that were found beside the effects, too."""
    force: bool = False
    """Apply to a vehicle file that is not the one that was diagnosed."""
    json: Path | None = None
    """Where to write what was applied, as JSON (-: standard output)."""


def run_apply(command: Apply) -> None:
    answer = read_answer(command.answer)
    nominal, own = read_vehicle(command.vehicle)
    if not command.force and (warning := check_diagnosed(answer, nominal, own, command.vehicle)):
        print(f"warning: {warning}", file=sys.stderr)
    vehicle, effects = corrected_vehicle(nominal, answer, command.tolerances, own)
    check_plausible(vehicle, f"{command.vehicle} with {command.answer}")
    check_effects(effects, vehicle, f"{command.vehicle} with {command.answer}")
    try_outputs({"--out": command.out, "--json": command.json}, [command.answer])
    write_vehicle(command.out, vehicle, effects)
    print(f"{command.out}: {answer.sentence()}", file=said_to(command.json))
    applied = {"out": command.out, "verdict": answer.verdict, "effects": magnitudes_of(effects), "vehicle": vehicle}
    write_results(command.json, applied)


def corrected_vehicle(
    vehicle: VehicleParameters,
    answer: Answer,
    tolerances: bool = True,
    own: Effects = Effects(),
) -> tuple[VehicleParameters, Effects]:
    """The vehicle with the answer's causes added, and what comes along with them (`details["with"]`).

    Args:
        tolerances: whether the deviations within tolerance that were found beside them are applied too;
        own: effects that the vehicle had before.
    """
    magnitudes = {name: answer.magnitudes[name].estimate for name in answer.causes}
    for name, value in answer.details.get("with", {}).items() if answer.causes else ():
        magnitudes[name] = magnitudes.get(name, 0.0) + float(value)
    if tolerances:
        n, t = answer.tolerances, vehicle.tolerance
        changes = {name: getattr(vehicle, name) * (1.0 + n.get(name, 0.0) * getattr(t, name)) for name in RELATIVE}
        shift = n.get("front_axle_distance", 0.0) * t.front_axle_distance
        changes["front_axle_distance"] = vehicle.front_axle_distance + shift
        changes["rear_axle_distance"] = vehicle.rear_axle_distance - shift
        changes["gear_ratio"] = vehicle.gear_ratio * (1.0 + n.get("torque", 0.0) * t.torque)
        offset = n.get("steering_offset", 0.0) * t.steering_offset
        if offset != 0.0:
            magnitudes["steering_offset"] = magnitudes.get("steering_offset", 0.0) + offset
        vehicle = vehicle.replace(**changes)
    return vehicle, combined(own, make_effects(magnitudes))
