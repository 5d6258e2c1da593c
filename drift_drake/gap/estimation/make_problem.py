"""A problem for the estimator from a case's runs: noise levels, and a first sideslip where no column tells it."""

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np

from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.log.table import Run
from drift_drake.car.parameters import VehicleParameters
from drift_drake.gap.estimation.filter_state import CHANNELS, FILTER_STATES
from drift_drake.gap.estimation.filtered import filter_case
from drift_drake.gap.estimation.problem import PROCESS_NOISE, Problem, tolerance_deviations
from drift_drake.gap.estimation.run_data import RunData, first_sideslip, noise_levels, prepare_run

FIRST_SIDESLIPS = tuple(float(b) for b in np.linspace(-0.8, 0.8, 17))  # [rad] that are tried where nothing tells it
TRIAL_TIME = 1.0  # [s] over which they are judged, and which does not count afterwards
WORST_INNOVATION = 1e4  # squares at which an innovation is capped in that judgement
FED_RIM = 2.0  # [m/s per root s] that the rim speed wanders by where no torque is logged


def make_problem(
    runs: Sequence[Run],
    vehicle: VehicleParameters,
    process_scale: float = 1.0,
    noise_scale: float = 1.0,
    stated: Mapping[str, float] | None = None,
    own: Effects = Effects(),
    tempering: float = 1.0,
) -> Problem:
    """Runs and vehicle as the estimator wants them; noise levels are estimated here.

    `process_scale` multiplies the process noise: above one for cars that no single-track model follows closely.
    `noise_scale` multiplies the sensors' noise: above one where it is not white. `stated` are levels of channels that
    are known otherwise (an import's); the larger of the two counts. `own` are effects of the vehicle file. `tempering`
    is the likelihood's exponent: below one where innovations hang together, as `identify` finds it.
    """
    data = [prepare_run(run) for run in runs]
    process = (PROCESS_NOISE * process_scale) ** 2
    fed = any(run.tau_cmd is None for run in runs)
    if fed:
        process[FILTER_STATES.index("omega_r")] = FED_RIM**2
    known = np.array([(stated or {}).get(name, 0.0) for name in CHANNELS])
    noise = noise_scale * np.maximum(noise_levels(data), known)
    tolerance = tolerance_deviations(vehicle)
    problem = Problem(data, vehicle, vehicle.constants(), tolerance, noise, process, rim_fed=fed, own=own,
                      tempering=tempering)  # fmt: skip
    return problem.replace(runs=[started(problem, i, run) for i, run in enumerate(runs)])


def started(problem: Problem, index: int, run: Run) -> RunData:
    """A run whose first sideslip, where no column tells it, is the one that the nominal car's filter likes best."""
    data = problem.runs[index]
    if run.beta is not None or first_sideslip(run) is not None:
        return data
    rows = min(round(TRIAL_TIME / run.period), len(run))
    trials = []
    for sideslip in FIRST_SIDESLIPS:
        y = data.y[:rows].copy()
        y[:, CHANNELS.index("beta")] = sideslip
        trials.append(dataclasses.replace(data, y=y, delta=data.delta[:rows], tau=data.tau[:rows],
                                          counted=np.arange(rows) > 0))  # fmt: skip
    tried = problem.replace(runs=trials)
    found = filter_case(tried, np.zeros(tried.nuisances), ()).innovations
    y = data.y.copy()
    costs = [np.sum(np.minimum(e**2, WORST_INNOVATION)) for e in found]
    y[:, CHANNELS.index("beta")] = FIRST_SIDESLIPS[int(np.argmin(costs))]
    counted = data.counted & (np.arange(len(y)) * run.period >= TRIAL_TIME)
    return dataclasses.replace(data, y=y, counted=counted)
