"""What a gap is, and how causes are distinguished: prediction errors of three simulators of one simulated log."""

import dataclasses
from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from scipy.optimize import minimize_scalar

from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.car.effects.magnitudes import make_effects
from drift_drake.car.parameters import VehicleParameters
from drift_drake.common.arrays import Array
from drift_drake.common.errors import significant
from drift_drake.gap.estimation.windows import WindowedRun, run_errors, windowed
from drift_drake.view.colours import CARS
from drift_drake.view.style import DEGREES, new_figure
from experiments.benchmarks.compiled_cases import make_case
from experiments.benchmarks.truths import Truth
from experiments.pictures.look import PINK, WIDTH, for_pages

HEIGHT = 6.0  # [in]
TRUTH = {"steering_lag": 0.1}  # what the car has and its simulator lacks [s]
CANDIDATES = ("friction_level", "steering_lag")
YAW_RATE = 0  # of the errors' channels
FARTHEST = -1  # of the horizons: half a second


@dataclasses.dataclass(frozen=True)
class Corrected:
    """A candidate with the magnitude that fits best: yaw rate errors [n] [rad/s], share of their squares removed."""

    name: str
    magnitude: float
    errors: Array
    removed: float


def yaw_rate_errors(run: WindowedRun, car: VehicleParameters, effects: dict[str, float]) -> Array:
    """Measured less predicted, half a second ahead, of each window [n] [rad/s]."""
    return run_errors(run, car.constants(), make_effects(effects))[:, FARTHEST, YAW_RATE]


def best(run: WindowedRun, car: VehicleParameters, name: str) -> Corrected:
    """A candidate, its magnitude fitted within the practical range."""
    low, high = CATALOGUE[name].range_for(car)
    before = yaw_rate_errors(run, car, {})
    found = minimize_scalar(lambda q: float(np.sum(yaw_rate_errors(run, car, {name: float(q)}) ** 2)),
                            bounds=(low, high), method="bounded", options={"xatol": 1e-4})  # fmt: skip
    return Corrected(name, float(found.x), yaw_rate_errors(run, car, {name: float(found.x)}),
                     1.0 - float(found.fun) / float(np.sum(before**2)))  # fmt: skip


def compared() -> tuple[Array, Array, list[Corrected]]:
    """Times [n] [s], errors of the simulator [n] [rad/s], and the candidates."""
    car = VehicleParameters()
    (log,) = make_case(Truth(TRUTH, {}, {}), car, np.random.default_rng(3), manoeuvres=("slalom",))
    run = windowed(log)
    times = (run.starts + run.stride_rows * len(run.horizons)) * run.period
    return times, yaw_rate_errors(run, car, {}), [best(run, car, name) for name in CANDIDATES]


def titles(candidates: Sequence[Corrected]) -> list[str]:
    """Of the panels."""
    shown = [f"with {c.name} {significant(c.magnitude, 2)}{CATALOGUE[c.name].suffix}\n"
             f"removes {100 * c.removed:.0f} % of the squared errors" for c in candidates]  # fmt: skip
    return ["the simulator as it is: there is a gap", *shown]


@for_pages
def draw() -> Figure:
    """A panel for the simulator, and one for each candidate."""
    t, before, candidates = compared()
    figure = new_figure(WIDTH, HEIGHT)
    grid = figure.subplots(1 + len(candidates), 1, sharex=True, sharey=True)
    colours = [CARS["nominal"], PINK, CARS["corrected"]]
    errors = [before, *(candidate.errors for candidate in candidates)]
    for axes, values, title, colour in zip(grid, errors, titles(candidates), colours, strict=True):
        axes.vlines(t, 0.0, values * DEGREES, color=colour, linewidth=1.6)
        axes.plot(t, values * DEGREES, "o", color=colour, markersize=4)
        axes.set_title(title)
        axes.margins(x=0.02)
    grid[1].set_ylabel("yaw rate: measured $-$ predicted [deg/s]")
    grid[-1].set_xlabel("time [s]")
    return figure
