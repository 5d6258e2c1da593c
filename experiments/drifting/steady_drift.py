"""What the models believe of the steady drift that the figure-8 wants: the inputs that hold it, and what they do there.

    python -m experiments.drifting.steady_drift                                  # 10 validation vehicles
    python -m experiments.drifting.steady_drift --population train --first 200   # others

The reference is planned on the nominal car, whose front tyre grips. On many a vehicle it slides in that drift; there
steering turns the car little, and a model that has not learnt so steers where it should use the torque. For each
vehicle: the steady state at the figure-8's radius and sideslip, and by how much the yaw rate and the rim speed have
changed 0.3 s after a step of 0.1 rad of steering or of 30 N m of torque: of the true car, and as believed.
Broken off, it goes on where it was (give --out).
"""

import dataclasses
from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy.optimize import least_squares

from diagrams.command import run_command
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.single_track.effects_step import EffectsStepModel
from drift_drake.car.step_model import NominalStepModel, StepModel
from drift_drake.common.arrays import Array
from drift_drake.common.run_folder import write_json
from drift_drake.drive.learnt.checkpoint import load_model
from drift_drake.drive.learnt.quality import step_model
from drift_drake.drive.reference.equilibrium import DriftEquilibrium, drift_equilibrium
from experiments.benchmarks.vehicles import Population
from experiments.drifting.runs import DriftConfig, opened
from experiments.made import tabulated, write_report

RADIUS, SIDESLIP = 18.0, 0.6  # of `figure_8`
STEPS = 3  # of 0.1 s after which the response is read
INPUT_STEP = np.array([0.1, 30.0])  # [rad], [N m]
TOLERANCE = 1e-3  # on what a steady state changes by in a step, SI
MEMORY_PASSES = 30  # steps in which the states beyond the six settle for a first guess


@dataclasses.dataclass(frozen=True)
class SteadyDriftConfig(DriftConfig):
    """Which vehicles."""

    vehicles: int = 10
    population: Population = "validation"
    noise_seeds: int = 1


class SteadyDrift(NamedTuple):
    """A steady state of a one-step model, and the response to constant changes of the inputs there."""

    v: float  # [m/s]
    omega_r: float  # [m/s]
    delta: float  # [rad]
    tau: float  # [N m]
    residual: float  # largest change of a state in one step: not small where the model has no such state
    yaw_rate_by_steering: float  # [rad/s] after 0.1 rad for 0.3 s
    yaw_rate_by_torque: float  # [rad/s] after 30 N m for 0.3 s
    rim_speed_by_torque: float  # [m/s]


def steady_drift(model: StepModel, start: DriftEquilibrium) -> SteadyDrift:
    """The steady state of a model at the sideslip and on the circle of another car's, searched from that one.

    Unknown are r, v, omega_r, dphi, the inputs and the model's further states; e is zero.
    """
    curvature = np.array([start.curvature])
    count = 6 + model.internal_scale.size
    unknown = [0, 1, 3, 5, *range(6, count)]
    scale = np.concatenate([[0.5, 10.0, 15.0, 0.3], model.internal_scale, [0.3, 100.0]])

    def point(q: Array) -> tuple[Array, Array]:
        x = np.zeros(count)
        x[2], x[unknown] = start.beta, (q * scale)[:-2]
        return x[None], (q * scale)[None, -2:]

    def change(q: Array) -> Array:
        x, u = point(q)
        return np.asarray((model.step(x, u, u, curvature) - x)[0])

    def jacobian(q: Array) -> Array:
        x, u = point(q)
        _, a, b, b_next = model.linearize(x, u, u, curvature)
        return np.asarray(np.hstack([(a[0] - np.eye(count))[:, unknown], (b + b_next)[0]]) * scale)

    guess = np.array([start.r, start.v, start.omega_r, 0.0, *np.zeros(count - 6), start.delta, start.tau]) / scale
    for _ in range(MEMORY_PASSES if count > 6 else 0):
        x, u = point(guess)
        guess[4:-2] = model.step(x, u, u, curvature)[0, 6:] / model.internal_scale
    found = least_squares(change, guess, jacobian)
    x, u = point(found.x)
    _, a, b, b_next = model.linearize(x, u, u, curvature)
    response = np.zeros((count, 2))
    for _ in range(STEPS):
        response = a[0] @ response + (b + b_next)[0]
    response *= INPUT_STEP
    return SteadyDrift(
        x[0, 1], x[0, 3], u[0, 0], u[0, 1], np.abs(found.fun).max(), response[0, 0], response[0, 1], response[3, 1]
    )


def run(config: SteadyDriftConfig) -> pd.DataFrame:
    """One row a vehicle and model."""
    folder = opened("steady_drift", config)
    learnt, parameters = load_model(config.checkpoint), VehicleParameters()
    start = drift_equilibrium(parameters, RADIUS, -SIDESLIP)
    gathered = config.gathered(frozenset({"twice_info"}), learnt, folder)
    shared = {
        "nominal": steady_drift(NominalStepModel(parameters), start),
        "prior": steady_drift(step_model(learnt, learnt.prior()), start),
    }
    rows = []
    for vehicle, seed in config.attempts():
        twice = step_model(*gathered[vehicle, seed].after(learnt))
        states = shared | {
            "twice_info": steady_drift(twice, start),
            "true": steady_drift(EffectsStepModel(parameters, config.effects(vehicle)), start),
        }
        rows += [{"vehicle": vehicle, "noise_seed": seed, "model": k} | v._asdict() for k, v in states.items()]
    found = pd.DataFrame(rows)
    write_report(folder, report(found), config)
    write_json(folder / "numbers.json", found.to_dict("records"))
    return found


def report(found: pd.DataFrame) -> str:
    """Medians and ranges over the vehicles, as Markdown; states that are none are left out and counted."""
    columns = ("v", "delta", "tau", "yaw_rate_by_steering", "yaw_rate_by_torque", "rim_speed_by_torque")
    heads = ("model", "v [m/s]", "delta [rad]", "tau [N m]", "yaw rate [rad/s] by 0.1 rad", "by 30 N m",
             "rim speed [m/s] by 30 N m", "no such state")  # fmt: skip
    rows = []
    for model, group in found.groupby("model", sort=False):
        steady = group[group["residual"] < TOLERANCE]
        cells = [
            f"{steady[name].median():.3g} ({steady[name].min():.3g} to {steady[name].max():.3g})" for name in columns
        ]
        rows.append((model, *cells, f"{len(group) - len(steady)} of {len(group)}"))
    return "\n".join(tabulated(heads, rows))


if __name__ == "__main__":
    run_command(run, SteadyDriftConfig)
