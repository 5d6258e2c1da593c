"""The boldest informative drive that cars with the steering at hand hold: each plan is driven in simulation first."""

from collections.abc import Callable

import numpy as np

from drift_drake.car.effects.drawn import drawn_effects
from drift_drake.car.parameters import VehicleParameters
from drift_drake.drive.gathering.config import GatheringConfig
from drift_drake.drive.gathering.gather import gather
from drift_drake.drive.gathering.plan import InfeasiblePlanError, Trajectory

CARS = 12  # that drive a plan in simulation
BOLDNESS = (1.0, 0.3, 0.1)  # of the weight of the information
SIDESLIP = 1.5  # times what plans are bounded to, up to which a car is under control


def holds(trajectory: Trajectory, parameters: VehicleParameters, config: GatheringConfig) -> bool:
    """Whether cars as they usually differ from the nominal one, with this steering, keep to the lane under a plan."""
    steering = config.steering.effects
    for k in range(CARS):
        effects = drawn_effects(np.random.default_rng(k))._replace(
            steering_lag=steering.steering_lag, steering_rate_limit=steering.steering_rate_limit
        )
        table, ending = gather(trajectory, effects, parameters, config, k)
        e, beta = (float(table[column].abs().max()) for column in ("e", "beta"))
        if ending != "time" or e > config.half_width or beta > SIDESLIP * config.max_sideslip:
            return False
    return True


def boldest(plan: Callable[[float], Trajectory], parameters: VehicleParameters, config: GatheringConfig) -> Trajectory:
    """The plan of the most information under which such cars keep to the lane.

    Args:
        plan: makes one with a share of the weight of the information; a usual steering's first plan is not rehearsed,
            since it is known to hold.

    Raises:
        InfeasiblePlanError: there is none; it says of which steering.
    """
    if config.steering.usual:
        return plan(BOLDNESS[0])
    for share in BOLDNESS:
        trajectory = plan(share)
        if holds(trajectory, parameters, config):
            return trajectory
    raise InfeasiblePlanError(
        f"no informative drive along this lane holds with {config.steering.sentence()}: do not drive this car at its "
        "limits; repair its steering, or lower v_end"
    )
