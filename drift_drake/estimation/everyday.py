"""The misfit that a calibrated car has every day: what its innovations look like with the forces that it lacks.

`identify` learns on its logs which functions of the state, as forces and as offsets of sensors, the calibrated car
lacks (`freeform.state_functions`). A diagnosis of another day adds what they do to the innovations, once: those
forces are no gap, only what differs from them is.
"""

import dataclasses

import numpy as np

from drift_drake.estimation.filter_state import CHANNELS
from drift_drake.estimation.fit import no_effects
from drift_drake.estimation.freeform import FORCE_CHANNELS, force_units, state_functions
from drift_drake.estimation.problem import Everyday, Problem, filter_case, filtered_states, flat, observe

COARSE = 10.0  # factor on the process noise's deviation with which hypotheses are screened and predictions start
STEP = 1e-3  # of the forces, for their linear trace: where the logs do not feel one, its weight may be anything


def applied(problem: Problem, everyday: Everyday) -> tuple[Problem, list[str]]:
    """The problem with everyday forces and the row weight beside them, and warnings.

    As it is, where they bring the car no nearer to these logs: functions of the state say nothing of states that the
    calibration never saw.
    """
    taken_out = traced(problem.replace(everyday=everyday, row_weight=everyday.row_weight))
    before, after = (nominal_mean_square(p) for p in (problem, taken_out))
    if after < before:
        return taken_out, []
    return problem, [
        f"the calibration's model-mismatch forces do not carry over to these logs (mean square innovation {after:.3g} "
        f"with them, {before:.3g} without): they are left out, and a row is worth {problem.row_weight:.2g}"
    ]


def nominal_mean_square(problem: Problem) -> float:
    """Mean square innovation of the car as it is."""
    e = flat(problem, filter_case(problem, np.zeros(problem.nuisances), ()).innovations)
    return float(np.mean(e**2)) / problem.row_weight


def traced(problem: Problem) -> Problem:
    """The problem with the trace that its everyday forces leave in the innovations of the car as it is.

    To first order, they then are those of a car with these forces. The trace depends on the filter: whoever changes
    noise or process noise traces again. A problem without everyday forces is left as it is.
    """
    everyday = problem.everyday
    if everyday is None:
        return problem
    bare = [dataclasses.replace(run, trace=None) for run in problem.runs]
    problem = problem.replace(runs=bare)
    nominal = no_effects(problem)
    gains = filter_case(problem, nominal.theta, nominal.names)
    weights = np.array([everyday.forces[channel] for channel in FORCE_CHANNELS])
    traces = []
    for i, run in enumerate(bare):
        states = filtered_states(problem, gains, nominal.theta, nominal.names, i)
        functions = state_functions(problem, nominal, states, i)
        forces = STEP * force_units(problem) * (functions @ weights.T)
        y = run.y.copy()
        for name, offset in everyday.offsets.items():
            channel = CHANNELS.index(name)
            y[:, channel] += STEP * offset * problem.noise[channel] * run.used[channel]
        moved = problem.replace(runs=[*bare[:i], dataclasses.replace(run, y=y), *bare[i + 1 :]])
        torque = forces[:, 3] / problem.nominal.gear_ratio
        e = observe(moved, gains, nominal.theta, nominal.names, i, push=forces[:, :3].copy(), extra_torque=torque)
        traces.append((e - gains.innovations[i]) / STEP)
    runs = [dataclasses.replace(run, trace=trace) for run, trace in zip(bare, traces, strict=True)]
    return problem.replace(runs=runs)


def with_more_process_noise(problem: Problem) -> Problem:
    """The same problem with more process noise: innovations then depend less on the past."""
    return traced(problem.replace(process=problem.process * COARSE**2))
