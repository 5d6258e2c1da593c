"""Information gathering on one vehicle: a plan driven by the tracking controller, logged, decimated, learnt."""

import dataclasses
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd

from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.log.cases import runs_of
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.path_plant import PathPlant
from drift_drake.car.single_track.effects_step import EffectsStepModel
from drift_drake.car.step_model import NominalStepModel
from drift_drake.drive.gathering.config import SLOWEST, GatheringConfig, lane
from drift_drake.drive.gathering.plan import (
    Trajectory,
    information_expected,
    information_gained,
)
from drift_drake.drive.learnt.checkpoint import BayesianModel
from drift_drake.drive.learnt.command_lag import LAGGED
from drift_drake.drive.learnt.lag_bank import learn_with_lags
from drift_drake.drive.learnt.posterior import Posterior
from drift_drake.drive.learnt.quality import learn
from drift_drake.drive.learnt.samples import Samples, concatenate, samples_from_log
from drift_drake.drive.loop.drive import Drive, DriveLimits
from drift_drake.drive.manoeuvres.drivers import ROW_PERIOD
from drift_drake.drive.manoeuvres.steering_check import Steering, SteeringCheck, steering_of
from drift_drake.drive.mpc.plan import DT
from drift_drake.drive.mpc.tracking import TrackingController, tracking_gains


def execution(
    trajectory: Trajectory,
    effects: Effects,
    parameters: VehicleParameters,
    config: GatheringConfig,
    plant: PathPlant | None = None,
) -> Drive:
    """The diagram that drives a trajectory on a vehicle; see `Drive`."""
    controller = tracking(trajectory, parameters, config.steering)
    start = (float(trajectory.u[0, 0]), float(trajectory.u[0, 1]))
    return Drive(parameters, controller, 1, DT, None, start, effects, lane(config), plant=plant)


def tracking(trajectory: Trajectory, parameters: VehicleParameters, steering: Steering) -> TrackingController:
    """What drives a trajectory: a typical steering is taken to follow at once, another one with its lag and limit."""
    states, u, straight = trajectory.x[:, :6], trajectory.u, np.zeros(len(trajectory.u) - 1)
    if steering.usual:
        return TrackingController(states, u, tracking_gains(NominalStepModel(parameters), states, u, straight))
    lag = steering.lags
    model = EffectsStepModel(parameters, Effects(steering_lag=float(lag[0]), torque_lag=float(lag[1])))
    own = np.array([model.settled(x[:4], command) for x, command in zip(states, u, strict=True)])
    own[:, :2] = trajectory.x[:, LAGGED]
    gains = tracking_gains(model, np.append(states, own, axis=1), u, straight)
    return TrackingController(trajectory.x, u, gains[..., : LAGGED.stop], lag, steering.rate)


def check_steering(
    effects: Effects, parameters: VehicleParameters, config: GatheringConfig, seed: int,
    plant: PathPlant | None = None,
) -> Steering:  # fmt: skip
    """Drives a `SteeringCheck` along the lane, and says what it shows."""
    check = SteeringCheck(parameters)
    drive = Drive(parameters, check, 1, ROW_PERIOD, None, (0.0, 0.0), effects, lane(config), plant=plant)
    table, _ = drive.run(check.start(), 0.0, check.duration, seed, DriveLimits(min_speed=SLOWEST))
    (run,) = runs_of([table], "steering_check")
    return steering_of(run, parameters)


def with_steering(
    model: BayesianModel, config: GatheringConfig, steering: Steering
) -> tuple[BayesianModel, GatheringConfig]:
    """The model and the configuration for planning, driving and learning with a steering that is not as usual."""
    if steering.usual:
        return model, config
    return model.with_lag(steering.lags), dataclasses.replace(config, steering=steering)


def gather(
    trajectory: Trajectory,
    effects: Effects,
    parameters: VehicleParameters,
    config: GatheringConfig,
    seed: int,
    plant: PathPlant | None = None,
) -> tuple[pd.DataFrame, str]:
    """Drives a trajectory: (log at 100 Hz, how it ended: "time" is as planned).

    Args:
        trajectory: states [N + 1, n] and inputs [N, 2] (delta [rad], tau [N m]) in steps of 0.1 s; effects: of the true
            car alone; parameters: of the car; seed: of the sensors' noise; plant: the car's, single-track without.

    Raises:
        InvalidVehicleError: an effect that no car has.

    Examples:
        >>> trajectory = plan_drive(model, model.prior(), config, alpha=8.0)  # doctest: +SKIP
        >>> table, ending = gather(trajectory, make_effects({}), car, config, seed=0)  # doctest: +SKIP
    """
    drive = execution(trajectory, effects, parameters, config, plant)
    return drive.run(trajectory.x[0, :6], 0.0, config.steps * DT, seed)


def drive_samples(table: pd.DataFrame, config: GatheringConfig) -> Samples:
    """A drive's log as samples at 10 Hz."""
    return samples_from_log(table, lane(config).path, 0, 0, lag=config.steering.lags)


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

    expected: float  # [nat] of information in the samples together that it set out to take
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
    table, ending = gather(trajectory, effects, parameters, config, seed)
    after = learn_drive(model, before, table, config)
    expected = information_expected(model, before, trajectory)
    return Gathered(expected, information_gained(before, after), table, ending, after)
