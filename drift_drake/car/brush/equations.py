"""Equations of a two-track car on brush tyres whose friction falls with sliding speed, for `car.equations`.

Four wheels with loads that follow the body's accelerations through a mode of roll, a limited-slip differential or a
motor for each rear wheel whose torques turn the car, and steering that gives way under the axles' forces and the roll.
The tyre is the brush model (Pacejka 2012, section 3.2) of combined slip; the slips of an axle lag over a rolled length.
ISO 8855, at the centre of gravity. The front wheels roll freely.
"""

from typing import Any, NamedTuple

from drift_drake.car.brush.parameters import (
    DEVIATIONS,
    FOLDED,
    BrushConstants,
    BrushParameters,
    changed_constants,
)
from drift_drake.car.effects import changed
from drift_drake.car.effects.magnitudes import (
    NO_INTERNAL_STATES,
    Effects,
    actuation_of,
    with_double_track_forces,
)
from drift_drake.car.kind import CarKind
from drift_drake.car.proportions import check_brush
from drift_drake.car.scalar import (
    absolute,
    clip,
    cos,
    exp,
    forwards,
    jitable,
    loaded_tuple,
    maximum,
    minimum,
    norm2,
    select,
    sin,
    stored,
)
from drift_drake.car.single_track.motion import planar_motion
from drift_drake.car.single_track.motion_with_effects import axle_torque, road_wheel, steering_rate

LEAST_SPEED, LEAST_LOAD, LEAST_GRIP = 0.3, 1e-3, 0.3  # [m/s], shares of the weight and of the friction
VECTORED = 6.0  # [1] of g times the wheelbase: the square of the speed at which a turn asks for half its yaw rate
ITERATIONS = 12  # of loads and angles that settle; each takes off three quarters of the error


class BrushStates(NamedTuple):
    """The car's own states; as a value or as a time derivative."""

    rim_difference: Any  # [m/s] rear right minus rear left rim speed
    steering: Any  # [rad] road-wheel angle before the offset
    torque: Any  # [N m] engine
    a_x: Any  # [m/s^2] as it has reached the wheel loads
    a_y: Any  # [m/s^2]
    a_y_rate: Any  # [m/s^3]
    front_slip: Any  # [-] lateral slip that makes the force
    rear_slip: Any  # [-]


OWN = len(BrushStates._fields)


class Forces(NamedTuple):
    """Side force of the front axle, forces of the rear wheels in their own frames [N], and the wheels' angles [rad]."""

    front: Any
    left_x: Any
    left_y: Any
    right_x: Any
    right_y: Any
    angle_front: Any
    angle_rear: Any


@jitable
def brush_force(slip_x: Any, slip_y: Any, load: Any, stiffness: Any, friction: Any, speed: Any,
                p: BrushConstants) -> tuple[Any, Any]:  # fmt: skip
    """Force (F_x, F_y) [N] that a wheel puts on the car, from the slip of its contact [-] at a speed [m/s]; stiffness:
    force per unit slip over the load [-]."""
    slip = norm2(slip_x, slip_y)
    grip = friction * (1.0 - p.load_sensitivity * (load / p.nominal_load - 1.0))
    left = p.sliding_friction + (1.0 - p.sliding_friction) * exp(-slip * speed / p.sliding_speed)
    peak = maximum(grip, LEAST_GRIP * friction) * load
    part = minimum(stiffness * load * slip / (3.0 * peak), 1.0)  # of the contact that slides
    force = peak * part * (3.0 - 3.0 * part + part * part) * (1.0 - part * part * (1.0 - left))
    return -force * slip_x / slip, -force * slip_y / slip


@jitable
def locking_torque(torque: Any, difference: Any, p: BrushConstants) -> Any:
    """Torque [N m] that the slower wheel has more than the faster one; `difference`: rim speeds, right less left."""
    most = p.lock_least + p.lock_share * absolute(torque)
    return clip(p.lock * difference, -most, most)


@jitable
def wheel_loads(a_x: Any, a_y: Any, p: BrushConstants) -> tuple[Any, Any, Any, Any]:
    """Loads [N] of the wheels front left, front right, rear left and rear right under accelerations [m/s^2]."""
    across = p.mass * a_y * p.cg_height / p.track  # from the left wheels to the right ones
    across_front, across_rear = p.front_roll_share * across, (1.0 - p.front_roll_share) * across
    weight, length = p.mass * p.gravity, p.front_axle_distance + p.rear_axle_distance
    along, least = p.mass * p.cg_height * a_x / length, LEAST_LOAD * weight
    front = 0.5 * (weight * p.rear_axle_distance / length - along)
    rear = 0.5 * (weight * p.front_axle_distance / length + along)
    return (maximum(front - across_front, least), maximum(front + across_front, least),
            maximum(rear - across_rear, least), maximum(rear + across_rear, least))  # fmt: skip


@jitable
def wheel_angles(steering: Any, own: BrushStates, p: BrushConstants) -> tuple[Any, Any]:
    """Angles [rad] of the front and the rear wheels: axle forces, in proportion to the slips that lag, turn them."""
    front = p.front_compliance * clip(p.front_cornering * own.front_slip, -1.0, 1.0) + p.roll_steer * own.a_y
    rear = p.rear_compliance * clip(p.rear_cornering * own.rear_slip, -1.0, 1.0)
    return steering + front, p.rear_steer * steering + rear


@jitable
def kinematic_slips(r: Any, u: Any, w: Any, front: Any, rear: Any, p: BrushConstants) -> tuple[Any, Any]:
    """Lateral slips [-] of the axles whose wheels stand at these angles [rad], before they lag."""
    speed = maximum(absolute(u), LEAST_SPEED)
    return (w + p.front_axle_distance * r - front * u) / speed, (w - p.rear_axle_distance * r - rear * u) / speed


@jitable
def wheel_forces(r: Any, u: Any, omega_r: Any, steering: Any, own: BrushStates, friction: tuple[Any, Any],
                 p: BrushConstants) -> Forces:  # fmt: skip
    """Forces of the tyres from the slips and loads that are states; friction [-] of the front and the rear axle."""
    load_fl, load_fr, load_rl, load_rr = wheel_loads(own.a_x, own.a_y, p)
    angle_front, angle_rear = wheel_angles(steering, own, p)
    speed, half = maximum(absolute(u), LEAST_SPEED), 0.5 * p.track
    slip, none = own.front_slip, 0.0 * own.front_slip
    _, left = brush_force(none, slip, load_fl, p.front_cornering, friction[0], speed, p)
    _, right = brush_force(none, slip, load_fr, p.front_cornering, friction[0], speed, p)
    slip_left = (u - half * r - (omega_r - 0.5 * own.rim_difference)) / speed
    slip_right = (u + half * r - (omega_r + 0.5 * own.rim_difference)) / speed
    left_x, left_y = brush_force(slip_left, own.rear_slip, load_rl, p.rear_cornering, friction[1], speed, p)
    right_x, right_y = brush_force(slip_right, own.rear_slip, load_rr, p.rear_cornering, friction[1], speed, p)
    return Forces(left + right, left_x, left_y, right_x, right_y, angle_front, angle_rear)


@jitable
def body_wrench(v: Any, beta: Any, f: Forces, p: BrushConstants) -> tuple[Any, Any, Any]:
    """Force (F_x, F_y) [N] and yaw moment [N m] of the tyres, their rolling and the air, in the body frame."""
    drag = p.aero_drag * v * absolute(v)
    f_x = f.left_x + f.right_x - f.front * sin(f.angle_front) - p.rolling_resistance * p.mass * p.gravity * forwards(v)
    f_y = f.left_y + f.right_y + f.front * cos(f.angle_front)
    moment = (p.front_axle_distance * f.front * cos(f.angle_front) - p.rear_axle_distance * (f.left_y + f.right_y)
              + 0.5 * p.track * (f.right_x - f.left_x))  # fmt: skip
    return f_x - drag * cos(beta), f_y - drag * sin(beta), moment


@jitable
def axle_frictions(nominal: BrushConstants, q: Effects) -> tuple[Any, Any]:
    """Friction [-] of the front and the rear axle, at the nominal load."""
    return changed.front_friction(nominal.friction, q), changed.rear_friction(nominal.friction, q)


@jitable
def rates(z: Any, command: Any, car: Any, out: Any) -> None:
    """Writes the states' rates; where commands are `lanes`, those of that many cars."""
    nominal, q, wrench = car
    delta, tau = command
    r, v, beta, omega_r, psi = loaded_tuple(z, 0, 5, delta)
    own = BrushStates(*loaded_tuple(z, 5, OWN, delta))
    p, asked = changed_constants(nominal, q), road_wheel(delta, q)
    lagged = q.steering_lag + q.steering_rate_limit
    steering, torque = actuation_of(select(0.0, lagged, own.steering, asked) + q.steering_offset,
                                    select(0.0, q.torque_lag, own.torque, tau), v, q, NO_INTERNAL_STATES)  # fmt: skip
    u, w = v * cos(beta), v * sin(beta)
    f = wheel_forces(r, u, omega_r, steering, own, axle_frictions(nominal, q), p)
    f_x, f_y, m_z = with_double_track_forces(r, v, beta, omega_r, psi, p, q, NO_INTERNAL_STATES,
                                             body_wrench(v, beta, f, p))  # fmt: skip
    a_x, a_y = (f_x + wrench[0]) / p.mass, (f_y + wrench[1]) / p.mass
    v_dot, beta_dot = planar_motion(r, v, beta, a_x, a_y)

    axle = axle_torque(torque, omega_r, p.gear_ratio, p.wheel_radius, q)
    locked = locking_torque(axle, own.rim_difference, p)
    length = p.front_axle_distance + p.rear_axle_distance
    wanted = u * steering / length / (1.0 + u * u / (VECTORED * p.gravity * length))
    vectored = p.wheel_radius / p.track * p.vectoring * (wanted - r)
    by_torque = p.wheel_radius / (0.5 * p.rear_axle_inertia)
    speed = maximum(absolute(u), LEAST_SPEED)
    front, rear = kinematic_slips(r, u, w, f.angle_front, f.angle_rear, p)
    found = (
        (m_z + wrench[2]) / p.yaw_inertia,
        v_dot,
        beta_dot,
        0.5 * by_torque * (axle - p.wheel_radius * (f.left_x + f.right_x)),
        r,
        by_torque * (2.0 * vectored - locked + p.wheel_radius * (f.left_x - f.right_x)),
        select(0.0, lagged, steering_rate(own.steering, asked, q), 0.0 * delta),
        select(0.0, q.torque_lag, (tau - own.torque) / maximum(q.torque_lag, 1e-3), 0.0 * tau),
        (a_x - own.a_x) / p.pitch_time,
        own.a_y_rate,
        p.roll_frequency * (p.roll_frequency * (a_y - own.a_y) - 2.0 * p.roll_damping * own.a_y_rate),
        speed / p.relaxation * (front - own.front_slip),
        speed / p.relaxation * (rear - own.rear_slip),
    )
    for i, rate in enumerate(found):
        stored(out, i, rate)


@jitable
def settle(z: Any, delta: Any, torque: Any, constants: Any, effects: Any) -> None:
    """Writes the own states of a car that has long driven so, its rear wheels at equal slip; where commands are
    `lanes`, of that many cars."""
    r, v, beta, omega_r, psi = loaded_tuple(z, 0, 5, delta)
    p, asked = changed_constants(constants, effects), road_wheel(delta, effects)
    zero = 0.0 * (r + v + beta + omega_r + delta + torque)
    steering, friction = asked + effects.steering_offset + zero, axle_frictions(constants, effects)
    u, w = v * cos(beta), v * sin(beta)
    own = BrushStates(p.track * r + zero, asked + zero, torque + zero, zero, zero, zero, zero, zero)
    for _ in range(ITERATIONS):
        front, rear = wheel_angles(steering, own, p)
        slip_front, slip_rear = kinematic_slips(r, u, w, front, rear, p)
        own = BrushStates(own.rim_difference, own.steering, own.torque, own.a_x, own.a_y, zero, slip_front, slip_rear)
        wrench = body_wrench(v, beta, wheel_forces(r, u, omega_r, steering, own, friction, p), p)
        f_x, f_y, _ = with_double_track_forces(r, v, beta, omega_r, psi, p, effects, NO_INTERNAL_STATES, wrench)
        own = BrushStates(own.rim_difference, own.steering, own.torque, f_x / p.mass, f_y / p.mass, zero, slip_front,
                          slip_rear)  # fmt: skip
    for i, state in enumerate(own):
        stored(z, 5 + i, state)


@jitable
def fastest(z: Any, constants: Any, effects: Any) -> Any:
    """Rate [1/s] at which a rear rim settles in grip, a slip over its length, or the body rolls."""
    p = changed_constants(constants, effects)
    speed = maximum(absolute(z[1] * cos(z[2])), LEAST_SPEED)
    load = p.mass * p.gravity * p.front_axle_distance / (p.front_axle_distance + p.rear_axle_distance)
    rim = p.rear_cornering * load * p.wheel_radius * p.wheel_radius / (p.rear_axle_inertia * speed)
    return maximum(maximum(rim, speed / p.relaxation), maximum(p.roll_frequency, 1.0 / p.pitch_time))


KIND = CarKind(
    label="brush car",
    constants=BrushConstants,
    own=BrushStates._fields,
    own_scale=BrushStates(rim_difference=3.0, steering=0.3, torque=100.0, a_x=5.0, a_y=5.0, a_y_rate=50.0,
                          front_slip=0.3, rear_slip=0.3),
    rates=rates,
    settle=settle,
    fastest=fastest,
    changed_constants=changed_constants,
    folded=FOLDED,
    deviations=DEVIATIONS,
    parameters=BrushParameters,
    key="brush",
    check=check_brush,
)  # fmt: skip
