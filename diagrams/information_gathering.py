"""Information gathering on one vehicle: plan, execute with the tracking controller, log, decimate, adapt.

python -m diagrams.information_gathering --vehicle 3     # one vehicle: OCP, Info-OCP, second Info-OCP
python -m diagrams.information_gathering --graph         # draws the diagram of the execution
"""

import dataclasses
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
import pandas as pd
import tyro
from numpy.typing import NDArray

from drift_drake.control.information import InformationCost
from drift_drake.control.lane_drive import DT, FEASIBLE, LaneDrive, bound_end, bound_slip, problem_data
from drift_drake.control.ocp import OcpWeights, OptimalControlProblem
from drift_drake.control.predictive_information import PredictiveInformationCost
from drift_drake.control.sqp import LineSearchSqp, SqpOptions
from drift_drake.control.step_model import NominalStepModel
from drift_drake.control.tracking import TrackingController, tracking_gains
from drift_drake.drives.dataset import samples_from_log
from drift_drake.drives.drive import Drive
from drift_drake.drives.vehicles import Population, draw_effects
from drift_drake.errors import DriftDrakeError
from drift_drake.model.checkpoint import BayesianModel, InvalidCheckpointError, load
from drift_drake.model.posterior import Posterior, covariance_norms, weighed
from drift_drake.model.quality import learn, step_model
from drift_drake.pictures.graph import draw_graph
from drift_drake.reference.trajectory import Reference, straight_line
from drift_drake.run_folder import make_run_folder
from drift_drake.vehicle.effects import Effects
from drift_drake.vehicle.parameters import VehicleParameters

Array = NDArray[np.float64]

# What a plan is to tell: l_info of eq. (8); the same with the covariance updated along the horizon; of drifts to come.
Objective = Literal["eq8", "updated", "drifts"]

# OSQP's. The information's weight makes these costs larger than the controller's: on validation vehicles, of a later
# plan's QPs a fifth were cut off at their limit of iterations with 10, one in forty with 100.
QP_RHO = 100.0


@dataclasses.dataclass(frozen=True)
class GatheringConfig(LaneDrive):
    """A lane drive that is worth learning from."""

    # Bolder than where only a nominal car plans: on validation vehicles, drives up to here taught most about drifting.
    max_sideslip: float = 0.35  # [rad] in plans
    alpha: float = 8.0  # weight of the first round's information [1/nat]; see `round_alpha`
    starts: int = 5  # first guesses of Info-OCP: the straight line, and random ones
    objective: Objective = "eq8"  # of the first round
    # Of the rounds after it. Under eq. (8) they went where one thing could be learnt again and again, fast and far from
    # drifting. With updates they seek what is new, whether a drift asks for it or not.
    objective_later: Objective = "drifts"
    ends_straight: bool = True  # informative plans do; without, they end in slides that leave the lane soon after
    max_iterations: int = 80
    tolerance: float = 1e-3  # the SQP's: far below what the feedback absorbs
    # Inputs smoother than the drift controller's: that costs some information, but what is learnt carries over better
    # to drifting, and the true car stays nearer to the plan.
    weights: OcpWeights = dataclasses.field(default_factory=lambda: OcpWeights(delta=100.0, tau=3e-4))


class InfeasiblePlanError(DriftDrakeError, RuntimeError):
    """No drive was found that keeps to the lane and the limits; the message says what to change."""


class Trajectory(NamedTuple):
    """A planned trajectory of 0.1 s steps."""

    x: Array  # states and lagged commands [N+1, 8]
    u: Array  # [N+1, 2]
    cost: float
    information: float  # [nat] to the belief that it was planned with, by the objective
    status: str


def plan(
    model: BayesianModel,
    belief: Posterior,
    config: GatheringConfig,
    alpha: float,
    seed: int = 0,
    lateral: Array | None = None,
) -> Trajectory:
    """Solves OCP (alpha = 0) or Info-OCP; of several first guesses the lowest cost wins.

    Args:
        alpha: weight of the information; seed: of the random first guesses; lateral: see `problem_data`.

    Raises:
        InfeasiblePlanError: no first guess led to a feasible trajectory.
    """
    # Euler's path would turn as the nominal car does: on validation vehicles the true car strayed up to twice as far.
    believed = step_model(model, belief, "trapezoid")
    cost = information_cost(model, belief, config.objective, alpha)
    problem = OptimalControlProblem(
        believed, model.vehicle, config.steps, config.weights, extra_cost=cost if alpha > 0.0 else None
    )
    bound_slip(problem, config)
    if alpha > 0.0 and config.ends_straight:
        bound_end(problem)
    data = problem_data(config, lateral)
    data = data._replace(x_init=np.append(data.x_init, data.u_init))  # the lags are settled
    problem.set(data)
    options = SqpOptions(
        max_iterations=config.max_iterations,
        tolerance=config.tolerance,
        qp_tolerance=1e-7,
        qp_max_iterations=1000,
        qp_rho=QP_RHO,
    )
    solver = LineSearchSqp(problem, options)
    straight = problem.initial_guess(data)
    rng = np.random.default_rng(seed)
    best = None
    for start in range(config.starts if alpha > 0.0 else 1):
        guess = straight
        if start > 0:
            x, u, _ = problem.unstack(straight)
            u[1:, 0] = 0.06 * np.sin(np.arange(config.steps) * rng.uniform(0.2, 0.6) + rng.uniform(0.0, 2.0 * np.pi))
            u[1:, 1] = rng.uniform(50.0, 250.0)
            guess = problem.stack(x, u)
        result = solver.solve(guess)
        if not result.failed and result.primal_residual < FEASIBLE and (best is None or result.cost < best.cost):
            best = result
    if best is None:
        raise InfeasiblePlanError(
            "no first guess led to a feasible trajectory; widen the lane, lower alpha or allow more iterations"
        )
    x, u, _ = problem.unstack(best.z)
    return Trajectory(x, u, best.cost, cost.information(x[:-1], u[:-1], u[1:]), best.status)


def information_cost(
    model: BayesianModel, belief: Posterior, objective: Objective, alpha: float = 1.0
) -> InformationCost | PredictiveInformationCost:
    """-alpha times an objective's information, a sample counting as the regression weighs it.

    Raises:
        InvalidCheckpointError: the model does not know where it is to predict.
    """
    if objective != "drifts":
        covariance = weighed(belief.covariance, model.sample_weight)
        return InformationCost(model.network, covariance, alpha, updated=objective == "updated")
    if model.drifts is None:
        raise InvalidCheckpointError(
            "the checkpoint names no drifts to plan for; train it anew, or choose objective 'updated' for later rounds"
        )
    return PredictiveInformationCost(model.network, belief.covariance, model.sample_weight, model.drifts, alpha)


def information_expected(model: BayesianModel, belief: Posterior, drive: Trajectory) -> float:
    """Information [nat] that a planned drive's samples together would bring."""
    return information_cost(model, belief, "updated").information(drive.x[:-1], drive.u[:-1], drive.u[1:])


def information_gained(before: Posterior, after: Posterior) -> float:
    """Information [nat] between two beliefs: half the log of their covariances' determinants, before over after."""
    return float(0.5 * (np.linalg.slogdet(before.covariance)[1] - np.linalg.slogdet(after.covariance)[1]))


def plan_again(
    model: BayesianModel, belief: Posterior, first: Trajectory, config: GatheringConfig, seed: int = 0
) -> Trajectory:
    """Info-OCP's plan of a later round, with what is believed after the rounds before.

    Raises:
        InfeasiblePlanError: no first guess led to a feasible trajectory.
        InvalidCheckpointError: see `information_cost`.
    """
    again = dataclasses.replace(config, objective=config.objective_later)
    return plan(model, belief, again, round_alpha(model, belief, first, config), seed)


def round_alpha(model: BayesianModel, belief: Posterior, first: Trajectory, config: GatheringConfig) -> float:
    """The weight of the information in a later round: a repeat of the first drive is worth what it was then.

    As the belief narrows, all information shrinks; under a fixed weight the second plan is a straight line again.
    """
    cost = information_cost(model, belief, config.objective_later)
    return config.alpha * first.information / cost.information(first.x[:-1], first.u[:-1], first.u[1:])


def execution(
    trajectory: Trajectory, effects: Effects, parameters: VehicleParameters, config: GatheringConfig
) -> Drive:
    """The diagram that drives a trajectory on a vehicle."""
    states = trajectory.x[:, :6]
    gains = tracking_gains(NominalStepModel(parameters), states, trajectory.u, np.zeros(config.steps))
    controller = TrackingController(states, trajectory.u, gains, DT)
    start = (float(trajectory.u[0, 0]), float(trajectory.u[0, 1]))
    return Drive(parameters, controller, 1, DT, np.zeros((2, 2)), start, effects, lane(config))


def gather(
    trajectory: Trajectory, effects: Effects, parameters: VehicleParameters, config: GatheringConfig, seed: int
) -> tuple[pd.DataFrame, str]:
    """Drives a trajectory: (log at 100 Hz, how it ended: "time" is as planned)."""
    drive = execution(trajectory, effects, parameters, config)
    return drive.run(trajectory.x[0, :6], 0.0, config.steps * DT, seed)


def lane(config: GatheringConfig) -> Reference:
    """The straight lane, and the speed along it."""
    return straight_line(config.v_start, config.v_end, config.steps * DT, config.half_width)


def lane_for_pictures(config: GatheringConfig, tables: Iterable[pd.DataFrame]) -> Reference:
    """The lane, as long as the farthest of drives: one that is faster than the reference leaves its end behind."""
    farthest = max(lane(config).distance, *(float(table["x"].max()) for table in tables))
    return straight_line(config.v_end, config.v_end, farthest / config.v_end, config.half_width)


def learn_drive(model: BayesianModel, belief: Posterior, table: pd.DataFrame) -> Posterior:
    """The belief after a drive's log, decimated to 10 Hz."""
    return learn(model, belief, samples_from_log(table, None, 0, 0))


class Gathered(NamedTuple):
    """One drive to learn from, and what is believed after it."""

    expected: float  # [nat] of information in the planned samples together
    obtained: float  # [nat] in the samples that the drive gave
    table: pd.DataFrame  # log at 100 Hz
    ending: str
    belief: Posterior


def taught(
    model: BayesianModel,
    before: Posterior,
    trajectory: Trajectory,
    effects: Effects,
    parameters: VehicleParameters,
    config: GatheringConfig,
    seed: int,
) -> Gathered:
    """Drives a trajectory and learns from the drive, with what that was expected to tell and what it told."""
    table, ending = gather(trajectory, effects, parameters, config, seed)
    after = learn_drive(model, before, table)
    expected = information_expected(model, before, trajectory)
    return Gathered(expected, information_gained(before, after), table, ending, after)


@dataclasses.dataclass(frozen=True)
class Options:
    """One vehicle's information gathering."""

    vehicle: int = 0
    population: Population = "validation"
    gathering: GatheringConfig = dataclasses.field(default_factory=GatheringConfig)
    seed: int = 0
    checkpoint: Path | None = None
    graph: bool = False
    """Only draw the diagram of the execution."""
    out: Path | None = None


def main(options: Options) -> None:
    """Runs, or draws the diagram, and prints the covariance norms of the four models."""
    model, config, parameters = load(options.checkpoint), options.gathering, VehicleParameters()
    effects = draw_effects(options.population, options.vehicle, 0)
    beliefs = {"prior": model.prior()}
    nominal = plan(model, beliefs["prior"], config, 0.0)
    if options.graph:
        diagram = execution(nominal, effects, parameters, config).diagram
        for path in draw_graph(
            diagram, make_run_folder("information_gathering", options.out) / "information_gathering"
        ):
            print(path)
        return
    print(f"{'model':>12}  {'r':>9} {'v':>9} {'beta':>9} {'omega_r':>9} {'total':>9}")
    first = plan(model, beliefs["prior"], config, config.alpha, options.seed)
    _report("prior", beliefs["prior"])
    for name, before in (("Once-OCP", "prior"), ("Once-Info", "prior"), ("Twice-Info", "Once-Info")):
        trajectory = {"Once-OCP": nominal, "Once-Info": first}.get(name)
        if trajectory is None:
            trajectory = plan_again(model, beliefs[before], first, config, options.seed + 1)
        drive = taught(model, beliefs[before], trajectory, effects, parameters, config, options.seed)
        beliefs[name] = drive.belief
        _report(name, drive.belief)
        e, beta = (drive.table[column].abs().max() for column in ("e", "beta"))
        print(
            f"{'':>12}  planned {drive.expected:.1f} nat ({trajectory.status}), gained {drive.obtained:.1f}; driven: "
            f"|e| <= {e:.2f} m, |beta| <= {beta:.2f} rad, ended by {drive.ending}"
        )


def _report(name: str, belief: Posterior) -> None:
    norms, total = covariance_norms(belief)
    print(f"{name:>12}  " + " ".join(f"{norm:9.3g}" for norm in [*norms, total]))


if __name__ == "__main__":
    try:
        main(tyro.cli(Options))
    except (InvalidCheckpointError, InfeasiblePlanError) as error:
        sys.exit(f"error: {error}")
