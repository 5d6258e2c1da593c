"""The paper's figures, of one vehicle each, with captions that name it."""

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.parameters import VehicleParameters
from drift_drake.common.arrays import Array
from drift_drake.common.safe_files import write_figure, write_text
from drift_drake.drive.gathering.config import lane
from drift_drake.drive.gathering.gather import drive_samples, taught
from drift_drake.drive.gathering.plan import InfeasiblePlanError, plan_again, plan_drive
from drift_drake.drive.learnt.checkpoint import BayesianModel, load_model
from drift_drake.drive.learnt.posterior import Posterior, covariance_norms
from drift_drake.drive.learnt.quality import learn
from drift_drake.drive.learnt.samples import Samples
from drift_drake.drive.mpc.plan import DT
from drift_drake.view.colours import REFERENCE, RUNS
from drift_drake.view.pictures.overhead import overhead
from drift_drake.view.pictures.time_series import time_series
from drift_drake.view.style import new_figure, styled
from experiments.benchmarks.vehicles import draw_effects
from experiments.drifting.ablations import driven_samples
from experiments.drifting.report import completed_of, pictured_models, pictured_vehicle
from experiments.drifting.runs import run_name
from experiments.gathering.beliefs import SECOND_ROUND
from experiments.gathering.recipe import Recipe, lane_for_pictures
from experiments.model.uncertainties import UNCERTAINTIES_AT, draw_uncertainties
from experiments.paper.claims import Evidence
from experiments.paper.parts import KINDS, Kind, PaperConfig, recipe

SHOWN = ("once_ocp", "once_info", "twice_info")
SAID: dict[Kind, str] = {"recipe": "the paper's recipe", "shipped": "as shipped"}


def vehicle_of(found: Evidence) -> int:
    """The vehicle that pictures are of: the one that the figure-8's are of, the first one without any."""
    runs = found.figure_8
    return pictured_vehicle(runs, pictured_models(runs, SHOWN)) if len(runs) else 0


class Taught:
    """The drives of one vehicle and what is believed after each."""

    def __init__(self, model: BayesianModel, options: Recipe, effects: Effects) -> None:
        config, prior = options.gathering, model.prior()
        self.model, self.config, self.effects = model, config, effects
        self.beliefs: dict[str, Posterior] = {"prior": prior}
        self.tables: dict[str, pd.DataFrame] = {}
        ocp, info = (plan_drive(model, prior, config, alpha) for alpha in (0.0, config.alpha))
        self._drive("Once-OCP", "OCP", prior, ocp, 0)
        once = self._drive("Once-Info", "Info-OCP", prior, info, 0)
        try:
            second = plan_again(model, once, info, config)
        except InfeasiblePlanError:
            return
        self._drive("Twice-Info", "second Info-OCP", once, second, SECOND_ROUND)

    def _drive(self, name: str, label: str, before: Posterior, plan: Any, seed: int) -> Posterior:
        found = taught(self.model, before, plan, self.effects, VehicleParameters(), self.config, seed)
        self.beliefs[name], self.tables[label] = found.belief, found.table
        return found.belief

    def samples(self, label: str) -> Samples:
        """Of a drive, as they are learnt from."""
        return drive_samples(self.tables[label], self.config)


def norm_over_time(model: BayesianModel, belief: Posterior, samples: Samples, every: int = 1) -> tuple[Array, Array]:
    """(times [n] [s], total norm [n]) as samples are learnt one after the other."""
    counts = np.arange(0, len(samples.x) + 1, every)
    norms = [covariance_norms(learn(model, belief, samples.where(np.arange(count))))[1] for count in counts]
    return DT * counts.astype(np.float64), np.array(norms, dtype=np.float64)


@styled
def norms_figure(curves: dict[str, tuple[Array, Array]]) -> Figure:
    """Total norm of the covariance over the time driven, a curve a way to learn."""
    figure = new_figure(6.5, 3.4)
    axes = figure.subplots()
    for (label, (t, norm)), colour in zip(curves.items(), (REFERENCE, *RUNS), strict=False):
        axes.plot(t, norm, color=colour, label=label)
    axes.set(yscale="log", xlabel="time driven [s]", ylabel="total norm of the covariance")
    axes.grid(alpha=0.3)
    axes.legend()
    return figure


def draw_drives(folder: Path, kind: Kind, found: Taught, vehicle: int, online: Path) -> list[tuple[str, str, str]]:
    """Figures of the drives and of what they teach: (file, alt text, caption)."""
    parameters, config = VehicleParameters(), found.config
    tables = {
        label: table.rename(columns={"delta_cmd": "delta", "tau_cmd": "tau"}) for label, table in found.tables.items()
    }
    whose = f"vehicle {vehicle}, sensors' seed 0, {SAID[kind]}"
    files = {name: f"{name}-{kind}.png" for name in ("drives", "drives_series", "predictions", "norms")}
    write_figure(overhead(tables, lane_for_pictures(config, tables.values()), parameters), folder / files["drives"])
    write_figure(time_series(tables, lane(config), parameters, against="t"), folder / files["drives_series"])
    beliefs = {name: belief for name, belief in found.beliefs.items() if name != "Once-OCP"}
    draw_uncertainties(found.model, beliefs, found.effects, whose, folder / files["predictions"])
    prior, once = found.beliefs["prior"], found.beliefs["Once-Info"]
    curves = {"straight drive (Once-OCP)": norm_over_time(found.model, prior, found.samples("OCP"))}
    curves["first informative drive"] = norm_over_time(found.model, prior, found.samples("Info-OCP"))
    if "second Info-OCP" in found.tables:
        first = curves["first informative drive"][0][-1]
        t, norm = norm_over_time(found.model, once, found.samples("second Info-OCP"))
        curves["second informative drive"] = first + t, norm
    if online.exists():
        t, norm = norm_over_time(found.model, prior, driven_samples(online), 5)
        curves["adapting on the loops"] = t, norm
    write_figure(norms_figure(curves), folder / files["norms"])
    at = ", ".join(f"{name} {value:g}" for name, value in UNCERTAINTIES_AT.items())
    return [
        (files["drives"], "The straight and both informative drives from above",
         f"Nominal and information gathering trajectories from above; {whose}. See how far each leaves the line."),
        (files["drives_series"], "States and inputs of the three drives over time",
         f"The same over time; {whose}. See the yaw rate, the steering and the torque."),
        (files["predictions"], "Predicted change of each state over the steering angle, with the true car's",
         f"Mean, 3 standard deviations of one step at {at}; {whose}. See whether the band closes on the true curve."),
        (files["norms"], "Total norm of the covariance falling over the time driven",
         f"Adaptation of the covariance's norm; {whose}. See which drive lowers it, and how soon."),
    ]  # fmt: skip


def draw_runs(folder: Path, kind: Kind, runs: pd.DataFrame, source: str) -> list[tuple[str, str, str]]:
    """Figures that the figure-8 and the loops have drawn: (file, alt text, caption)."""
    where = folder.parent / source / kind
    models = ("online", "twice_info") if source == "loops" else SHOWN
    if runs.empty or not (where / "time_series.png").exists():
        return []
    vehicle = pictured_vehicle(runs, pictured_models(runs, models))
    name = "figure-8" if source == "figure_8" else "loops"
    count = completed_of(runs, models)["vehicle"].nunique()
    whose = f"{SAID[kind]}; of {runs['vehicle'].nunique()} vehicles, {count} completed by one of the models"
    prefix = f"../{source}/{kind}"
    return [
        (f"{prefix}/overhead.png", f"All runs of the {name} from above, a panel a model",
         f"The {name} from above, all vehicles, the median run of vehicle {vehicle} in colours; {whose}. See where "
         "runs leave the path."),
        (f"{prefix}/time_series.png", f"Sideslip, speed, lateral error and inputs along the {name}",
         f"Each model's median completed run of vehicle {vehicle} along the {name}, transitions in grey; {whose}. See "
         "the sideslip after each transition."),
    ]  # fmt: skip


def draw_all(folder: Path, config: PaperConfig, found: dict[Kind, Evidence]) -> None:
    """Draws into `figures`; captions.md there is the section of the page that shows them."""
    out = folder / "figures"
    out.mkdir(exist_ok=True)
    shown: list[tuple[str, str, str]] = []
    for kind in KINDS:
        vehicle = vehicle_of(found[kind])
        options = Recipe(**recipe(config, kind, folder)).resolved()
        effects = draw_effects(config.population, vehicle, config.vehicle_seed)
        online = folder / "loops" / kind / f"{run_name('online', vehicle, 0)}.csv"
        driven = Taught(load_model(options.checkpoint), options, effects)
        shown += draw_drives(out, kind, driven, vehicle, online)
        shown += draw_runs(out, kind, found[kind].figure_8, "figure_8")
        shown += draw_runs(out, kind, found[kind].loops, "loops")
    seed = f"Vehicles of the population {config.population}, vehicle seed {config.vehicle_seed}."
    parts = [f"![{alt}](figures/{file})\n*{caption}*" for file, alt, caption in shown]
    text = "\n\n".join([seed, *parts]).replace("figures/../", "")
    write_text(out / "captions.md", text + "\n")
