"""The double-track car's equations for `car.equations`: internal states are `motion.OwnStates`."""

from typing import Any

from drift_drake.car.double_track.constants import DoubleTrackConstants, changed_constants, flattened, unflattened
from drift_drake.car.double_track.deviations import DEVIATIONS, deviated, value_of
from drift_drake.car.double_track.motion import (
    MIN_RELAXATION_SPEED,
    OwnStates,
    double_track_motion,
    own_states,
    settled_states,
)
from drift_drake.car.double_track.parameters import DoubleTrackParameters
from drift_drake.car.effects.catalogue import CATALOGUE, PARAMETRIC
from drift_drake.car.kind import CarKind
from drift_drake.car.proportions import check_double_track
from drift_drake.car.scalar import absolute, jitable, loaded_tuple, maximum, minimum, sqrt, stored


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


KIND = CarKind(
    label="double-track car",
    constants=DoubleTrackConstants,
    own=OwnStates._fields,
    own_scale=OwnStates(
        steering=0.3, torque=100.0, rim_difference=3.0, roll=0.05, roll_rate=0.3, a_x=5.0, a_y=5.0, front_left_slip=0.3,
        front_right_slip=0.3, rear_left_slip=0.3, rear_right_slip=0.3, rear_left_drive_slip=0.3,
        rear_right_drive_slip=0.3,
    ),
    rates=rates,
    settle=settle,
    fastest=fastest,
    changed_constants=changed_constants,
    folded=tuple(name for name, effect in CATALOGUE.items()
                 if name in PARAMETRIC or effect.double_track == "parameter"),
    deviations=DEVIATIONS,
    value_of=value_of,
    deviated=deviated,
    flattened=flattened,
    unflattened=unflattened,
    parameters=DoubleTrackParameters,
    key="double_track",
    check=check_double_track,
)  # fmt: skip
