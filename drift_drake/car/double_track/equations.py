"""The double-track car's equations for `car.equations`: internal states are `motion.OwnStates`."""

from typing import Any

import numpy as np

from drift_drake.car.compilation import compiled
from drift_drake.car.double_track.constants import changed_constants, flattened, unflattened
from drift_drake.car.double_track.deviations import DEVIATIONS, deviated, value_of
from drift_drake.car.double_track.motion import (
    MIN_RELAXATION_SPEED,
    OwnStates,
    double_track_motion,
    own_states,
    settled_states,
)
from drift_drake.car.effects.catalogue import CATALOGUE, PARAMETRIC
from drift_drake.car.effects.magnitudes import COUNT, NOT_ON_FOUR_WHEELS, Effects
from drift_drake.car.lanes import load_lanes, load_lanes_tuple
from drift_drake.car.on_path import plant_rates_of
from drift_drake.car.scalar import absolute, fixed_tuple, jitable, loaded_tuple, maximum, minimum, sqrt, stored
from drift_drake.common.arrays import Array

__all__ = ["DEVIATIONS", "FOLDED", "LABEL", "LACKS", "OWN", "OWN_SCALE", "SIZE", "STEPPED", "cars_in_lanes",
           "changed_constants", "decays", "deviated", "fastest", "flattened", "plant_rates", "rates", "settle",
           "unflattened", "value_of"]  # fmt: skip

LABEL = "double-track car"
OWN = OwnStates._fields
OWN_SCALE = OwnStates(
    steering=0.3, torque=100.0, rim_difference=3.0, roll=0.05, roll_rate=0.3, a_x=5.0, a_y=5.0, front_left_slip=0.3,
    front_right_slip=0.3, rear_left_slip=0.3, rear_right_slip=0.3, rear_left_drive_slip=0.3, rear_right_drive_slip=0.3,
)  # fmt: skip
SIZE = 5 + len(OWN)
STEPPED = True  # rims ring in their tyres: along a measured motion internal states need a prediction's steps
LACKS = NOT_ON_FOUR_WHEELS
FOLDED = tuple(name for name, effect in CATALOGUE.items() if name in PARAMETRIC or effect.double_track == "parameter")
"""Effects that `changed_constants` puts into its numbers."""


@jitable
def cars_in_lanes(numbers: Any, effects: Any) -> Any:
    """`DoubleTrackConstants` and `Effects` of `lanes` of cars, from flat arrays (`flattened`)."""
    return unflattened(numbers, load_lanes(numbers, 0)), Effects(*load_lanes_tuple(effects, 0, COUNT))


@jitable
def settle(z: Any, delta: Any, torque: Any, constants: Any, effects: Any) -> None:
    """Writes the internal states of a car that has long driven so; where commands are `lanes`, of that many cars."""
    r, v, beta, omega_r = loaded_tuple(z, 0, 4, delta)
    own = settled_states(r, v, beta, omega_r, delta, torque, constants, effects)
    for i, state in enumerate(own):
        stored(z, 5 + i, state)


@jitable
def rates(z: Any, command: Any, car: Any, out: Any) -> None:
    """Writes the states' rates; where commands are `lanes`, those of that many cars."""
    constants, effects, wrench = car
    delta, torque = command
    r, v, beta, omega_r, psi = loaded_tuple(z, 0, 5, delta)
    motion, further = double_track_motion(r, v, beta, omega_r, psi, own_states(z, 5, delta), delta, torque, constants,
                                          effects, wrench[0], wrench[1], wrench[2])  # fmt: skip
    stored(out, 0, motion.r_dot)
    stored(out, 1, motion.v_dot)
    stored(out, 2, motion.beta_dot)
    stored(out, 3, motion.omega_r_dot)
    stored(out, 4, r)
    for i, rate in enumerate(further):
        stored(out, 5 + i, rate)


# Constants and magnitudes come as arrays, which compiled code takes faster than tuples of numbers.
@compiled
def plant_rates(x: Array, u: Array, wrench: Array, curvature: float, p: Array, q: Array) -> Array:
    """`on_path.plant_rates_of` on floats, as an array."""
    out = np.empty(len(x) + 2)
    plant_rates_of(rates, x, u, wrench, curvature, unflattened(p), Effects(*fixed_tuple(q, COUNT)),
                   np.empty((2, SIZE)), out)  # fmt: skip
    return out


@jitable
def fastest(z: Any, constants: Any, effects: Any) -> Any:
    """Rate [1/s] at which a rear rim rings in its tyre, which is that of a spring and a mass; or of a slip."""
    p = changed_constants(constants, effects)
    tire = p.rear_tire
    ring = sqrt(tire.longitudinal_stiffness / (p.wheel_inertia * tire.longitudinal_relaxation)) * p.wheel_radius
    lateral = minimum(tire.lateral_relaxation, p.front_tire.lateral_relaxation)
    rolling = maximum(absolute(z[1]), MIN_RELAXATION_SPEED)
    return maximum(ring, rolling / minimum(tire.longitudinal_relaxation, lateral))


@jitable
def decays(z: Any, constants: Any, effects: Any, out: Any) -> None:
    """None: internal states are stepped."""
