"""Where a run starts: the car's own states after it has been in a motion for long."""

from typing import Any

from drift_drake.vehicle.double_track.constants import DoubleTrackConstants, changed_constants
from drift_drake.vehicle.double_track.loads import roll_arm_moment
from drift_drake.vehicle.double_track.motion import (
    OwnStates,
    ground_wrench,
    road_wheel_angles,
    wheel_forces,
    wheel_motion,
)
from drift_drake.vehicle.effects import Effects
from drift_drake.vehicle.scalar import jitable

ITERATIONS = 12  # of loads, roll and compliance; each takes off about nine tenths of the error


@jitable
def settled_states(r: Any, v: Any, beta: Any, omega_r: Any, delta: Any, tau: Any,
                   nominal: DoubleTrackConstants, q: Effects) -> OwnStates:  # fmt: skip
    """The car's own states under constant (r, v, beta, omega_r) and commands, its rear wheels at equal slip."""
    p = changed_constants(nominal, q)
    steering, zero = delta + q.steering_offset, 0.0 * (r + v + beta + omega_r + delta + tau)
    arm = roll_arm_moment(p)
    roll_stiffness = p.front_roll_stiffness + p.rear_roll_stiffness - arm * p.gravity
    difference = p.rear_track * r + zero
    left, right = road_wheel_angles(steering + zero, zero, p)
    a_x = a_y = roll = zero
    for i in range(ITERATIONS + 1):
        w = wheel_motion(r, v, beta, omega_r, left, right, difference, zero, p)
        own = OwnStates(delta + zero, tau + zero, difference, roll, zero, a_x, a_y,
                        w.front_left_slip, w.front_right_slip, w.rear_left_slip, w.rear_right_slip,
                        w.rear_left_drive_slip, w.rear_right_drive_slip)  # fmt: skip
        if i < ITERATIONS:
            forces = wheel_forces(own, p)
            left, right = road_wheel_angles(steering, forces.front_left + forces.front_right, p)
            f_x, f_y, _ = ground_wrench(forces, left, right, p)
            a_x, a_y = f_x / p.mass - p.rolling_resistance * p.gravity, f_y / p.mass
            roll = arm * a_y / roll_stiffness
    return own
