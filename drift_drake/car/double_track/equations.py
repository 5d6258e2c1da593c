"""The double-track car's equations for `car.equations`: internal states are `motion.OwnStates`."""

from typing import Any

import numpy as np

from drift_drake.car.double_track.deviations import DEVIATIONS, deviated, value_of
from drift_drake.car.double_track.motion import (
    MIN_RELAXATION_SPEED,
    NOT_OF_THIS_CAR,
    OwnStates,
    double_track_motion,
    settled_states,
)
from drift_drake.car.double_track.parameters import changed_constants
from drift_drake.car.effects.catalogue import CATALOGUE, PARAMETRIC
from drift_drake.car.scalar import fixed_tuple, jitable

__all__ = ["DEVIATIONS", "FOLDED", "LACKS", "SIZE", "STEPPED", "changed_constants", "decays", "deviated", "fastest",
           "rates", "settle", "value_of"]  # fmt: skip

OWN = len(OwnStates._fields)
SIZE = 5 + OWN
STEPPED = True  # rims ring in their tyres: along a measured motion internal states need a prediction's steps
LACKS = NOT_OF_THIS_CAR  # effects that mean nothing on this car
FOLDED = tuple(name for name, effect in CATALOGUE.items() if name in PARAMETRIC or effect.double_track == "parameter")
"""Effects that `changed_constants` puts into its numbers."""


@jitable
def settle(z: Any, delta: Any, torque: Any, constants: Any, effects: Any) -> None:
    """Writes the internal states of a car that has long driven so."""
    own = settled_states(z[0], z[1], z[2], z[3], delta, torque, constants, effects)
    for i, state in enumerate(own):
        z[5 + i] = state


@jitable
def rates(z: Any, command: Any, car: Any, out: Any) -> None:
    """Writes the states' rates."""
    constants, effects, wrench = car
    own = OwnStates(*fixed_tuple(z[5:], OWN))
    motion, further = double_track_motion(z[0], z[1], z[2], z[3], z[4], own, command[0], command[1], constants, effects,
                                          wrench[0], wrench[1], wrench[2])  # fmt: skip
    out[0], out[1], out[2], out[3], out[4] = motion.r_dot, motion.v_dot, motion.beta_dot, motion.omega_r_dot, z[0]
    for i, rate in enumerate(further):
        out[5 + i] = rate


@jitable
def fastest(z: Any, constants: Any, effects: Any) -> Any:
    """Rate [1/s] at which a rear rim rings in its tyre, which is that of a spring and a mass; or of a slip."""
    p = changed_constants(constants, effects)
    tire = p.rear_tire
    ring = np.sqrt(tire.longitudinal_stiffness / (p.wheel_inertia * tire.longitudinal_relaxation)) * p.wheel_radius
    least = min(tire.longitudinal_relaxation, tire.lateral_relaxation, p.front_tire.lateral_relaxation)
    return max(ring, max(z[1], MIN_RELAXATION_SPEED) / least)


@jitable
def decays(z: Any, constants: Any, effects: Any, out: Any) -> None:
    """None: internal states are stepped."""
