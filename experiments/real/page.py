"""Tables and a picture of what `experiments.real.logs` found.

    python -m experiments.real.page --out runs/real_logs

Writes numbers.md and errors.png into the run folder.
"""

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from diagrams.command import run_command
from drift_drake.common.errors import unit_suffix
from drift_drake.common.run_folder import is_done
from drift_drake.common.safe_files import write_figure, write_text
from experiments.made import tabulated

UNITS = {"r": "rad/s", "v": "m/s", "beta": "rad"}
CALIBRATED = {"small_car_floor_a": "small car, from floor_a", "small_car_free_driving": "small car, from free_driving",
              "racer": "250 LM, from its first 150 s"}  # fmt: skip
ASKED = {"small_car_on_floor_b": "small car on floor_b", "small_car_on_free_driving": "small car in free driving",
         "racer_on_rest": "250 LM, the rest"}  # fmt: skip


@dataclasses.dataclass(frozen=True)
class Config:
    """The run folder to read."""

    out: Path


def read(folder: Path, name: str) -> Any:
    """What a stage found; None if it is not done."""
    path = folder / f"{name}.json"
    return json.loads(path.read_text())["found"] if is_done(path) else None


def parameter_table(found: dict[str, Any]) -> str:
    """Estimates, intervals and first guesses as Markdown."""
    rows = []
    for name, p in found["parameters"].items():
        unit = unit_suffix(p["unit"])
        held = " (held)" if p["kind"] == "known" else ""
        rows.append((f"{name}{held}", f"{p['estimate']:.4g}{unit}", f"{p['low']:.4g} to {p['high']:.4g}",
                     f"{p['start']:.4g}", f"{p['widened']:.1f}"))  # fmt: skip
    return "\n".join(tabulated(("parameter", "estimate", "95 % interval", "first guess", "widened by"), rows))


def worth(found: dict[str, Any]) -> str:
    """What one row of this car's logs is worth."""
    discrepancy = found["discrepancy"]
    with_forces = f", {discrepancy['tempering']:.2g} with the model discrepancy" if discrepancy else ""
    return f"the likelihood tempering exponent is {found['tempering']:.2g}{with_forces}"


def error_table(found: dict[str, Any]) -> str:
    """Errors half a second ahead as Markdown."""
    i = found["horizons"].index(0.5)
    rows = []
    for k, state in enumerate(found["states"]):
        if state in UNITS:
            before, after = found["first_guess"][i][k], found["calibrated"][i][k]
            rows.append((f"{state} [{UNITS[state]}]", f"{before:.3g}", f"{after:.3g}"))
    return "\n".join(tabulated(("at 0.5 s", "first guess", "calibrated"), rows))


def draw(found: dict[str, dict[str, Any]], path: Path) -> None:
    """Errors on logs that are new to the calibrated car, against the horizon."""
    figure = Figure(figsize=(9.0, 2.5 * len(found)), layout="constrained")
    axes = figure.subplots(len(found), len(UNITS), squeeze=False)
    for row, (name, asked) in zip(axes, found.items(), strict=True):
        for ax, (state, unit) in zip(row, UNITS.items(), strict=True):
            if state not in asked["states"]:
                ax.set_visible(False)
                continue
            i = asked["states"].index(state)
            for key, color in (("first_guess", "#d1495b"), ("calibrated", "#00798c")):
                values = [errors[i] for errors in asked[key]]
                ax.loglog(asked["horizons"], values, "o-", color=color, lw=1.3, ms=3.5, label=key.replace("_", " "))
            ax.set_title(f"{ASKED[name]}: {state} [{unit}]", fontsize=9)
            ax.set_xlabel("horizon [s]", fontsize=8)
            ax.tick_params(labelsize=8)
            ax.spines[["top", "right"]].set_visible(False)
    axes[0, 0].legend(fontsize=8)
    write_figure(figure, path, dpi=130)


def main(config: Config) -> None:
    """Reads what is there, writes the page's tables and picture."""
    parts = []
    for name, title in CALIBRATED.items():
        found = read(config.out, name)
        if found is not None:
            h, trust = found["held_out"], found["trust"]
            share = f"{h['ratio']:.2f} ({h['low']:.2f} to {h['high']:.2f})"
            held = f"Held out: errors at 0.5 s are {share} of the first guess's."
            noise = f"Noise times {trust['noise']:.2g}, process times {trust['process']:.2g}; {worth(found)}."
            parts += [f"## {title}", parameter_table(found), held, noise]
    asked = {name: found for name in ASKED if (found := read(config.out, name)) is not None}
    for name, found in asked.items():
        warnings = [warning for warning in found["answer"]["warnings"] if "discrepancy" in warning]
        seconds = f"The diagnosis took {found['diagnosis_seconds_of_cpu']:.0f} s of CPU."
        parts += [f"## {ASKED[name]}", found["sentence"], *warnings, seconds, error_table(found)]
    write_text(config.out / "numbers.md", "\n\n".join(parts) + "\n")
    if asked:
        draw({k: {**v, "first_guess": np.array(v["first_guess"], dtype=float),
                  "calibrated": np.array(v["calibrated"], dtype=float)} for k, v in asked.items()},
             config.out / "errors.png")  # fmt: skip


if __name__ == "__main__":
    run_command(main, Config, __doc__)
