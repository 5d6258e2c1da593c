"""Information gathering on one vehicle: a plan driven by the tracking controller, logged, decimated, learnt."""

import dataclasses
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from pydrake.systems.framework import Context

from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.single_track.path_plant import PathPlant
from drift_drake.car.step_model import NominalStepModel
from drift_drake.common.arrays import Array
from drift_drake.common.threads import one_blas_thread
from drift_drake.drive.gathering.config import (
    GatheringConfig,
    curvature_along,
    lane,
    lane_data,
    positions,
    problem_data,
)
from drift_drake.drive.gathering.plan import (
    Trajectory,
    info_ocp,
    information_cost,
    information_expected,
    information_gained,
    round_alpha,
    sqp_options,
    usable,
)
from drift_drake.drive.learnt.checkpoint import BayesianModel
from drift_drake.drive.learnt.lag_bank import learn_with_lags
from drift_drake.drive.learnt.posterior import Posterior
from drift_drake.drive.learnt.quality import learn
from drift_drake.drive.learnt.samples import Samples, concatenate, samples_from_log
from drift_drake.drive.loop.drive import Drive
from drift_drake.drive.mpc.plan import DT
from drift_drake.drive.mpc.sqp import LineSearchSqp
from drift_drake.drive.mpc.tracking import Tracked, TrackingController, tracking_gains

SHORTEST = 5  # steps: a rest of a drive shorter than this is driven as it was planned


def rest_of_drive(config: GatheringConfig, step: int) -> GatheringConfig:
    """What is left of a drive from a step on; on a track there is always a plan's length ahead."""
    if config.lane == "track":
        return config
    start = problem_data(config).x_ref[step, 1]
    return dataclasses.replace(config, steps=config.steps - step, v_start=float(start))


def rest_of_plan(plan: Trajectory, step: int) -> Trajectory:
    """A plan from a step on, its last step at the least."""
    step = min(step, len(plan.u) - 2)
    return plan._replace(x=plan.x[step:], u=plan.u[step:])


def continued(config: GatheringConfig, x: Array, u: Array, start: float) -> tuple[Array, Array, Array | None]:
    """A plan's guess as long as a drive asks for, from what is left of the last one.

    Args:
        x: states and lagged commands [M+1, 8], u: [M+1, 2], M at most the config's steps; start: path position [m].

    Returns:
        (x, u, path positions on a track [N+1] [m], else None): beyond the end the track's middle, the inputs held.
    """
    if config.lane == "open":
        return x, u, None
    s, missing = positions(config, x, start), config.steps + 1 - len(u)
    onward = lane(config).horizon(float(s[-1]), DT, missing)
    tail = np.hstack([onward.x_ref[1:], np.tile(x[-1, 6:], (missing, 1))])
    return np.vstack([x, tail]), np.vstack([u, np.tile(u[-1], (missing, 1))]), np.append(s, onward.s[1:])


@one_blas_thread()
def plan_rest(
    model: BayesianModel, belief: Posterior, plan: Trajectory, config: GatheringConfig, alpha: float, x: Array,
    u: Array, start: float = 0.0,
) -> Trajectory:  # fmt: skip
    """The rest of a drive, planned again from where the car is; the rest of the plan before where that does not work.

    As the belief holds what the samples so far have shown, the gain of the whole drive is what the rest adds to it: at
    the states of the plan before, with the same mean and alpha, the rest of it is the solution (objective "eq8" apart,
    whose covariance is that of the start).

    Args:
        belief: now; plan: what is left of it; config: of what is left, see `rest_of_drive`; alpha: weight of the
            information [1/nat]; x: state and lagged commands now [8]; u: command in force [2]; start: path position now
            [m], on a track.
    """
    x_guess, u_guess, along = continued(config, np.vstack([x, plan.x[1:]]), np.vstack([u, plan.u[1:]]), start)
    problem = info_ocp(model, belief, config, alpha, along=along)
    problem.set(lane_data(config, s=along)._replace(x_init=x, u_init=u))
    found = LineSearchSqp(problem, sqp_options(config)).solve(problem.stack(x_guess, u_guess))
    if not usable(found, config.only_converged):
        return plan
    states, inputs, _ = problem.unstack(found.z)
    gained = information_cost(model, belief, config.objective, alpha).information(states[:-1], inputs[:-1], inputs[1:])
    return Trajectory(states, inputs, found.cost, gained, found.status)


class Replanner:
    """Learns and plans again at the pauses of one drive, in which the simulation stands still.

    All plans of a drive are weighed alike: the rest of the first one would be worth, by `objective_later`, what it was.
    On a track, where a drive is longer than a plan, each is weighed as a round's (`round_alpha`).

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
        self._first, self._plan, self._from = plan, plan, 0
        self._alpha = self._weight(before)

    def _weight(self, belief: Posterior) -> float:
        """Of the information [1/nat]; none where the first plan asked for none."""
        return round_alpha(self._model, belief, self._first, self._config) if self._first.alpha > 0.0 else 0.0

    def times(self) -> Array:
        """When to plan again [s]."""
        every, steps = max(1, round(self._config.replan / DT)), round(self._config.drive_time / DT)
        return np.asarray(DT * np.arange(every, steps - SHORTEST + 1, every), dtype=np.float64)

    def __call__(self, root: Context, table: pd.DataFrame) -> str | None:
        """Plans again from the log's last row, which is now, and lets the controller follow.

        Returns:
            "enough" where what the plan promises is too small a share of what the drive has taught (`stop_below`).
        """
        step, start = round(root.get_time() / DT), float(table["s"].iloc[-1])
        samples = samples_from_log(table, lane(self._config).path, 0, 0)
        belief = learn(self._model, self._before, samples)
        rest = rest_of_drive(self._config, step)
        left = rest_of_plan(self._plan, step - self._from)
        x, u = samples.x_next[-1], samples.u_next[-1]
        alpha = self._weight(belief) if rest.lane == "track" else self._alpha
        self._plan, self._from = plan_rest(self._model, belief, left, rest, alpha, x, u, start), step
        promised, gained = (
            information_expected(self._model, belief, self._plan),
            information_gained(self._before, belief),
        )
        if self._first.alpha > 0.0 and promised < self._config.stop_below * gained:
            return "enough"
        states, inputs = self._plan.x[:, :6], self._plan.u
        curvature = curvature_along(rest, states, start)
        gains = tracking_gains(NominalStepModel(self._model.vehicle), states, inputs, curvature)
        context = self._controller.GetMyMutableContextFromRoot(root)
        self._controller.follow(context, Tracked(states, inputs, gains, root.get_time()))
        return None


def execution(
    trajectory: Trajectory,
    effects: Effects,
    parameters: VehicleParameters,
    config: GatheringConfig,
    plant: PathPlant | None = None,
) -> Drive:
    """The diagram that drives a trajectory on a vehicle; see `Drive`."""
    states = trajectory.x[:, :6]
    gains = tracking_gains(NominalStepModel(parameters), states, trajectory.u, curvature_along(config, states))
    controller = TrackingController(states, trajectory.u, gains)
    start = (float(trajectory.u[0, 0]), float(trajectory.u[0, 1]))
    return Drive(parameters, controller, 1, DT, None, start, effects, lane(config), plant=plant)


def gather(
    trajectory: Trajectory,
    effects: Effects,
    parameters: VehicleParameters,
    config: GatheringConfig,
    seed: int,
    plant: PathPlant | None = None,
    learning: tuple[BayesianModel, Posterior] | None = None,
) -> tuple[pd.DataFrame, str]:
    """Drives a trajectory: (log at 100 Hz, how it ended: "time" is as planned, "enough" by `config.stop_below`).

    Args:
        trajectory: states [N + 1, n] and inputs [N, 2] (delta [rad], tau [N m]) in steps of 0.1 s; effects: of the true
            car alone; parameters: of the car; seed: of the sensors' noise; plant: the car's, single-track without.
        learning: the model and what is believed before the drive, where the rest of the drive is to be planned again
            each `config.replan` [s]; without, a drive is as long as the trajectory, on a track too.

    Raises:
        InvalidVehicleError: an effect that no car has; InvalidCheckpointError: see `info_ocp`.

    Examples:
        >>> trajectory = plan_drive(model, model.prior(), config, alpha=8.0)  # doctest: +SKIP
        >>> table, ending = gather(trajectory, make_effects({}), car, config, seed=0)  # doctest: +SKIP
    """
    drive = execution(trajectory, effects, parameters, config, plant)
    replanning: dict[str, Any] = {}
    duration = config.drive_time if learning is not None else config.steps * DT
    if learning is not None and config.replan > 0.0 and (trajectory.alpha > 0.0 or config.lane == "track"):
        assert isinstance(drive.driver, TrackingController)
        replanner = Replanner(*learning, trajectory, config, drive.driver)
        replanning = {"pauses": replanner.times(), "at_pause": replanner}
    return drive.run(trajectory.x[0, :6], 0.0, duration, seed, **replanning)


def drive_samples(table: pd.DataFrame, config: GatheringConfig) -> Samples:
    """A drive's log as samples at 10 Hz."""
    return samples_from_log(table, lane(config).path, 0, 0)


def learn_drive(model: BayesianModel, belief: Posterior, table: pd.DataFrame, config: GatheringConfig) -> Posterior:
    """The belief after a drive's log, sample by sample (section II of the paper).

    Args:
        model: the learnt model; belief: before the drive; table: log at 100 Hz as `gather` gives it (SI); config: the
            lane that it was driven on.

    Examples:
        >>> belief = learn_drive(model, model.prior(), table, GatheringConfig())
    """
    return learn(model, belief, drive_samples(table, config))


def learn_drives(
    model: BayesianModel, tables: Sequence[pd.DataFrame], config: GatheringConfig
) -> tuple[BayesianModel, Posterior]:
    """(the model with the lags that make drives likeliest, its belief after all of them); see `lag_bank`."""
    path = lane(config).path
    return learn_with_lags(
        model, lambda lag: concatenate([samples_from_log(table, path, 0, 0, lag=lag) for table in tables])
    )


class Gathered(NamedTuple):
    """One drive to learn from, and what is believed after it."""

    expected: float  # [nat] of information in the samples together that it set out to take: on a track the first plan's
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
    """Drives a trajectory and learns from the drive, with what that was expected to gain and what it gained."""
    table, ending = gather(trajectory, effects, parameters, config, seed, learning=(model, before))
    after = learn_drive(model, before, table, config)
    expected = information_expected(model, before, trajectory)
    return Gathered(expected, information_gained(before, after), table, ending, after)
