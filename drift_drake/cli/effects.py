"""`drift-drake effects`: the catalogue of effects, those of other packages included, and what shows them."""

import dataclasses
import textwrap
from pathlib import Path
from typing import Any

from drift_drake.car.car_file import read_car
from drift_drake.car.effects.catalogue import CATALOGUE, shown_by
from drift_drake.car.effects.installed import installed_effects
from drift_drake.car.effects.record import FUNCTIONS
from drift_drake.car.parameters import VehicleParameters
from drift_drake.common.safe_files import try_outputs
from drift_drake.common.standard_output import said_to, write_results


@dataclasses.dataclass(frozen=True)
class ListEffects:
    """List the effects that a diagnosis knows: units, practical ranges, the columns they need, and what shows them.

    drift-drake effects --vehicle car.yaml

    Effects that other packages install are among them: an entry point in the group drift_drake.effects names a
    drift_drake.Effect.
    """

    vehicle: Path | None = None
    """Car whose size the ranges are for (YAML); a coupe without."""
    json: Path | None = None
    """Where to write the catalogue as JSON (-: standard output)."""


def run_effects(command: ListEffects) -> None:
    try_outputs({"--json": command.json}, [] if command.vehicle is None else [command.vehicle])
    vehicle = VehicleParameters() if command.vehicle is None else read_car(command.vehicle)[0].single_track()
    print(listing(vehicle), file=said_to(command.json))
    write_results(command.json, catalogue_data(vehicle))


def catalogue_data(vehicle: VehicleParameters) -> dict[str, dict[str, Any]]:
    """The catalogue as plain data, ranges for this vehicle."""
    out = {}
    for name, effect in CATALOGUE.items():
        low, high = effect.range_for(vehicle)
        fields = {f.name: getattr(effect, f.name) for f in dataclasses.fields(effect) if f.name not in FUNCTIONS}
        shown = [words for words, _ in shown_by([name])]
        out[name] = fields | {"low": low, "high": high, "shown_by": shown, "installed": name in installed_effects()}
    return out


def listing(vehicle: VehicleParameters) -> str:
    """The catalogue for a person: an effect a line, then which manoeuvre shows which."""
    rows = [("effect", "unit", "range", "acts on", "needs", "what it does")]
    for name, effect in CATALOGUE.items():
        low, high = effect.range_for(vehicle)
        needs = ", ".join(effect.needs) or "-"
        rows.append((name, effect.unit, f"{low:.3g} to {high:.3g}", effect.stage, needs, effect.change))
    widths = [max(len(row[i]) for row in rows) for i in range(5)]
    lines = ["  ".join([f"{row[i]:<{width}}" for i, width in enumerate(widths)] + [row[5]]) for row in rows]
    for words, names in shown_by(CATALOGUE):
        lines += ["", f"Shown by {words}:", *textwrap.wrap(", ".join(names), 96, initial_indent="  ",
                  subsequent_indent="  ")]  # fmt: skip
    return "\n".join(lines)
