"""Information gathering on one vehicle: a plan driven by the tracking controller, logged, decimated, learnt."""

from typing import Any, NamedTuple

import pandas as pd

from drift_drake.control.plan import DT
from drift_drake.control.tracking import TrackingController, tracking_gains
from drift_drake.drives.dataset import samples_from_log
from drift_drake.gathering.config import GatheringConfig
from drift_drake.gathering.course import curvature_along, lane
from drift_drake.gathering.plan import Trajectory, information_expected, information_gained
from drift_drake.gathering.replan import Replanner
from drift_drake.model.checkpoint import BayesianModel
from drift_drake.model.posterior import Posterior
from drift_drake.model.quality import learn
from drift_drake.model.samples import Samples
from drift_drake.simulation.drive import Drive
from drift_drake.vehicle.effects import Effects
from drift_drake.vehicle.parameters import VehicleParameters
from drift_drake.vehicle.path_plant import PathPlant
from drift_drake.vehicle.step_model import NominalStepModel


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
    controller = TrackingController(states, trajectory.u, gains, DT)
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
        learning: the model and what is believed before the drive, where the rest of the drive is to be planned again
            each `config.replan` [s]; without, a drive is as long as the trajectory, on a track too.
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
    """The belief after a drive's log."""
    return learn(model, belief, drive_samples(table, config))


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
    """Drives a trajectory and learns from the drive, with what that was expected to tell and what it told."""
    table, ending = gather(trajectory, effects, parameters, config, seed, learning=(model, before))
    after = learn_drive(model, before, table, config)
    expected = information_expected(model, before, trajectory)
    return Gathered(expected, information_gained(before, after), table, ending, after)
