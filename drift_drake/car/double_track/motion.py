"""Double-track equations of motion: four tyres, load transfer with roll, a differential (open or not) at the rear.

The first states are the single-track car's (r, v, beta, omega_r; see `bicycle`), at the centre of gravity, omega_r the
mean rim speed of the rear wheels; behind them the car's own, `OwnStates`. The front wheels roll freely: no longitudinal
slip. The tyres' forces follow from the slips that are states, so no equation is implicit. ISO 8855.

Roll is small-angle, about an axis through the roll centres, and the planar equations are those of the whole car's
centre of gravity: the ground forces act on the axis, which a roll moves against that centre.
"""

from typing import Any, NamedTuple

from drift_drake.car.double_track.constants import DoubleTrackConstants, changed_constants
from drift_drake.car.double_track.tyres import tire_force
from drift_drake.car.effects.magnitudes import NO_INTERNAL_STATES, Effects, actuation_of, with_double_track_forces
from drift_drake.car.scalar import absolute, clip, cos, forwards, jitable, loaded_tuple, maximum, select, sin, tanh
from drift_drake.car.single_track.motion import MIN_SLIP_SPEED, Motion, planar_motion, wheel_acceleration
from drift_drake.car.single_track.motion_with_effects import axle_torque, road_wheel, steering_rate

LEAST_LOAD_SHARE = 0.02  # of an axle's load that its unloaded wheel keeps, and of the weight that an axle keeps
MIN_RELAXATION_SPEED = 1.0  # [m/s] floor of the speed at which a tyre rolls through its relaxation length
LOCKING_SPEED = 2.0  # [m/s] difference of the rear rims over which a limited-slip differential's plates come to slide
ITERATIONS = 12  # of loads, roll and compliance; each takes off about nine tenths of the error


@jitable
def sprung_mass(p: DoubleTrackConstants) -> Any:
    """Mass on the springs [kg]."""
    return p.mass - p.front_unsprung_mass - p.rear_unsprung_mass


@jitable
def roll_arm_moment(p: DoubleTrackConstants) -> Any:
    """Sprung mass times the height of its centre above the roll axis [kg m]; unsprung masses are at wheel centres.

    The sprung mass is taken to lie lengthwise where the whole car's centre of gravity is.
    """
    unsprung = p.front_unsprung_mass + p.rear_unsprung_mass
    wheelbase = p.front_axle_distance + p.rear_axle_distance
    axis = (p.front_roll_center * p.rear_axle_distance + p.rear_roll_center * p.front_axle_distance) / wheelbase
    return p.mass * p.cg_height - unsprung * p.wheel_radius - sprung_mass(p) * axis


@jitable
def axle_loads(p: DoubleTrackConstants, a_x: Any) -> tuple[Any, Any]:
    """Axle loads (F_zf, F_zr) [N] at the longitudinal ground force over mass a_x [m/s^2]; their sum is the weight."""
    wheelbase = p.front_axle_distance + p.rear_axle_distance
    weight = p.mass * p.gravity
    least = LEAST_LOAD_SHARE * weight
    rear = weight * p.front_axle_distance / wheelbase + p.mass * a_x * p.cg_height / wheelbase
    rear = clip(rear, least, weight - least)
    return weight - rear, rear


@jitable
def axle_transfer(p: DoubleTrackConstants, roll: Any, roll_rate: Any, a_y: Any) -> tuple[Any, Any]:
    """Load [N] that moves from the left to the right wheel, front and rear.

    Springs, stabilisers and dampers carry the roll moment; the roll centres take the sprung mass's side force and the
    unsprung masses their own without the body rolling.

    Args:
        p: the car; roll [rad], roll_rate [rad/s]: positive to the right side down; a_y: ground force over mass [m/s^2].
    """
    wheelbase = p.front_axle_distance + p.rear_axle_distance
    damping = p.roll_damping / (p.front_roll_stiffness + p.rear_roll_stiffness) * roll_rate
    sprung = sprung_mass(p) / wheelbase
    front_direct = sprung * p.rear_axle_distance * p.front_roll_center + p.front_unsprung_mass * p.wheel_radius
    rear_direct = sprung * p.front_axle_distance * p.rear_roll_center + p.rear_unsprung_mass * p.wheel_radius
    front = p.front_roll_stiffness * (roll + damping) + front_direct * a_y
    rear = p.rear_roll_stiffness * (roll + damping) + rear_direct * a_y
    return front / p.front_track, rear / p.rear_track


@jitable
def wheel_loads(p: DoubleTrackConstants, roll: Any, roll_rate: Any, a_x: Any, a_y: Any) -> tuple[Any, Any, Any, Any]:
    """Loads [N] of the wheels (front left, front right, rear left, rear right); their sum is the weight.

    A wheel that would lift keeps a small share of its axle's load.
    """
    front, rear = axle_loads(p, a_x)
    front_transfer, rear_transfer = axle_transfer(p, roll, roll_rate, a_y)
    largest = 0.5 - LEAST_LOAD_SHARE
    front_transfer = clip(front_transfer, -largest * front, largest * front)
    rear_transfer = clip(rear_transfer, -largest * rear, largest * rear)
    return (0.5 * front - front_transfer, 0.5 * front + front_transfer,
            0.5 * rear - rear_transfer, 0.5 * rear + rear_transfer)  # fmt: skip


class OwnStates(NamedTuple):
    """States beyond the single-track car's; as a value or as a time derivative."""

    steering: Any  # [rad] road-wheel angle before offset and compliance
    torque: Any  # [N m] engine
    rim_difference: Any  # [m/s] rear right minus rear left rim speed
    roll: Any  # [rad] right side down
    roll_rate: Any  # [rad/s]
    a_x: Any  # [m/s^2] ground force over mass, as it has reached the wheel loads
    a_y: Any  # [m/s^2]
    front_left_slip: Any  # [-] lateral slip that makes the force
    front_right_slip: Any  # [-]
    rear_left_slip: Any  # [-]
    rear_right_slip: Any  # [-]
    rear_left_drive_slip: Any  # [-] longitudinal slip that makes the force
    rear_right_drive_slip: Any  # [-]


OWN = len(OwnStates._fields)


@jitable
def own_states(x: Any, first: Any, like: Any) -> OwnStates:
    """The car's own states from the index `first` of all its states on (`scalar.loaded_tuple`)."""
    return OwnStates(*loaded_tuple(x, first, OWN, like))


class WheelForces(NamedTuple):
    """Tyre forces in the wheel frames [N]; the front wheels' longitudinal ones are zero."""

    front_left: Any
    front_right: Any
    rear_left_x: Any
    rear_left_y: Any
    rear_right_x: Any
    rear_right_y: Any


class WheelMotion(NamedTuple):
    """Road-wheel angles [rad], and slips [-] and speeds [m/s] from the wheels' velocities, before any relaxation."""

    left_angle: Any
    right_angle: Any
    front_left_slip: Any
    front_right_slip: Any
    rear_left_slip: Any
    rear_right_slip: Any
    rear_left_drive_slip: Any
    rear_right_drive_slip: Any
    front_left_speed: Any
    front_right_speed: Any
    rear_left_speed: Any
    rear_right_speed: Any


@jitable
def wheel_forces(own: OwnStates, p: DoubleTrackConstants) -> WheelForces:
    """Tyre forces from the slips and loads that are states."""
    load_fl, load_fr, load_rl, load_rr = wheel_loads(p, own.roll, own.roll_rate, own.a_x, own.a_y)
    _, front_left = tire_force(0.0 * own.roll, own.front_left_slip, load_fl, p.front_tire)
    _, front_right = tire_force(0.0 * own.roll, own.front_right_slip, load_fr, p.front_tire)
    left_x, left_y = tire_force(own.rear_left_drive_slip, own.rear_left_slip, load_rl, p.rear_tire)
    right_x, right_y = tire_force(own.rear_right_drive_slip, own.rear_right_slip, load_rr, p.rear_tire)
    return WheelForces(front_left, front_right, left_x, left_y, right_x, right_y)


@jitable
def road_wheel_angles(steering: Any, axle_force: Any, p: DoubleTrackConstants) -> tuple[Any, Any]:
    """Angles (left, right) [rad] of the front wheels: the lateral force turns them back, the inner one turns more.

    The difference is the second-order term of Ackermann's geometry, times the share `ackermann` of it.
    """
    mean = steering - p.steering_compliance * axle_force
    wheelbase = p.front_axle_distance + p.rear_axle_distance
    difference = p.ackermann * p.front_track / (2.0 * wheelbase) * mean * mean
    return mean + difference, mean - difference


@jitable
def front_wheel_slip(u_x: Any, u_y: Any, angle: Any) -> tuple[Any, Any]:
    """(lateral slip [-], rolling speed [m/s]) of a freely rolling wheel whose hub has the velocity (u_x, u_y)."""
    v_x, v_y = u_x * cos(angle) + u_y * sin(angle), -u_x * sin(angle) + u_y * cos(angle)
    return v_y / maximum(absolute(v_x), MIN_SLIP_SPEED), v_x


@jitable
def rear_wheel_slip(u_x: Any, u_y: Any, rim: Any) -> tuple[Any, Any]:
    """(longitudinal, lateral) slip [-] of a driven wheel with the rim speed `rim` [m/s]."""
    rolling = maximum(absolute(rim), MIN_SLIP_SPEED)
    return (rim - u_x) / rolling, u_y / rolling


@jitable
def wheel_motion(r: Any, v: Any, beta: Any, omega_r: Any, left_angle: Any, right_angle: Any, rim_difference: Any,
                 roll_rate: Any, p: DoubleTrackConstants) -> WheelMotion:  # fmt: skip
    """Slips and speeds of all wheels from the car's velocities."""
    u_x = v * cos(beta)
    u_y = v * sin(beta) + roll_arm_moment(p) / p.mass * roll_rate
    front_y, rear_y = u_y + p.front_axle_distance * r, u_y - p.rear_axle_distance * r
    front_half, rear_half = 0.5 * p.front_track * r, 0.5 * p.rear_track * r
    slip_fl, speed_fl = front_wheel_slip(u_x - front_half, front_y, left_angle)
    slip_fr, speed_fr = front_wheel_slip(u_x + front_half, front_y, right_angle)
    drive_rl, slip_rl = rear_wheel_slip(u_x - rear_half, rear_y, omega_r - 0.5 * rim_difference)
    drive_rr, slip_rr = rear_wheel_slip(u_x + rear_half, rear_y, omega_r + 0.5 * rim_difference)
    return WheelMotion(left_angle, right_angle, slip_fl, slip_fr, slip_rl, slip_rr, drive_rl, drive_rr,
                       speed_fl, speed_fr, u_x - rear_half, u_x + rear_half)  # fmt: skip


@jitable
def ground_wrench(forces: WheelForces, left: Any, right: Any, p: DoubleTrackConstants) -> tuple[Any, Any, Any]:
    """Force (F_x, F_y) [N] and yaw moment [N m] of the tyres in the body frame."""
    x_left, y_left = -forces.front_left * sin(left), forces.front_left * cos(left)
    x_right, y_right = -forces.front_right * sin(right), forces.front_right * cos(right)
    rear_x, rear_y = forces.rear_left_x + forces.rear_right_x, forces.rear_left_y + forces.rear_right_y
    moment = (p.front_axle_distance * (y_left + y_right) - p.rear_axle_distance * rear_y
              + 0.5 * p.front_track * (x_right - x_left)
              + 0.5 * p.rear_track * (forces.rear_right_x - forces.rear_left_x))  # fmt: skip
    return x_left + x_right + rear_x, y_left + y_right + rear_y, moment


@jitable
def locking_torque(driving: Any, rim_difference: Any, p: DoubleTrackConstants) -> Any:
    """Torque [N m] that the slower rear wheel has over the faster one by a limited-slip differential's plates."""
    most = p.differential_preload + p.differential_share * absolute(driving)
    return most * tanh(rim_difference / LOCKING_SPEED)


@jitable
def relaxed(kinematic: Any, slip: Any, speed: Any, length: Any) -> Any:
    """Rate [1/s] at which a slip follows the kinematic one over a rolled length [m]."""
    return maximum(absolute(speed), MIN_RELAXATION_SPEED) / length * (kinematic - slip)


@jitable
def roll_acceleration(own: OwnStates, ground_y: Any, p: DoubleTrackConstants) -> Any:
    """d(roll_rate)/dt [rad/s^2] under the tyres' lateral force over mass [m/s^2]."""
    arm = roll_arm_moment(p)
    stiffness = p.front_roll_stiffness + p.rear_roll_stiffness - arm * p.gravity
    return (arm * ground_y - stiffness * own.roll - p.roll_damping * own.roll_rate) / p.roll_inertia


@jitable
def double_track_motion(r: Any, v: Any, beta: Any, omega_r: Any, psi: Any, own: OwnStates, delta: Any, tau: Any,
                        nominal: DoubleTrackConstants, q: Effects,
                        force_x: Any = 0.0, force_y: Any = 0.0,
                        moment: Any = 0.0) -> tuple[Motion, OwnStates]:  # fmt: skip
    """Motion of the car with effects, and the rates of its own states.

    Args:
        r, v, beta, omega_r: as in `bicycle`; psi: heading [rad] (only a road's grade depends on it).
        own: the car's own states; delta, tau: commands, after any transport delay [rad], [N m].
        nominal: the car without effects; q: magnitudes, those of `NOT_ON_FOUR_WHEELS` unused.
        force_x, force_y, moment: optional further force [N] and moment [N m] on the body.
    """
    p = changed_constants(nominal, q)
    delta = road_wheel(delta, q)
    lagged_steering = q.steering_lag + q.steering_rate_limit
    steering, torque = actuation_of(
        select(0.0, lagged_steering, own.steering, delta) + q.steering_offset,
        select(0.0, q.torque_lag, own.torque, tau), v, q, NO_INTERNAL_STATES)  # fmt: skip

    forces = wheel_forces(own, p)
    left, right = road_wheel_angles(steering, forces.front_left + forces.front_right, p)
    w = wheel_motion(r, v, beta, omega_r, left, right, own.rim_difference, own.roll_rate, p)
    ground_x, ground_y, m_z = ground_wrench(forces, left, right, p)
    ground_x = ground_x - p.rolling_resistance * p.mass * p.gravity * forwards(v)
    drag = p.aero_drag * v * absolute(v)
    wrench = ground_x - drag * cos(beta), ground_y - drag * sin(beta), m_z
    f_x, f_y, m_z = with_double_track_forces(r, v, beta, omega_r, psi, p, q, NO_INTERNAL_STATES, wrench)
    a_x, a_y = (f_x + force_x) / p.mass, (f_y + force_y) / p.mass
    v_dot, beta_dot = planar_motion(r, v, beta, a_x, a_y)

    driving = axle_torque(torque, omega_r, p.gear_ratio, p.wheel_radius, q)
    left_x, right_x = forces.rear_left_x, forces.rear_right_x
    omega_r_dot = wheel_acceleration(driving, left_x + right_x, p.wheel_radius, p.rear_axle_inertia)
    # The engine turns with the mean of the rear wheels: their difference moves the wheels alone.
    locking = locking_torque(driving, own.rim_difference, p)
    difference_rate = ((left_x - right_x) * p.wheel_radius - locking) * p.wheel_radius / p.wheel_inertia
    front, rear = p.front_tire.lateral_relaxation, p.rear_tire.lateral_relaxation
    drive = p.rear_tire.longitudinal_relaxation
    rates = OwnStates(
        select(0.0, lagged_steering, steering_rate(own.steering, delta, q), 0.0 * delta),
        select(0.0, q.torque_lag, (tau - own.torque) / maximum(q.torque_lag, 1e-3), 0.0 * tau),
        difference_rate,
        own.roll_rate,
        roll_acceleration(own, ground_y / p.mass, p),
        (ground_x / p.mass - own.a_x) / p.load_time,
        (ground_y / p.mass - own.a_y) / p.load_time,
        relaxed(w.front_left_slip, own.front_left_slip, w.front_left_speed, front),
        relaxed(w.front_right_slip, own.front_right_slip, w.front_right_speed, front),
        relaxed(w.rear_left_slip, own.rear_left_slip, w.rear_left_speed, rear),
        relaxed(w.rear_right_slip, own.rear_right_slip, w.rear_right_speed, rear),
        relaxed(w.rear_left_drive_slip, own.rear_left_drive_slip, w.rear_left_speed, drive),
        relaxed(w.rear_right_drive_slip, own.rear_right_drive_slip, w.rear_right_speed, drive),
    )
    return Motion((m_z + moment) / p.yaw_inertia, v_dot, beta_dot, omega_r_dot, a_x, a_y), rates


@jitable
def settled_states(r: Any, v: Any, beta: Any, omega_r: Any, delta: Any, tau: Any,
                   nominal: DoubleTrackConstants, q: Effects) -> OwnStates:  # fmt: skip
    """The car's own states under constant (r, v, beta, omega_r) and commands, its rear wheels at equal slip."""
    p = changed_constants(nominal, q)
    delta = road_wheel(delta, q)
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
            a_x, a_y = f_x / p.mass - p.rolling_resistance * p.gravity * forwards(v), f_y / p.mass
            roll = arm * a_y / roll_stiffness
    return own
