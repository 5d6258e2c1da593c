"""How long the plans of the learnt MPC take, how far that is from a floor, and what Drake's solvers make of them.

    python -m experiments.drifting.benchmark_mpc
    python -m experiments.drifting.benchmark_mpc --horizons 25 45 --problems 10001 --again 15

A car moves along the figure-8's reference by 10 ms from one problem to the next, off it at random. Each problem is
planned for every horizon in turn, as a function and by the `MpcController`, so that what else the machine does falls
on all of them. All times are CPU times of one thread. The floor of a plan is its QPs' own time and that of the
network's matrix products, bare. A solve of the controller has an iteration more while it works out a plan from a
fresh guess: its time is compared with the function's where both take one, too. For the nominal car a real-time
iteration is compared with SNOPT, warm-started on the same problems. Of a few problems the converged cost is compared
with those of SNOPT and IPOPT by Drake, which have the model's Jacobians, and of IPOPT by CasADi where that is
installed, which has second derivatives too.
"""

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np
from pydrake.solvers import IpoptSolver, SnoptSolver
from pydrake.systems.framework import Context

from diagrams.command import run_command
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.step_model import NominalStepModel
from drift_drake.common.arrays import Array
from drift_drake.common.errors import InvalidOptionError, MissingExtraError
from drift_drake.common.run_folder import machine
from drift_drake.common.threads import one_blas_thread
from drift_drake.drive.learnt.bayesian_step import BayesianStepModel
from drift_drake.drive.learnt.checkpoint import load_model
from drift_drake.drive.learnt.features import Network
from drift_drake.drive.learnt.quality import step_model
from drift_drake.drive.mpc.controller import MpcController
from drift_drake.drive.mpc.mpc import Mpc, SolveStatistics
from drift_drake.drive.mpc.ocp import OcpData, OcpWeights, OptimalControlProblem
from drift_drake.drive.mpc.plan import DT
from drift_drake.drive.mpc.sqp import LineSearchSqp, SqpOptions
from drift_drake.drive.reference.trajectory import Reference, figure_8
from experiments.drifting.casadi_ocp import CasadiOcp, installed, learnt_step
from experiments.drifting.timed_parts import TimedModel, TimedQp, cpu, network_products
from experiments.made import RunConfig, begun, tabulated, write_results

START, ADVANCE = 40.0, 0.127  # [m] along the reference: of the first problem, from one problem to the next
SPREAD = np.array([0.02, 0.05, 0.01, 0.1, 0.02, 0.01])  # standard deviations of the state about the reference
SLOWEST = 100
RATIOS = ("plan_over_floor", "controller_over_plan", "controller_over_plan_of_one_iteration")
PARTS = ("linearise", "qp", "line_search", "plan", "controller", "floor_gemm")


@dataclasses.dataclass(frozen=True)
class BenchmarkConfig(RunConfig):
    """Size of the benchmark."""

    horizons: tuple[int, ...] = (10, 25, 45, 90)
    problems: int = 1000
    again: int = 0
    """How often the `SLOWEST` plans are solved again, in turn with as many others: what else the machine does falls on
    both, so that the median of each says how long that plan itself takes."""
    referee_problems: int = 2
    """Problems for each horizon that SNOPT, IPOPT and CasADi solve too, to convergence."""
    referee_horizon: int = 45
    """The longest horizon for them; IPOPT takes minutes beyond."""
    warm_problems: int = 100
    """Problems of the nominal car that SNOPT solves from its last solution, N = 25."""
    steering_weight: float = 60.0
    """As in the closed loop."""
    seed: int = 0


class Bench:
    """One horizon: the function and the controller, each with its own warm start, and their times so far [s]."""

    def __init__(self, model: BayesianStepModel, network: Network, reference: Reference, config: BenchmarkConfig,
                 horizon: int) -> None:  # fmt: skip
        self.reference, self.horizon = reference, horizon
        vehicle, weights = load_model().vehicle, OcpWeights(delta=config.steering_weight)
        self.model, self._timed_model = model, TimedModel(model)
        self.problem = OptimalControlProblem(model, vehicle, horizon, weights)
        self.sqp, self._timed = (LineSearchSqp(self.problem, SqpOptions.real_time()) for _ in range(2))
        self._timed_qp = TimedQp(self._timed.workspace)
        self._timed.workspace = self._timed_qp
        self.exact = LineSearchSqp(self.problem)
        command = tuple(reference.input(START))
        self.controller = MpcController(Mpc(model, vehicle, reference, horizon, weights, initial_command=command))
        self.context: Context = self.controller.CreateDefaultContext()
        self._products = network_products(network, horizon)
        self._last: tuple[Array, Array | None] = np.empty(0), None
        self._solved: list[tuple[OcpData, Array, Array | None]] = []
        self.times: dict[str, list[float]] = {name: [] for name in PARTS}
        self._of_one_iteration: dict[str, list[float]] = {"plan": [], "controller": []}
        self.counts = dict.fromkeys(("iterations", "second_attempts", "unsolved", "failed", "fresh_guesses"), 0)

    def plan(self, number: int, state: Array) -> None:
        """Plans one problem both ways."""
        s = START + ADVANCE * number
        self._plan_by_function(number, self.data(s, state))
        self._plan_by_controller(number, s, state)

    def data(self, s: float, state: Array) -> OcpData:
        """The problem of a car at s [m] whose command is the reference's and was so before."""
        window, command = self.reference.horizon(s, DT, self.horizon), self.reference.input(s)
        return OcpData(np.append(state, command), command, window.x_ref, window.curvature, window.e_min, window.e_max)

    def _plan_by_function(self, number: int, data: OcpData) -> None:
        self.problem.set(data)
        z, y = (self.problem.first_guess(data), None) if number == 0 else self._last
        seconds, result = cpu(lambda: self.sqp.solve(z, y))
        linearise, qp, step = self._parts(z, y)
        self._solved.append((data, z, y))
        self._last = result.z, result.y
        iterations = result.iterations
        forward, both = self._products
        evaluations = sum(i.trials for i in iterations)
        gemm = len(iterations) * cpu(both)[0] + evaluations * cpu(forward)[0]
        values = (linearise, qp, step, seconds)
        for name, value in zip(PARTS, (*values, None, gemm), strict=True):
            if value is not None:
                self.times[name].append(value)
        if len(iterations) == 1:
            self._of_one_iteration["plan"].append(seconds)
        self.counts["iterations"] += len(iterations)
        self.counts["second_attempts"] += sum(i.second_attempt for i in iterations)
        self.counts["unsolved"] += sum(i.qp_status != "solved" for i in iterations)
        self.counts["failed"] += result.failed

    def _parts(self, z: Array, y: Array | None) -> tuple[float, float, float]:
        """CPU times of the plan's linearisations, QPs and line search's steps, apart: the clock itself takes time."""
        model, qp = self._timed_model, self._timed_qp
        self.problem.dynamics.model = model
        model.linearise = model.step_time = qp.seconds = 0.0
        self._timed.solve(z, y)
        self.problem.dynamics.model = self.model
        return model.linearise, qp.seconds, model.step_time

    def _plan_by_controller(self, number: int, s: float, state: Array) -> None:
        self.context.SetTime(self.controller.period * number)
        self.controller.GetInputPort("measured_state").FixValue(self.context, np.append(state, s))
        self.controller.GetInputPort("internal_states").FixValue(self.context, self.reference.input(s))
        seconds, update = cpu(lambda: self.controller.EvalUniquePeriodicDiscreteUpdate(self.context))
        self.context.get_mutable_discrete_state().SetFrom(update)
        self.times["controller"].append(seconds)
        found = SolveStatistics(*self.controller.GetOutputPort("statistics").Eval(self.context))
        if found.iterations == 1.0 and found.restart == 0.0:
            self._of_one_iteration["controller"].append(seconds)
        self.counts["fresh_guesses"] += found.restart > 0.0

    def referee(self, s: float, state: Array, peer: CasadiOcp | None) -> dict[str, dict[str, float]]:
        """Costs and CPU times [ms] of the converged SQP and its peers on one problem, each from the first guess."""
        data = self.data(s, state)
        self.problem.set(data)
        guess = self.problem.first_guess(data)
        seconds, result = cpu(lambda: self.exact.solve(guess))
        answer = {"sqp": {"cost": result.cost, "ms": 1e3 * seconds, "solved": float(result.status == "converged")}}
        for name, solver in (("snopt", SnoptSolver()), ("ipopt", IpoptSolver())):
            seconds, found = cpu(lambda solver=solver: solver.Solve(self.problem, guess, None))  # type: ignore[misc]
            answer[name] = {
                "cost": float(found.get_optimal_cost()),
                "ms": 1e3 * seconds,
                "solved": float(found.is_success()),
            }
        if peer is not None:
            seconds, (_, cost, solved) = cpu(lambda: peer.solve(data, guess))
            answer["casadi_ipopt"] = {"cost": cost, "ms": 1e3 * seconds, "solved": float(solved)}
        return answer

    def solve_again(self, turns: int, rng: np.random.Generator) -> float:
        """The longest of the `SLOWEST` plans over the median of others, each the median of so many solves."""
        order = np.argsort(self.times["plan"][1:]) + 1
        slowest, others = order[-SLOWEST:], rng.choice(order, min(SLOWEST, order.size), replace=False)
        times: dict[int, list[float]] = {int(number): [] for number in (*slowest, *others)}
        for _ in range(turns):
            for number, seconds in times.items():
                data, z, y = self._solved[number]
                self.problem.set(data)
                seconds.append(cpu(lambda: self.sqp.solve(z, y))[0])  # noqa: B023 (called at once)
        longest, usual = (max(np.median(times[n]) for n in slowest), np.median([np.median(times[n]) for n in others]))
        return float(longest / usual)

    def summary(self) -> dict[str, Any]:
        """Median, 99.9 % and worst of each part [ms], ratios of the medians to the floor, and counts."""
        # The first plan starts from no solution; a controller makes it before the drive.
        parts = {name: statistics(values[1:]) for name, values in self.times.items()}
        median = {name: value["median"] for name, value in parts.items()}
        floor = median["floor_gemm"] + median["qp"]
        one = {name: np.median(values) if values else np.nan for name, values in self._of_one_iteration.items()}
        return {
            "ms": parts,
            "plan_over_floor": median["plan"] / floor,
            "controller_over_plan": median["controller"] / median["plan"],
            "controller_over_plan_of_one_iteration": float(one["controller"] / one["plan"]),
            "worst_over_median": parts["plan"]["worst"] / median["plan"],
            **self.counts,
        }


def relative_to_snopt(config: BenchmarkConfig) -> dict[str, float]:
    """Medians [ms] of a linearisation, a real-time iteration, and SNOPT from its last solution, for the nominal car."""
    parameters, horizon = VehicleParameters(), 25
    reference = figure_8(parameters)
    problem = OptimalControlProblem(NominalStepModel(parameters), parameters, horizon)
    sqp, snopt = LineSearchSqp(problem, SqpOptions.real_time()), SnoptSolver()
    rng = np.random.default_rng(config.seed)
    last: tuple[Array, Array | None] = np.empty(0), None
    warm = np.empty(0)
    times: dict[str, list[float]] = {"linearise": [], "real_time_iteration": [], "snopt_warm": []}
    for number in range(config.warm_problems):
        s = START + ADVANCE * number
        window, x = reference.horizon(s, DT, horizon), reference.state(s) + rng.normal(size=6) * SPREAD
        data = OcpData(x, reference.input(s), window.x_ref, window.curvature, window.e_min, window.e_max)
        problem.set(data)
        if number == 0:
            warm, last = problem.first_guess(data), (problem.first_guess(data), None)
        seconds = [cpu(lambda: problem.dynamics.linearize(last[0]))[0]]  # noqa: B023 (called at once)
        spent, result = cpu(lambda: sqp.solve(*last))  # noqa: B023
        seconds.append(spent)
        spent, solution = cpu(lambda: snopt.Solve(problem, warm, None))  # noqa: B023
        for name, value in zip(times, [*seconds, spent], strict=True):
            times[name].append(value)
        last, warm = (result.z, result.y), solution.GetSolution(problem.decision_variables())
    return {name: statistics(values[1:])["median"] for name, values in times.items()}


def statistics(seconds: Sequence[float]) -> dict[str, float]:
    """Median, 99.9 % and worst [ms]."""
    values = 1e3 * np.asarray(seconds)
    return {
        "median": float(np.median(values)),
        "99.9 %": float(np.quantile(values, 0.999)),
        "worst": float(values.max()),
    }


@one_blas_thread()
def run(config: BenchmarkConfig) -> dict[str, Any]:
    """The summary for each horizon, and the referees' answers."""
    learnt = load_model()
    model, reference = step_model(learnt, learnt.prior()), figure_8(learnt.vehicle)
    benches = [Bench(model, learnt.network, reference, config, horizon) for horizon in config.horizons]
    rng = np.random.default_rng(config.seed)
    for number in range(config.problems):
        s = START + ADVANCE * number
        state = reference.state(s) + rng.normal(size=6) * SPREAD
        for bench in benches:
            bench.plan(number, state)
    again = {str(b.horizon): b.solve_again(config.again, np.random.default_rng(1)) for b in benches if config.again}
    step = learnt_step(learnt.network, learnt.prior().mean, learnt.vehicle.constants()) if installed() else None
    referees: dict[str, list[Any]] = {}
    for bench in benches:
        if bench.horizon <= config.referee_horizon:
            peer = None if step is None else CasadiOcp(step, bench.problem)
            places = START + ADVANCE * config.problems * np.arange(config.referee_problems) / config.referee_problems
            answers = [bench.referee(s, reference.state(s) + rng.normal(size=6) * SPREAD, peer) for s in places]
            referees[str(bench.horizon)] = answers
    return {
        "machine": machine(),
        "problems": config.problems,
        "worst_over_median_again": again,
        "horizons": {str(bench.horizon): bench.summary() for bench in benches},
        "referees": referees,
        "missing": "" if step else str(MissingExtraError("the peer IPOPT with second derivatives", "casadi", "peers")),
        "relative_to_snopt": relative_to_snopt(config),
    }


def table(numbers: dict[str, Any]) -> str:
    """The summary as Markdown."""
    said = f"{numbers['machine']}; CPU time [ms]: median / 99.9 % / worst of {numbers['problems'] - 1} plans"
    heads = [name.replace("_", " ") for name in ("N", *PARTS, *(name.replace("_over_", " / ") for name in RATIOS))]
    rows = []
    for horizon, found in numbers["horizons"].items():
        cells = [" / ".join(f"{value:.2g}" for value in found["ms"][name].values()) for name in PARTS]
        rows.append((horizon, *cells, *(f"{found[name]:.2f}" for name in RATIOS)))
    lines = [said, "", *tabulated(heads, rows)]
    medians = ", ".join(f"{name.replace('_', ' ')} {ms:.2g} ms" for name, ms in numbers["relative_to_snopt"].items())
    lines += ["", f"- nominal car, N = 25: {medians} in the median"]
    lines += [
        f"- N = {horizon}, the {SLOWEST} slowest plans solved again: the longest takes {ratio:.2f} times the median"
        for horizon, ratio in numbers["worst_over_median_again"].items()
    ]
    lines += [f"- {numbers['missing']}"] if numbers["missing"] else []
    for horizon, answers in numbers["referees"].items():
        for answer in answers:
            costs = [
                f"{name} {found['cost']:.5g} ({found['ms']:.0f} ms{'' if found['solved'] else ', not converged'})"
                for name, found in answer.items()
            ]
            lines.append(f"- N = {horizon}, cost to convergence: " + ", ".join(costs))
    return "\n".join(lines)


def main(config: BenchmarkConfig) -> None:
    """Runs, prints and stores the benchmark.

    Raises:
        InvalidOptionError: too few problems to time.
    """
    for name in ("problems", "warm_problems"):
        if getattr(config, name) < 2:
            option = name.replace("_", "-")
            raise InvalidOptionError(f"--{option} is {getattr(config, name)}; give 2 or more: the first is not timed")
    folder = begun("benchmark_mpc", config)
    numbers = run(config)
    write_results(folder, config, numbers, table(numbers))


if __name__ == "__main__":
    run_command(main, BenchmarkConfig)
