"""How long one real-time iteration of the OCP takes, beside Drake's SNOPT warm-started on the same program.

    python -m experiments.drifting.benchmark_ocp

Both solve the same sequence of problems, the car moving along the figure-8's reference by 10 ms from one to the next;
what is reported is their ratio in one run, and the parts of the real-time iteration.
"""

import dataclasses
import time
from pathlib import Path

import numpy as np
import tyro
from pydrake.solvers import SnoptSolver

from drift_drake.control.ocp import OcpData, OptimalControlProblem
from drift_drake.control.sqp import LineSearchSqp, SqpOptions
from drift_drake.control.step_model import NominalStepModel
from drift_drake.reference.trajectory import figure_8
from drift_drake.run_folder import machine, make_run_folder, write_json, write_versions
from drift_drake.vehicle.parameters import VehicleParameters


@dataclasses.dataclass(frozen=True)
class BenchmarkConfig:
    """Size of the benchmark."""

    horizon: int = 25
    problems: int = 100
    seed: int = 0
    out: Path | None = None


def run(config: BenchmarkConfig) -> dict[str, object]:
    """Medians [ms], and the ratio of SNOPT's median to that of one real-time iteration."""
    parameters = VehicleParameters()
    reference = figure_8(parameters)
    problem = OptimalControlProblem(NominalStepModel(parameters), parameters, config.horizon)
    sqp, snopt = LineSearchSqp(problem, SqpOptions.real_time()), SnoptSolver()
    rng = np.random.default_rng(config.seed)
    z, y, warm = np.empty(0), None, np.empty(0)
    times: dict[str, list[float]] = {"linearise": [], "real_time_iteration": [], "snopt_warm": []}
    for k in range(config.problems):
        s = 40.0 + 0.127 * k
        window = reference.horizon(s, 0.1, config.horizon)
        x = reference.state(s) + rng.normal(size=6) * [0.02, 0.05, 0.01, 0.1, 0.02, 0.01]
        data = OcpData(x, reference.input(s), window.x_ref, window.curvature, window.e_min, window.e_max)
        problem.set(data)
        if k == 0:
            z = warm = problem.first_guess(data)
        clock = [time.perf_counter()]
        problem.dynamics.linearize(z)
        clock.append(time.perf_counter())
        result = sqp.solve(z, y)
        clock.append(time.perf_counter())
        solution = snopt.Solve(problem, warm, None)
        clock.append(time.perf_counter())
        for name, seconds in zip(times, np.diff(clock), strict=True):
            times[name].append(1e3 * seconds)
        z, y = result.z, result.y
        warm = solution.GetSolution(problem.decision_variables())
    medians = {name: float(np.median(values[1:])) for name, values in times.items()}
    ratio = medians["snopt_warm"] / medians["real_time_iteration"]
    return {"machine": machine(), "median_ms": medians, "snopt_over_real_time_iteration": ratio}


def main(config: BenchmarkConfig) -> None:
    """Runs, prints and stores the benchmark."""
    folder = make_run_folder("benchmark_ocp", config.out)
    numbers = run(config)
    write_json(folder / "config.json", config)
    write_json(folder / "numbers.json", numbers)
    write_versions(folder)
    print(f"{numbers['machine']}; N = {config.horizon}; medians [ms]: {numbers['median_ms']}")
    print(f"SNOPT to convergence takes {numbers['snopt_over_real_time_iteration']:.0f} times a real-time iteration")


if __name__ == "__main__":
    main(tyro.cli(BenchmarkConfig))
