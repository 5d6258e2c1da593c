"""A two-track car on brush tyres whose friction falls with sliding speed: equations that the package has nothing of.

Four wheels with loads that follow the body's accelerations through a mode of roll, a limited-slip differential or a
motor for each rear wheel whose torques turn the car, and steering that gives way under the axles' forces and the roll.
Simulated worlds alone use it. ISO 8855, body velocities (u, w) at the centre of gravity.
"""

from typing import Any, NamedTuple

import numpy as np

from drift_drake.car.compilation import compiled
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.scalar import jitable
from drift_drake.car.single_track.motion_with_effects import axle_torque, steering_rate
from drift_drake.common.arrays import Array
from experiments.benchmarks.rows import SUBSTEPS, runge_kutta_row

STATES = ("u", "w", "r", "psi", "x", "y", "rim_left", "rim_right", "steering", "torque", "a_x", "a_y", "a_y_rate",
          "slip_front", "slip_rear")  # fmt: skip
LEAST_SPEED, LEAST_LOAD, DEFINITE = 0.3, 1e-3, 1e-9  # [m/s], share of a static load, [-]


class BrushCar(NamedTuple):
    """One car, in SI. `stiffness`: an axle's force per unit slip over its load; rims are of the two rear wheels."""

    mass: float
    yaw_inertia: float
    front_axle_distance: float
    rear_axle_distance: float
    track: float
    cg_height: float
    front_roll_share: float  # of the load that crosses over in a turn
    roll_frequency: float  # [rad/s] with which it follows
    roll_damping: float  # [-]
    pitch_time: float  # [s] with which load moves between the axles
    wheel_radius: float
    rear_axle_inertia: float  # of both rear wheels and what drives them
    gear_ratio: float
    friction: float
    sliding_friction: float  # share of it that is left at a high sliding speed
    sliding_speed: float  # [m/s] over which it falls
    load_sensitivity: float  # by which friction falls as a wheel's load doubles
    front_stiffness: float
    rear_stiffness: float
    relaxation: float  # [m]
    rolling_resistance: float
    aero_drag: float
    front_compliance: float  # [rad] that an axle yields under its static load as a lateral force
    rear_compliance: float
    roll_steer: float  # [rad s^2/m] of the front wheels
    rear_steer: float  # share of the front's angle
    lock: float  # [N m s/m] of a limited-slip differential, per difference of rim speeds
    lock_share: float  # of the axle's torque that it locks with at most
    lock_least: float  # [N m] that it locks with in any case
    vectoring: float  # [N m s] yaw moment that the rear motors make per yaw rate that steering asks for and is not had
    steering_limit: float
    torque_min: float
    torque_max: float
    noise: float  # of the sensors, over a full-size car's
    gravity: float = 9.81


@jitable
def brush_force(slip_x: Any, slip_y: Any, load: Any, stiffness: Any, friction: Any, speed: Any, p: Any) -> Any:
    """Force (F_x, F_y) [N] that a wheel puts on the car, from the slip of its contact [-] at a speed [m/s]."""
    slip = np.sqrt(slip_x * slip_x + slip_y * slip_y) + DEFINITE
    static = p.mass * p.gravity / 4.0
    grip = friction * (1.0 - p.load_sensitivity * (load / static - 1.0))
    left = p.sliding_friction + (1.0 - p.sliding_friction) * np.exp(-slip * speed / p.sliding_speed)
    peak = max(grip, 0.3 * friction) * load
    part = min(stiffness * load * slip / (3.0 * peak), 1.0)  # of the contact that slides
    force = peak * part * (3.0 - 3.0 * part + part * part) * (1.0 - part * part * (1.0 - left))
    return -force * slip_x / slip, -force * slip_y / slip


@jitable
def differential(torque: Any, difference: Any, p: Any) -> Any:
    """Torque [N m] that the slower wheel has more than the faster one; `difference`: rim speeds, right less left."""
    most = p.lock_least + p.lock_share * abs(torque)
    return min(max(p.lock * difference, -most), most)


@compiled
def wheel_loads(z: Any, mass: Any, a: Any, b: Any, p: Any) -> Any:
    """Loads [N] of the wheels front left, front right, rear left and right; a, b: from the axles to the centre [m]."""
    across = mass * z[11] * p.cg_height / p.track  # from the left wheels to the right ones
    across_front, across_rear = p.front_roll_share * across, (1.0 - p.front_roll_share) * across
    weight, length = mass * p.gravity, a + b
    along, least = mass * p.cg_height * z[10] / length, LEAST_LOAD * weight
    front, rear = 0.5 * (weight * b / length - along), 0.5 * (weight * a / length + along)
    load_fl, load_fr = max(front - across_front, least), max(front + across_front, least)
    return load_fl, load_fr, max(rear - across_rear, least), max(rear + across_rear, least)


@compiled
def rates(z: Any, command: Any, car: Any, out: Any) -> Any:
    """Writes d(STATES)/dt under the steering [rad] and torque [N m] commands; returns (a_x, a_y) [m/s^2]."""
    delta, tau = command[0], command[1]
    p, q = car
    u, w, r, psi = z[0], z[1], z[2], z[3]
    a, b = p.front_axle_distance + q.cg_shift, p.rear_axle_distance - q.cg_shift
    mass = p.mass * (1.0 + q.mass_error)
    length, weight = a + b, mass * p.gravity
    friction = p.friction * (1.0 + q.friction_level)
    lagging, delta = q.steering_lag + q.steering_rate_limit > 0.0, delta * (1.0 + q.steering_ratio_error)
    steering = (z[8] if lagging else delta) + q.steering_offset
    torque = z[9] if q.torque_lag > 0.0 else tau

    load_fl, load_fr, load_rl, load_rr = wheel_loads(z, mass, a, b, p)
    # Axle forces, in proportion to the slips that lag, turn the wheels back.
    yields_front = p.front_compliance * max(min(p.front_stiffness * z[13], 1.0), -1.0)
    yields_rear = p.rear_compliance * max(min(p.rear_stiffness * z[14], 1.0), -1.0)
    angle_front = steering + yields_front + p.roll_steer * z[11]
    angle_rear = p.rear_steer * steering + yields_rear
    speed = max(u, LEAST_SPEED)
    kinematic_front = (w + a * r) / speed - angle_front
    kinematic_rear = (w - b * r) / speed - angle_rear
    relaxation = p.relaxation + q.tyre_relaxation

    grip_front = friction * (1.0 + q.front_rear_friction_split)
    grip_rear = friction * (1.0 - q.front_rear_friction_split)
    stiff_front = p.front_stiffness * (1.0 + q.front_stiffness_error)
    stiff_rear = p.rear_stiffness * (1.0 + q.rear_stiffness_error)
    side_front = brush_force(0.0, z[13], load_fl, stiff_front, grip_front, speed, p)[1]
    side_front += brush_force(0.0, z[13], load_fr, stiff_front, grip_front, speed, p)[1]
    half = 0.5 * p.track
    left_x, left_y = brush_force((u - half * r - z[6]) / speed, z[14], load_rl, stiff_rear, grip_rear, speed, p)
    right_x, right_y = brush_force((u + half * r - z[7]) / speed, z[14], load_rr, stiff_rear, grip_rear, speed, p)

    drag = (p.aero_drag + q.aero_drag) * np.sqrt(u * u + w * w)
    rolling = (p.rolling_resistance + q.rolling_resistance) * weight
    uphill = weight * np.sin(q.road_grade)
    f_x = left_x + right_x - side_front * np.sin(angle_front) - rolling - drag * u - uphill * np.cos(psi)
    f_y = left_y + right_y + side_front * np.cos(angle_front) - drag * w + uphill * np.sin(psi)
    f_y -= weight * np.sin(q.road_bank)
    moment = a * side_front * np.cos(angle_front) - b * (left_y + right_y) + half * (right_x - left_x)
    a_x, a_y = f_x / mass, f_y / mass

    gear_ratio = p.gear_ratio * (1.0 + q.torque_gain_error)
    axle = axle_torque(torque, 0.5 * (z[6] + z[7]), gear_ratio, p.wheel_radius, q)
    locked = differential(axle, z[7] - z[6], p)
    # A motor for each wheel turns the car as steering asks for, if the car is one with two.
    wanted = speed * steering / length / (1.0 + (speed * speed / (6.0 * p.gravity * length)))
    vectored = 0.5 * p.wheel_radius / half * p.vectoring * (wanted - r) if p.vectoring > 0.0 else 0.0
    half_inertia = 0.5 * p.rear_axle_inertia * (1.0 + q.drivetrain_inertia_error)
    out[0], out[1], out[2] = a_x + r * w, a_y - r * u, moment / (p.yaw_inertia * (1.0 + q.yaw_inertia_error))
    out[3], out[4], out[5] = r, u * np.cos(psi) - w * np.sin(psi), u * np.sin(psi) + w * np.cos(psi)
    radius = p.wheel_radius
    out[6] = radius / half_inertia * (0.5 * axle + 0.5 * locked - vectored - radius * left_x)
    out[7] = radius / half_inertia * (0.5 * axle - 0.5 * locked + vectored - radius * right_x)
    out[8] = steering_rate(z[8], delta, q) if lagging else 0.0
    out[9] = (tau - z[9]) / q.torque_lag if q.torque_lag > 0.0 else 0.0
    out[10] = (a_x - z[10]) / p.pitch_time
    out[11] = z[12]
    out[12] = p.roll_frequency * (p.roll_frequency * (a_y - z[11]) - 2.0 * p.roll_damping * z[12])
    out[13] = speed / relaxation * (kinematic_front - z[13])
    out[14] = speed / relaxation * (kinematic_rear - z[14])
    return a_x, a_y


@compiled
def _advance(z: Any, row: Any, delta: Any, tau: Any, p: Any, q: Any) -> Any:
    return runge_kutta_row(rates, z, row, delta, tau, (p, q), SUBSTEPS)


def advance(z: Array, row: int, delta: Array, tau: Array, p: BrushCar, q: Effects) -> tuple[Array, Array]:
    """States [15] a row later, and (a_x, a_y) [m/s^2] there; delta, tau: commands [rows], filled up to row + 1."""
    later = z.copy()
    acceleration = _advance(later, row, delta, tau, p, q)
    return later, np.array(acceleration)
