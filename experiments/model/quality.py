"""How good the Bayesian vehicle model is on vehicles it has never seen.

    python -m experiments.model.quality --drives runs/drives

On held-out vehicles of the training distribution and of a wider one: one-step error, likelihood and coverage against
the number of samples adapted to, rollouts of 0.5 s and 2 s under the recorded commands; compared with the nominal car,
a network of the same size that never adapts, the paper's plain recipe, and the same model without adaptation (0
points). The figure "uncertainties" lays the true vehicle's curve over the model's mean and 3 sigma. Writes numbers
(JSON) and figures (PNG).
"""

import dataclasses
from pathlib import Path
from typing import Any

import matplotlib

from diagrams.command import run_command

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from drift_drake.car.step_model import NominalStepModel
from drift_drake.common.safe_files import write_figure
from drift_drake.drive.learnt.checkpoint import BayesianModel, load_model
from drift_drake.drive.learnt.posterior import covariance_norms
from drift_drake.drive.learnt.quality import Split, adapted, split_vehicle, standardized_errors, step_model
from drift_drake.drive.learnt.samples import concatenate, load_samples
from experiments.benchmarks.vehicles import Population, draw_effects
from experiments.made import RunConfig, begun, tabulated, write_results
from experiments.model.judging import (
    GAUSSIAN_COVERAGE,
    judge_stepper,
    quality_by_points,
    rollout_errors,
    rollout_summary,
)
from experiments.model.uncertainties import draw_uncertainties

POINTS = (0, 1, 2, 5, 10, 20, 50, 100)
REPORTED = (0, 10, 100)  # of them, in the table
HORIZONS = (5, 20)  # steps of 0.1 s
STATES = ("r [rad/s]", "v [m/s]", "beta [rad]", "omega_r [m/s]")
POPULATIONS: tuple[Population, ...] = ("held_out", "wide")
TITLES = {"held_out": "held-out vehicles", "wide": "wider distribution"}


@dataclasses.dataclass(frozen=True)
class QualityConfig(RunConfig):
    """What to judge."""

    drives: Path = Path("runs/drives")  # made by `experiments.model.drives`
    model: Path | None = None  # checkpoint; without, the shipped one
    plain: Path | None = Path("drift_drake/data/bayesian_model_paper.npz")  # the paper's recipe
    fixed: Path | None = Path("drift_drake/data/fixed_model.npz")  # the network that never adapts
    example: int = 0  # which vehicle of each population the figure "uncertainties" shows
    drives_seed: int = 0  # that the drives were made with


def run(config: QualityConfig) -> dict[str, Any]:
    """All numbers."""
    models = {"Bayesian": load_model(config.model)}
    if config.plain is not None:
        models["paper's recipe"] = load_model(config.plain)
    result: dict[str, Any] = {"points": POINTS, "gaussian_coverage": GAUSSIAN_COVERAGE}
    for population in POPULATIONS:
        samples = load_samples(config.drives / f"{population}.npz")
        splits = [split_vehicle(samples.of_vehicle(vehicle), max(POINTS)) for vehicle in np.unique(samples.vehicle)]
        found: dict[str, Any] = {"vehicles": len(splits), "judged": sum(len(d.x) for s in splits for d in s.judged)}
        for name, model in models.items():
            found[name] = quality_by_points(model, splits, POINTS, HORIZONS)
        if config.fixed is not None:
            found["fixed network"] = quality_by_points(load_model(config.fixed), splits, (0,), HORIZONS)["0"]
        car = models["Bayesian"].vehicle
        found["nominal car"] = judge_stepper(NominalStepModel(car), splits, HORIZONS)
        found["path_step"] = _path_steps(models["Bayesian"], splits)
        found["mahalanobis"] = _distances(models["Bayesian"], splits)
        found["covariance_norms"] = _norms(models["Bayesian"], splits)
        result[population] = found
    return result


def _path_steps(model: BayesianModel, splits: list[Split]) -> dict[str, Any]:
    """e and dphi after 0.5 s and 2 s, by the rule that steps them, on drives along a path, after 100 points."""
    result: dict[str, Any] = {}
    for rule in ("euler", "trapezoid"):
        for steps in HORIZONS:
            errors = []
            for split in splits:
                on_path = [drive for drive in split.judged if np.any(drive.curvature != 0.0)]
                stepper = step_model(model, adapted(model, split.adaptation), rule)
                errors.append(rollout_errors(stepper, on_path, steps))
            result[f"{rule}_{steps}"] = {key: values[4:] for key, values in rollout_summary(errors).items()}
    return result


def _distances(model: BayesianModel, splits: list[Split]) -> dict[str, list[float]]:
    """Quantiles (50, 95, 99, 99.9 %) of the Mahalanobis distance before and after adaptation."""
    found: dict[str, list[float]] = {}
    for name, count in (("before", 0), ("after", max(POINTS))):
        distances = []
        for split in splits:
            posterior = adapted(model, split.adaptation.where(np.arange(count)))
            error, deviation = standardized_errors(model, posterior, concatenate(split.judged))
            distances.append(np.sqrt(np.sum((error / deviation) ** 2, axis=1)))
        found[name] = np.quantile(np.concatenate(distances), [0.5, 0.95, 0.99, 0.999]).tolist()
    return found


def _norms(model: BayesianModel, splits: list[Split]) -> dict[str, list[float]]:
    """Median over vehicles of ||Lambda_i^{-1}||_2 by state against points."""
    return {
        str(count): np.median(
            [covariance_norms(adapted(model, s.adaptation.where(np.arange(count))))[0] for s in splits], axis=0
        ).tolist()
        for count in POINTS
    }


def _draw_uncertainties(config: QualityConfig, model: BayesianModel, population: Population, file: Path) -> None:
    """The figure "uncertainties" of the example vehicle, before and after adaptation."""
    samples = load_samples(config.drives / f"{population}.npz").of_vehicle(config.example)
    after = adapted(model, split_vehicle(samples, max(POINTS)).adaptation)
    effects = draw_effects(population, config.example, config.drives_seed)
    title = f"vehicle {config.example} of the {TITLES[population]}"
    draw_uncertainties(model, {"prior": model.prior(), "100 points": after}, effects, title, file)


def table(result: dict[str, Any], population: Population) -> str:
    """One-step RMS errors of a population's vehicles, as Markdown."""
    found = result[population]
    rows = {"nominal car (RK4)": found["nominal car"]["rms"]}
    if "fixed network" in found:
        rows["network of the same size that never adapts"] = found["fixed network"]["rms"]
    for name in ("Bayesian", "paper's recipe"):
        for count in REPORTED if name in found else ():
            rows[f"{name}, {f'after {count} points' if count else 'not adapted'}"] = found[name][str(count)]["rms"]
    cells = [(name, *(f"{error:.2g}" for error in errors[:4])) for name, errors in rows.items()]
    return "\n".join(tabulated((TITLES[population], *STATES), cells))


def draw_errors(result: dict[str, Any], file: Path) -> None:
    """One-step error of each state against adaptation points."""
    figure, axes = plt.subplots(2, 4, figsize=(15, 6.5), constrained_layout=True, sharex=True)
    for row, population in enumerate(POPULATIONS):
        found = result[population]
        for i, axis in enumerate(axes[row]):
            for name, colour in (("Bayesian", "tab:blue"), ("paper's recipe", "tab:orange")):
                if name in found:
                    values = [found[name][str(count)]["rms"][i] for count in POINTS]
                    axis.plot(range(len(POINTS)), values, "o-", color=colour, label=name)
            for name, style in (("fixed network", "g--"), ("nominal car", "r:")):
                if name in found:
                    axis.axhline(found[name]["rms"][i], color=style[0], ls=style[1:], label=name)
            axis.set_ylim(bottom=0.0)
            axis.set_xticks(range(len(POINTS)), [str(count) for count in POINTS])
            axis.grid(alpha=0.3)
            axis.set_title(f"{STATES[i]}, {TITLES[population]}", fontsize=9)
    for axis in axes[1]:
        axis.set_xlabel("adaptation points")
    axes[0, 0].set_ylabel("one-step RMS error")
    axes[1, 0].set_ylabel("one-step RMS error")
    axes[0, 0].legend(fontsize=8)
    write_figure(figure, file, dpi=130)
    plt.close(figure)


def draw_coverage(result: dict[str, Any], file: Path) -> None:
    """Coverage of 1, 2 and 3 sigma against adaptation points, all four states."""
    figure, axes = plt.subplots(2, 2, figsize=(11, 7), constrained_layout=True, sharex=True, sharey=True)
    for row, population in enumerate(POPULATIONS):
        for axis, name in zip(axes[row], ("Bayesian", "paper's recipe"), strict=True):
            if name not in result[population]:
                continue
            for k, style in enumerate(("-", "--", ":")):
                axis.axhline(GAUSSIAN_COVERAGE[k], color="k", lw=0.8, ls=style)
                for i, state in enumerate(STATES):
                    values = [result[population][name][str(count)]["coverage"][k][i] for count in POINTS]
                    axis.plot(range(len(POINTS)), values, style, color=f"C{i}", label=state if k == 0 else None)
            axis.set_xticks(range(len(POINTS)), [str(count) for count in POINTS])
            axis.set_title(f"{name}, {TITLES[population]}", fontsize=9)
            axis.grid(alpha=0.3)
    for axis in axes[1]:
        axis.set_xlabel("adaptation points")
    for axis in axes[:, 0]:
        axis.set_ylabel("share within 1, 2, 3 s.d. (black: Gaussian)")
    axes[0, 0].legend(fontsize=8)
    write_figure(figure, file, dpi=130)
    plt.close(figure)


def draw_rollouts(result: dict[str, Any], file: Path) -> None:
    """Median rollout errors after 0.5 s and 2 s."""
    figure, axes = plt.subplots(2, 4, figsize=(15, 6.5), constrained_layout=True)
    for row, population in enumerate(POPULATIONS):
        found = result[population]
        bars = {
            "nominal car": found["nominal car"],
            **({"fixed network": found["fixed network"]} if "fixed network" in found else {}),
            "not adapted": found["Bayesian"]["0"],
            "10 points": found["Bayesian"]["10"],
            "100 points": found["Bayesian"]["100"],
        }
        for i, axis in enumerate(axes[row]):
            for k, steps in enumerate(HORIZONS):
                values = [entry[f"rollout_{steps}"]["median"][i] for entry in bars.values()]
                axis.bar(np.arange(len(bars)) + 0.4 * k - 0.2, values, 0.4, label=f"{steps / 10:g} s")
            axis.set_xticks(range(len(bars)), list(bars), rotation=30, fontsize=7)
            axis.set_yscale("log")
            axis.grid(alpha=0.3, axis="y")
            axis.set_title(f"{STATES[i]}, {TITLES[population]}", fontsize=9)
    axes[0, 0].set_ylabel("median rollout error")
    axes[1, 0].set_ylabel("median rollout error")
    axes[0, 0].legend(fontsize=8)
    write_figure(figure, file, dpi=130)
    plt.close(figure)


def main(config: QualityConfig) -> None:
    """Writes the run folder."""
    folder = begun("model_quality", config)
    result = run(config)
    text = "\n\n".join(table(result, population) for population in POPULATIONS)
    write_results(folder, config, result, text)
    draw_errors(result, folder / "one_step_errors.png")
    draw_coverage(result, folder / "coverage.png")
    draw_rollouts(result, folder / "rollouts.png")
    model = load_model(config.model)
    for population in POPULATIONS:
        _draw_uncertainties(config, model, population, folder / f"uncertainties_{population}.png")


if __name__ == "__main__":
    run_command(main, QualityConfig)
