"""Does the corrected simulator foretell how a controller does on the real car?

    python -m experiments.gap.corrected_loop --out runs/corrected_loop

Each vehicle has withheld effects (one, or a pair) and deviations from its file within tolerance. Its logs (four drives
of a Drake plant) are diagnosed and the answer is applied. Then the same controller, which believes the vehicle file,
drifts the figure-8 on the real car, on the simulator as it was, and on the corrected simulator. The real car drives it
a second time with other noise: no simulator can foretell a run better than the car itself repeats it. Answers are taken
as they come, right or wrong. Broken off, the experiment goes on where it was (give --out).
"""

import dataclasses
from collections.abc import Sequence
from functools import cache, partial
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullLocator, StrMethodFormatter
from scipy.stats import spearmanr
from tqdm import tqdm

from diagrams.command import run_command
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.step_model import NominalStepModel
from drift_drake.drive.loop.closed_loop import ClosedLoop
from drift_drake.drive.reference.trajectory import figure_8
from drift_drake.gap.diagnosis.answers.apply import corrected_vehicle
from drift_drake.gap.diagnosis.likelihood.diagnose import diagnose
from drift_drake.view.colours import REFERENCE, RUNS
from drift_drake.view.style import new_figure, save, styled
from experiments.benchmarks.drake_cases import drake_case
from experiments.benchmarks.intervals import bootstrap
from experiments.benchmarks.truths import Truth, drawn_truth, true_car
from experiments.made import RunConfig, begun, tabulated, write_results
from experiments.settings import kept

PREDICTORS = ("nominal", "corrected", "real again")
JUDGED = {"rms_e": "RMS e [m]", "rms_sideslip_error": "RMS sideslip error [rad]", "completion": "completion [-]"}
REAL_SEED, AGAIN_SEED, SIMULATOR_SEED = 0, 1, 2  # of the sensors' noise in the closed loop


@dataclasses.dataclass(frozen=True)
class CorrectedLoopConfig(RunConfig):
    """How many vehicles."""

    vehicles: int = 24
    pair_every: int = 3
    """Every so many vehicles has a pair of effects, the others a single one."""
    seed: int = 71_000
    """Of the vehicles' draws."""


def real_car(truth: Truth, vehicle: VehicleParameters) -> tuple[VehicleParameters, Effects]:
    """The car that a truth describes."""
    constants, effects = true_car(truth, vehicle)
    return vehicle.with_constants(constants), effects


def drift(believed: VehicleParameters, car: VehicleParameters, effects: Effects, seed: int) -> dict[str, Any]:
    """Numbers of one figure-8, from a drift on the reference, under a controller that believes the vehicle file."""
    loop = ClosedLoop(car, figure_8(believed), NominalStepModel(believed), effects)
    return dataclasses.asdict(loop.run(loop.initial_context(seed)).metrics())


@cache
def nominal_drift(vehicle: VehicleParameters) -> dict[str, Any]:
    """The same on the simulator as it was, which foretells the same of every car."""
    return drift(vehicle, vehicle, Effects(), SIMULATOR_SEED)


def one_vehicle(index: int, config: CorrectedLoopConfig) -> dict[str, Any]:
    """Logs, diagnosis, correction and the closed loops of one vehicle."""
    vehicle = VehicleParameters()
    rng = np.random.default_rng([config.seed, index])
    tier = "pair" if index % config.pair_every == config.pair_every - 1 else "tolerance"
    truth = drawn_truth(rng, tier, vehicle)
    answer = diagnose(drake_case(truth, vehicle, rng), vehicle, case=f"{index:03d}", workers=1).answer
    real = real_car(truth, vehicle)
    return {
        "vehicle": index,
        "tier": tier,
        "truth": dataclasses.asdict(truth),
        "said": "+".join(sorted(answer.causes)) or answer.verdict,
        "right": answer.verdict == "effect" and set(answer.causes) == set(truth.effects),
        "reduction": answer.reduction.estimate,
        "runs": {
            "real": drift(vehicle, *real, REAL_SEED),
            "real again": drift(vehicle, *real, AGAIN_SEED),
            "nominal": nominal_drift(vehicle),
            "corrected": drift(vehicle, *corrected_vehicle(vehicle, answer), SIMULATOR_SEED),
        },
    }


def values(results: Sequence[dict[str, Any]], run: str, name: str) -> np.ndarray:
    """One number of one run of all vehicles."""
    return np.array([result["runs"][run][name] for result in results], dtype=float)


def summarise(results: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """By predictor: rank correlation with the real car and median absolute error, with 95 % bootstrap intervals."""
    finished = values(results, "real", "completed")
    summary: dict[str, Any] = {
        "vehicles": len(results),
        "diagnosed right": sum(result["right"] for result in results),
        "completed on the real car": int(finished.sum()),
    }
    for predictor in PREDICTORS:
        entry: dict[str, Any] = {
            "completed": int(values(results, predictor, "completed").sum()),
            "completed or not, as the real car": float(np.mean(values(results, predictor, "completed") == finished)),
        }
        for name in JUDGED:
            real, predicted = values(results, "real", name), values(results, predictor, name)
            error = np.abs(predicted - real)
            low, high = bootstrap(error, lambda draws: np.median(draws, axis=1))
            varied = np.ptp(predicted) > 0.0 and np.ptp(real) > 0.0  # one simulator for all says nothing of ranks
            entry[name] = {
                "median absolute error": float(np.median(error)),
                "low": low,
                "high": high,
                "Spearman": float(spearmanr(real, predicted).statistic) if varied else float("nan"),
            }
        summary[predictor] = entry
    return summary


def table(summary: dict[str, Any]) -> str:
    """The summary as Markdown."""
    heads = ("predicted by", "median error of RMS e [m]", "of RMS sideslip error [rad]", "Spearman, RMS e",
             "completed or not, as the real car")  # fmt: skip
    rows = []
    for predictor in PREDICTORS:
        s = summary[predictor]
        cells = [f"{q['median absolute error']:.4f} ({q['low']:.4f} to {q['high']:.4f})"
                 for q in (s["rms_e"], s["rms_sideslip_error"])]  # fmt: skip
        rank = s["rms_e"]["Spearman"]
        cells.append("" if np.isnan(rank) else f"{rank:.2f}")
        cells.append(f"{s['completed or not, as the real car']:.0%}")
        rows.append((predictor, *cells))
    return "\n".join(tabulated(heads, rows))


@styled
def picture(results: Sequence[dict[str, Any]]) -> Figure:
    """Predicted against real, a vehicle a point; crosses where the real car did not complete the figure-8."""
    figure = new_figure(9.0, 3.4)
    axes = figure.subplots(1, len(JUDGED))
    completed = values(results, "real", "completed").astype(bool)
    for ax, (name, label) in zip(axes, JUDGED.items(), strict=True):
        real = values(results, "real", name)
        for predictor, color, size in (("nominal", RUNS[1], 16), ("corrected", RUNS[0], 22)):
            predicted = values(results, predictor, name)
            for chosen, marker, note in ((completed, "o", ""), (~completed, "x", ", the car failed")):
                if np.any(chosen):
                    ax.scatter(real[chosen], predicted[chosen], size, color, marker=marker, alpha=0.8, lw=1.0,
                               label=f"{predictor} simulator{note}")  # fmt: skip
        both = np.concatenate([values(results, run, name) for run in ("real", "nominal", "corrected")])
        if name == "completion":
            ends = (-0.03, 1.06)
        else:
            ends = (0.8 * both.min(), 1.25 * both.max())
            ax.set_xscale("log")
            ax.set_yscale("log")
            for axis in (ax.xaxis, ax.yaxis):
                axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
                axis.set_major_formatter(StrMethodFormatter("{x:g}"))
                axis.set_minor_locator(NullLocator())
        ax.plot(ends, ends, color=REFERENCE, lw=0.7, zorder=0)
        ax.set(xlim=ends, ylim=ends, aspect="equal", xlabel=f"real car: {label}", ylabel=f"simulator: {label}")
    axes[0].legend(loc="upper left", fontsize=6)
    return figure


def main(config: CorrectedLoopConfig) -> None:
    """Runs the vehicles that are missing, then writes numbers and the picture."""
    folder = begun("corrected_loop", config)
    results = [kept(folder / f"vehicle-{index:03d}.json", partial(one_vehicle, index, config))
               for index in tqdm(range(config.vehicles), unit="vehicle")]  # fmt: skip
    summary = summarise(results)
    save(picture(results), folder / "corrected_loop.png")
    write_results(folder, config, summary, table(summary))


if __name__ == "__main__":
    run_command(main, CorrectedLoopConfig)
