"""Gathering replanned as the belief changes: while it drives, the car learns and plans the rest of the drive again."""

import dataclasses

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from pydrake.systems.framework import Context

from drift_drake.control.plan import DT
from drift_drake.control.sqp import LineSearchSqp
from drift_drake.control.step_model import NominalStepModel
from drift_drake.control.tracking import Tracked, TrackingController, tracking_gains
from drift_drake.drives.dataset import samples_from_log
from drift_drake.gathering.lane import FEASIBLE, problem_data
from drift_drake.gathering.plan import GatheringConfig, Trajectory, info_ocp, information_cost, round_alpha, sqp_options
from drift_drake.model.checkpoint import BayesianModel
from drift_drake.model.posterior import Posterior
from drift_drake.model.quality import learn
from drift_drake.reference.path import Path
from drift_drake.threads import one_blas_thread

Array = NDArray[np.float64]

SHORTEST = 5  # steps: a rest of a drive shorter than this is driven as it was planned


def rest_of_drive(config: GatheringConfig, step: int) -> GatheringConfig:
    """What is left of a lane drive from a step on."""
    start = problem_data(config).x_ref[step, 1]
    return dataclasses.replace(config, steps=config.steps - step, v_start=float(start))


def rest_of_plan(plan: Trajectory, step: int) -> Trajectory:
    """A plan from a step on."""
    return plan._replace(x=plan.x[step:], u=plan.u[step:])


@one_blas_thread()
def plan_rest(
    model: BayesianModel, belief: Posterior, plan: Trajectory, config: GatheringConfig, alpha: float, x: Array, u: Array
) -> Trajectory:
    """The rest of a drive, planned again from where the car is; the rest of the plan before where that does not work.

    As the belief holds what the samples so far have told, the gain of the whole drive is what the rest adds to it: at
    the states of the plan before, with the same mean and alpha, the rest of it is the solution (objective "eq8" apart,
    whose covariance is that of the start).

    Args:
        belief: now; plan: what is left of it; config: of what is left, see `rest_of_drive`; alpha: weight of the
            information [1/nat]; x: state and lagged commands now [8]; u: command in force [2].
    """
    problem = info_ocp(model, belief, config, alpha)
    problem.set(problem_data(config, curvature=config.curvature)._replace(x_init=x, u_init=u))
    guess = problem.stack(np.vstack([x, plan.x[1:]]), np.vstack([u, plan.u[1:]]))
    found = LineSearchSqp(problem, sqp_options(config)).solve(guess)
    if found.failed or found.primal_residual >= FEASIBLE:
        return plan
    states, inputs, _ = problem.unstack(found.z)
    told = information_cost(model, belief, config.objective, alpha).information(states[:-1], inputs[:-1], inputs[1:])
    return Trajectory(states, inputs, found.cost, told, found.status)


class Replanner:
    """Learns and plans again at the pauses of one drive, in which the simulation stands still.

    All plans of a drive are weighed alike: the rest of the first one would be worth, by `objective_later`, what it was.

    Args:
        model, before: what is believed before the drive; plan: that it begins with; config: of the whole drive.
        controller: that follows the plans.
    """

    def __init__(
        self, model: BayesianModel, before: Posterior, plan: Trajectory, config: GatheringConfig,
        controller: TrackingController,
    ) -> None:  # fmt: skip
        self._model, self._before, self._controller = model, before, controller
        self._config = dataclasses.replace(config, objective=config.objective_later)
        self._alpha = round_alpha(model, before, plan, config)
        self._plan, self._from = plan, 0

    def times(self) -> Array:
        """When to plan again [s]."""
        every = max(1, round(self._config.replan / DT))
        return np.asarray(DT * np.arange(every, self._config.steps - SHORTEST + 1, every), dtype=np.float64)

    def __call__(self, root: Context, table: pd.DataFrame) -> None:
        """Plans again from the log's last row, which is now, and lets the controller follow."""
        step = round(root.get_time() / DT)
        samples = samples_from_log(table, Path([0.0, 1.0], [self._config.curvature] * 2), 0, 0)
        belief = learn(self._model, self._before, samples)
        rest = rest_of_drive(self._config, step)
        left = rest_of_plan(self._plan, step - self._from)
        x, u = samples.x_next[-1], samples.u_next[-1]
        self._plan, self._from = plan_rest(self._model, belief, left, rest, self._alpha, x, u), step
        states, inputs = self._plan.x[:, :6], self._plan.u
        curvature = np.full(rest.steps, rest.curvature)
        gains = tracking_gains(NominalStepModel(self._model.vehicle), states, inputs, curvature)
        context = self._controller.GetMyMutableContextFromRoot(root)
        self._controller.follow(context, Tracked(states, inputs, gains, root.get_time()))
