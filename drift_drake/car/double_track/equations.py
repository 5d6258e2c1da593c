"""The double-track car's equations for `car.equations`: internal states are `motion.OwnStates`."""

from typing import Any

from drift_drake.car.double_track.constants import changed_constants, flattened, unflattened
from drift_drake.car.double_track.deviations import DEVIATIONS, deviated, value_of
from drift_drake.car.double_track.motion import (
    MIN_RELAXATION_SPEED,
    NOT_OF_THIS_CAR,
    OWN,
    double_track_motion,
    own_states,
    settled_states,
)
from drift_drake.car.effects.catalogue import CATALOGUE, PARAMETRIC
from drift_drake.car.effects.magnitudes import COUNT, Effects
from drift_drake.car.lanes import load_lanes, load_lanes_tuple
from drift_drake.car.scalar import absolute, jitable, loaded_tuple, maximum, minimum, sqrt, stored

__all__ = ["DEVIATIONS", "FOLDED", "LACKS", "SIZE", "STEPPED", "cars_in_lanes", "changed_constants", "decays",
           "deviated", "fastest", "flattened", "rates", "settle", "value_of"]  # fmt: skip

SIZE = 5 + OWN
STEPPED = True  # rims ring in their tyres: along a measured motion internal states need a prediction's steps
LACKS = NOT_OF_THIS_CAR  # effects that mean nothing on this car
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
