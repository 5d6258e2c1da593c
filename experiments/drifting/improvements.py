"""From the paper's recipe to the shipped model, one improvement added at a time, on the figure-8 or the loops.

    python -m experiments.drifting.improvements --vehicle-seed 890417 --vehicles 8
    python -m experiments.drifting.improvements --maneuver loops --models online twice_info --vehicles 4

The same attempts for all rungs of the ladder; what is switched is what needs no training. Written: config.json, a
folder of runs a rung, runs.csv, numbers.json, report.md, improvements.png. The vehicles are driven one after the other,
all rungs of each, so that what is done is balanced; broken off, it goes on where it was (give --out).
"""

import dataclasses
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from diagrams.command import run_command
from drift_drake.common.errors import InvalidOptionError
from drift_drake.common.run_folder import make_run_folder
from drift_drake.common.safe_files import write_figure, write_table
from drift_drake.drive.gathering.config import GatheringConfig
from drift_drake.drive.learnt.adapter import DEFAULT_THRESHOLD
from drift_drake.drive.learnt.bayesian_step import PathStep
from drift_drake.drive.learnt.checkpoint import load_model, paper_checkpoint
from drift_drake.drive.loop.closed_loop import ControlConfig
from drift_drake.view.colours import INK, RUNS
from drift_drake.view.style import BOUND, new_figure, styled
from experiments.benchmarks.vehicles import Population
from experiments.drifting.report import LABELS, completion_table, differences_table, pair_of, summarise
from experiments.drifting.runs import BELIEFS, EXTRAS, Maneuver, Model, ModelsConfig, opened, paper_control, run_models
from experiments.gathering.recipe import Extra, as_in_paper
from experiments.made import RunConfig, SpreadConfig, tabulated, write_results
from experiments.settings import keep_settings

PREDICTING: tuple[Model, ...] = ("prior", "once_ocp", "once_info", "twice_info")
DRIVING: tuple[Model, ...] = (*PREDICTING, "online")


@dataclasses.dataclass(frozen=True)
class ImprovementsConfig(SpreadConfig, RunConfig):
    """Which vehicles."""

    vehicles: int = 6
    first: int = 0  # index of the first vehicle of the population
    population: Population = "held_out"
    maneuver: Maneuver = "figure_8"
    noise_seeds: int = 1  # attempts of each vehicle
    vehicle_seed: int = 0  # of the draw of the vehicles
    models: tuple[Model, ...] = (*PREDICTING, "online", "twice_online")
    """Of each rung, as far as it changes them."""
    between: tuple[Path, ...] = ()
    """Checkpoints of recipes between the paper's and the shipped one: a rung each, with the shipped gathering."""
    rungs: tuple[str, ...] = ()
    """Names of the rungs to drive (a checkpoint's is that of its file); without, all."""


class Rung(NamedTuple):
    """A step of the ladder: what is added to the one before, and the models whose runs that may change."""

    name: str  # of its folder
    what: str
    models: tuple[Model, ...]
    learnt: str  # "paper", "shipped" or the name of a checkpoint between the two
    gathering: GatheringConfig
    path_step: PathStep
    keep: tuple[Extra, ...] = EXTRAS  # of what the paper's controller has not


def ladder(between: Sequence[str] = ()) -> list[Rung]:
    """All rungs, from the paper's recipe on; only the one that leaves the paper's model goes back to its gathering.

    Args:
        between: names of the models between the two.
    """
    change = dataclasses.replace
    paper, shipped = as_in_paper(GatheringConfig()), change(GatheringConfig(), learn_lags=False)
    # Within the bounds plans bear a greater weight, and one that has not converged is still a car's motion.
    kept = change(paper, qp=shipped.qp)
    bounded = change(kept, bounded=True, ends_straight=True, alpha=shipped.alpha, only_converged=False)
    weighed = change(bounded, fixed_alpha=False)
    for_drifts = change(weighed, objective_later="drifts")
    rungs = [
        Rung("paper", "as in the paper", DRIVING, "paper", paper, "euler", ()),
        Rung("extras", "+ screen, gate, fresh guesses, delay, safe stop, interior point", DRIVING, "paper", kept,
             "euler"),
        Rung("bounds", "+ plans bounded, ending straight, of more weight", PREDICTING[2:], "paper", bounded, "euler"),
        Rung("weights", "+ a later round's information weighed anew", PREDICTING[3:], "paper", weighed, "euler"),
        Rung("drifts", "+ later rounds planned for drifts", PREDICTING[3:], "paper", for_drifts, "euler"),
        Rung("plans", "+ the learnt car's path in plans: the shipped gathering", PREDICTING[1:], "paper", shipped,
             "euler"),
        Rung("control", "+ the learnt car's path in the controller", DRIVING, "paper", shipped, "trapezoid"),
    ]  # fmt: skip
    rungs += [Rung(name, f"the model {name}", DRIVING, name, shipped, "trapezoid") for name in between]
    return [
        *rungs,
        Rung("model", "the shipped model, the paper's gathering", DRIVING, "shipped", kept, "trapezoid"),
        Rung("shipped", "the shipped model and gathering", (*PREDICTING[1:], "twice_online"), "shipped", shipped,
             "trapezoid"),
        Rung("lags", "+ the lags that make the drives likeliest", (*DRIVING[2:], "twice_online"), "shipped",
             GatheringConfig(), "trapezoid"),
    ]  # fmt: skip


def names_between(config: ImprovementsConfig) -> dict[str, Path]:
    """The checkpoints between the two models, by the names of their rungs.

    Raises:
        InvalidOptionError: two rungs of one name, or a rung that there is not.
    """
    found = {path.stem: path for path in config.between}
    names = [rung.name for rung in ladder()] + [path.stem for path in config.between]
    twice = {name for name in names if names.count(name) > 1}
    if twice:
        raise InvalidOptionError(f"--between: {', '.join(sorted(twice))} names two rungs; rename the file")
    unknown = [name for name in config.rungs if name not in names]
    if unknown:
        raise InvalidOptionError(f"--rungs {' '.join(unknown)}: give some of {', '.join(names)}")
    return found


def of_models(rungs: Sequence[Rung], models: Sequence[Model]) -> list[Rung]:
    """The rungs that change one of the models, with these alone."""
    kept = [rung._replace(models=tuple(model for model in rung.models if model in models)) for rung in rungs]
    return [rung for rung in kept if rung.models]


def checkpoints(config: ImprovementsConfig, folder: Path) -> dict[str, Path | None]:
    """Each rung's model as a file.

    The paper's names no drifts to plan for, and a model between the two perhaps none; they are given the shipped one's,
    which are samples of drives, not numbers of a network.
    """
    found: dict[str, Path | None] = {"shipped": None}
    for name, path in {"paper": paper_checkpoint(), **names_between(config)}.items():
        model = load_model(path)
        found[name] = folder / f"{name}.npz"
        dataclasses.replace(model, drifts=load_model().drifts).save(folder / f"{name}.npz")
    return found


def rung_config(config: ImprovementsConfig, rung: Rung, checkpoint: Path | None, folder: Path) -> ModelsConfig:
    """What `figure_8` would be asked for, with its runs in a folder of the rung's own."""
    control, gate = paper_control(ControlConfig(), DEFAULT_THRESHOLD, rung.keep)
    return ModelsConfig(
        checkpoint=checkpoint, control=control, gate=gate, gathering=rung.gathering, path_step=rung.path_step,
        models=rung.models, vehicles=config.vehicles, first=config.first, population=config.population,
        noise_seeds=config.noise_seeds, vehicle_seed=config.vehicle_seed, run_on=config.run_on, out=folder / rung.name,
    )  # fmt: skip


def drive_ladder(config: ImprovementsConfig, rungs: Sequence[Rung], folder: Path) -> pd.DataFrame:
    """All rungs on all vehicles, one row a run, with a column `rung`."""
    files = checkpoints(config, folder)
    settings = {rung.name: rung_config(config, rung, files[rung.learnt], folder) for rung in rungs}
    for name, rung in settings.items():
        opened(name, rung)
        wanted = frozenset(BELIEFS[model] for model in rung.models if model in BELIEFS)
        rung.gathered(wanted, load_model(rung.checkpoint), folder / name)  # for all vehicles, so that plans are shared
    for vehicle in range(config.first, config.first + config.vehicles):
        for name, rung in settings.items():
            run_models(dataclasses.replace(rung, first=vehicle, vehicles=1), config.maneuver, folder / name)
    runs = [run_models(rung, config.maneuver, folder / name).assign(rung=name) for name, rung in settings.items()]
    return pd.concat(runs, ignore_index=True)


def summarise_ladder(runs: pd.DataFrame) -> dict[str, dict[str, Any]]:
    """`summarise` of each rung's runs."""
    return {str(name): summarise(group) for name, group in runs.groupby("rung", sort=False)}


def medians_table(rungs: Sequence[Rung], summary: dict[str, dict[str, Any]]) -> str:
    """RMS e and runs completed by rung and model, as Markdown; empty where a rung changes nothing for a model."""
    models = list(dict.fromkeys(model for rung in rungs for model in rung.models))
    heads = ("median RMS e [m], completed", *(LABELS[model] for model in models))
    rows = [(rung.what, *(_cell(summary[rung.name][model]) if model in summary[rung.name] else "" for model in models))
            for rung in rungs]  # fmt: skip
    return "\n".join(tabulated(heads, rows))


def _cell(entry: dict[str, Any]) -> str:
    median = entry["rms_e"]["median"]
    said = f"{median:.2f}" if np.isfinite(median) else "-"
    return f"{said}, {round(entry['completed'] * entry['runs'])} of {entry['runs']}"


def steps_table(rungs: Sequence[Rung], runs: pd.DataFrame, model: Model) -> str:
    """Each rung less the one before, as far as they have the model, as Markdown; empty with fewer than two."""
    having, of_model = [rung for rung in rungs if model in rung.models], runs[runs["model"] == model]
    rows = [(rung.what, *pair_of(of_model, "rung", rung.name, before.name)) for before, rung in pairwise(having)]
    return f"### {LABELS[model]}: each less the one before\n\n{differences_table(rows)}" if rows else ""


def markdown(rungs: Sequence[Rung], runs: pd.DataFrame, summary: dict[str, dict[str, Any]]) -> str:
    """The report."""
    models = dict.fromkeys(model for rung in rungs for model in rung.models)
    parts = [medians_table(rungs, summary), *filter(None, (steps_table(rungs, runs, model) for model in models))]
    parts += [f"### {rung.what}\n\n{completion_table(summary[rung.name])}" for rung in rungs]
    return "\n\n".join(parts) + "\n"


@styled
def picture(rungs: Sequence[Rung], runs: pd.DataFrame, model: Model = "twice_info") -> Any:
    """RMS e of each attempt by rung; crosses at the right: not completed, behind all others."""
    rungs = [rung for rung in rungs if model in rung.models]
    figure = new_figure(7.5, 0.7 + 0.45 * len(rungs))
    axes = figure.subplots()
    behind = 1.5 * float(runs["rms_e"].where(runs["completed"]).max())
    for row, rung in enumerate(rungs):
        group = runs[(runs["rung"] == rung.name) & (runs["model"] == model)].sort_values(["vehicle", "noise_seed"])
        shift = np.linspace(-0.25, 0.25, len(group)) if len(group) > 1 else np.zeros(1)
        done, y = group["completed"].to_numpy(dtype=bool), row + shift
        axes.plot(group["rms_e"][done], y[done], "o", color=RUNS[0], markersize=4)
        axes.plot(np.full(np.sum(~done), behind), y[~done], "x", color=BOUND, markersize=5)
        ranked = np.sort(group["rms_e"].where(group["completed"], np.inf).to_numpy(dtype=float))
        median = float(np.quantile(ranked, 0.5, method="linear" if np.isfinite(ranked).all() else "higher"))
        if np.isfinite(median):
            axes.plot([median] * 2, [row - 0.35, row + 0.35], color=INK)
    axes.set_yticks(range(len(rungs)), [rung.what for rung in rungs])
    axes.invert_yaxis()
    axes.set(xscale="log", xlabel=f"RMS e with {LABELS[model]} [m], a mark an attempt, x: not completed, line: median")
    return figure


def main(config: ImprovementsConfig) -> None:
    """Runs what is missing, then writes numbers, the report and the picture."""
    folder = make_run_folder("improvements", config.out)
    between = {name: load_model(path).content_hash() for name, path in names_between(config).items()}
    free = ("vehicles", "first", "models", "between", "between_hash", "rungs", "run_on", "out")
    keep_settings(folder, dataclasses.asdict(config) | {"between_hash": between}, free)
    rungs = [rung for rung in ladder(list(between)) if not config.rungs or rung.name in config.rungs]
    rungs = of_models(rungs, config.models)
    runs = drive_ladder(config, rungs, folder)
    write_table(runs, folder / "runs.csv", index=False)
    summary = summarise_ladder(runs)
    write_results(folder, config, summary, markdown(rungs, runs, summary))
    pictured = "twice_info" if "twice_info" in config.models else config.models[0]
    write_figure(picture(rungs, runs, pictured), folder / "improvements.png")


if __name__ == "__main__":
    run_command(main, ImprovementsConfig)
