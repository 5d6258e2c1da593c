"""Do the intervals of an identification hold the truth? Simulated cars, drawn at random, each from a wrong start.

    python -m experiments.gap.identify_coverage --out runs/identify_coverage

Every car's parameters and effects are drawn; a Drake plant (error-controlled Runge-Kutta of third order, feedback
drivers, sensors' noise) or the compiled one logs four drives; the identification starts from the default vehicle file.
A vehicle that is done is kept: start again to go on.
"""

import dataclasses
import time
from pathlib import Path
from typing import Any, Literal

import numpy as np
from matplotlib.figure import Figure

from diagrams.command import run_command
from drift_drake.car.parameters import VehicleParameters
from drift_drake.common.run_folder import write_json
from drift_drake.common.safe_files import write_figure
from drift_drake.gap.identification.identify import identify
from experiments.benchmarks.compiled_cases import make_case
from experiments.benchmarks.drake_cases import drake_case
from experiments.benchmarks.intervals import binomial, bootstrap
from experiments.benchmarks.truths import Truth, true_constants
from experiments.made import RunConfig, begun, write_report
from experiments.settings import each_vehicle

DEVIATIONS = {  # one standard deviation of the truth from the default file, relative or in the parameter's unit
    "mass": 0.01,
    "wheel_radius": 0.002,
    "yaw_inertia": 0.15,
    "front_axle_distance": 0.04,
    "rear_axle_inertia": 0.25,
    "torque": 0.1,
    "friction": 0.12,
    "front_stiffness": 0.2,
    "rear_stiffness": 0.2,
    "steering_offset": 0.008,
}
EFFECTS = {  # ranges of the uniform draws
    "steering_lag": (0.02, 0.12),
    "torque_lag": (0.05, 0.2),
    "aero_drag": (0.2, 1.2),
    "rolling_resistance": (0.005, 0.025),
    "front_rear_friction_split": (-0.1, 0.1),
}
CUT = 2.0  # standard deviations at which draws are cut


@dataclasses.dataclass(frozen=True)
class Config(RunConfig):
    """Intervals of identifications against the truth."""

    vehicles: int = 48
    duration: float = 12.0
    """Of each of the four drives [s]."""
    plant: Literal["drake", "compiled"] = "drake"
    seed: int = 7


def drawn_car(config: Config, index: int) -> tuple[Truth, np.random.Generator]:
    """The truth of one vehicle, and the generator that its drives go on with."""
    rng = np.random.default_rng([config.seed, index])
    deviations = {name: s * float(np.clip(rng.standard_normal(), -CUT, CUT)) for name, s in DEVIATIONS.items()}
    return Truth({name: float(rng.uniform(*ends)) for name, ends in EFFECTS.items()}, {}, deviations), rng


def one_vehicle(config: Config, index: int) -> dict[str, Any]:
    """Truth and stated interval of every parameter of one vehicle."""
    vehicle = VehicleParameters()
    truth, rng = drawn_car(config, index)
    runs = (drake_case if config.plant == "drake" else make_case)(truth, vehicle, rng, config.duration)
    began = time.process_time()
    found = identify(runs, vehicle, case=f"{index}", effects=tuple(EFFECTS), watching=False)
    constants, offset = true_constants(vehicle, truth.deviations)
    true = constants._asdict() | truth.effects | {"steering_offset": offset}
    c = found.calibration
    return {
        "seconds": time.process_time() - began,
        "truth": {name: true[name] for name in c.parameters},
        "parameters": c.parameters,
        "held_out_ratio": c.held_out.ratio,
        "trust": c.trust,
        "warnings": c.warnings,
    }


def inside(result: dict[str, Any]) -> dict[str, bool]:
    """Whether the truth lies in each parameter's interval."""
    return {name: bool(p["low"] <= result["truth"][name] <= p["high"]) for name, p in result["parameters"].items()}


def numbers(results: list[dict[str, Any]]) -> dict[str, Any]:
    """Coverage by parameter with Wilson intervals, and in all with one from resampled vehicles."""
    table = [inside(result) for result in results]
    held = np.array([list(row.values()) for row in table], dtype=float)
    low, high = bootstrap(held, lambda draws: draws.mean(axis=(1, 2)))
    errors = np.array([
        [(p["estimate"] - r["truth"][n]) / p["deviation"] for n, p in r["parameters"].items()] for r in results
    ])  # fmt: skip
    by_parameter = {}
    for i, name in enumerate(table[0]):
        count = int(held[:, i].sum())
        coverage, lowest, highest = binomial(count, len(held), "wilson")
        by_parameter[name] = {
            "coverage": coverage,
            "low": lowest,
            "high": highest,
            "error_rms_in_deviations": float(np.sqrt(np.mean(errors[:, i] ** 2))),
            "relative_deviation": float(
                np.median([r["parameters"][name]["deviation"] / max(abs(r["truth"][name]), 1e-9) for r in results])
            ),
        }
    seconds = [r["seconds"] for r in results]
    return {
        "vehicles": len(results),
        "coverage": float(held.mean()),
        "coverage_95": [float(low), float(high)],
        "by_parameter": by_parameter,
        "held_out_ratio_median": float(np.median([r["held_out_ratio"] for r in results])),
        "seconds_median": float(np.median(seconds)),
        "seconds_most": float(np.max(seconds)),
    }


def draw(found: dict[str, Any], path: Path) -> None:
    """Coverage by parameter as a picture."""
    figure = Figure(figsize=(7.0, 4.5), layout="constrained")
    ax = figure.subplots()
    names = list(found["by_parameter"])
    for i, name in enumerate(names):
        p = found["by_parameter"][name]
        ax.plot([p["low"], p["high"]], [i, i], color="#00798c", lw=2)
        ax.plot(p["coverage"], i, "o", color="#00798c", ms=5)
    ax.axvline(0.95, color="#222222", lw=0.8)
    ax.axvspan(*found["coverage_95"], color="#00798c", alpha=0.15, lw=0)
    ax.set_yticks(range(len(names)), names)
    ax.invert_yaxis()
    ax.set_xlim(0.6, 1.01)
    ax.set_xlabel(f"share of {found['vehicles']} vehicles whose truth lies in the 95 % interval")
    ax.spines[["top", "right"]].set_visible(False)
    write_figure(figure, path, dpi=150)


def main(config: Config) -> None:
    """Identifies the vehicles that are not done yet, and sums up."""
    folder = begun("identify_coverage", config)
    found: dict[str, Any] = {}
    for results in each_vehicle(folder, config, config.vehicles, one_vehicle):
        found = numbers(results)
        write_json(folder / "numbers.json", found)
    draw(found, folder / "coverage.png")
    low, high = found["coverage_95"]
    text = (
        f"{found['coverage']:.3f} of the 95 % intervals hold the truth (95 %: {low:.3f} to {high:.3f}), "
        f"{found['vehicles']} vehicles; {found['seconds_median']:.1f} s of CPU each in the median"
    )
    write_report(folder, text, config)


if __name__ == "__main__":
    run_command(main, Config, __doc__)
