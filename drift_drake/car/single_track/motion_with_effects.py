"""The single-track car with the effects of the catalogue.

All effects on the motion live in one function, `motion_with_effects`, in which a magnitude of zero switches an effect
off; with all at zero it is `motion.motion`. Effects with internal states (lags, relaxation, heat, filtered load
transfer) own those of `InternalStates`. Transport delays act on the commands before they enter here
(`car.effects.delays`).
"""

from typing import Any

from drift_drake.car.effects import changed
from drift_drake.car.effects.magnitudes import (
    Effects,
    InternalStates,
    actuation_of,
    internal_rates,
    internal_starts,
    with_forces,
)
from drift_drake.car.parameters import Constants
from drift_drake.car.scalar import (
    absolute,
    clip,
    cos,
    exp,
    jitable,
    maximum,
    minimum,
    norm2,
    select,
    sin,
    sqrt,
    switched,
    tanh,
)
from drift_drake.car.single_track.motion import (
    Motion,
    body_wrench,
    front_contact_velocity,
    front_slip,
    planar_motion,
    rear_slip,
    static_loads,
    wheel_acceleration,
)
from drift_drake.car.tyre import tyre_force

SLIDING_SPEED_SCALE = 3.0  # [m/s] over which sliding friction drops
HEAT_UNIT = 1e5  # [J] of friction work that make one unit of heat
COOLING_TIME = 12.0  # [s]
LOAD_FILTER_TIME = 0.05  # [s] of the accelerations that shift load
MIN_AXLE_LOAD, MIN_LOAD_SHARE = 200.0, 0.1  # [N], but of a car too light for that a share of the static load
WATT, UNLIMITED = 1e3, 1e9  # [W/kW]; [kW] that no engine has
SHARPNESS = 5  # squarings that make x^32
RATE_LIMIT_TIME = 0.002  # [s] in which a rate-limited wheel settles on a command that it can follow


changed_constants = changed.constants_changed(Constants, {
    name: getattr(changed, name) for name in ("mass", "yaw_inertia", "front_axle_distance", "rear_axle_distance",
                                              "rear_axle_inertia", "gear_ratio", "friction", "front_stiffness",
                                              "rear_stiffness")
})  # fmt: skip
"""The car with the effects that only change parameters."""


@jitable
def steering_rate(steering: Any, delta: Any, q: Effects) -> Any:
    """Rate of the road wheel [rad/s] that follows the command delta [rad] with lag and rate limit."""
    rate = (delta - steering) / maximum(q.steering_lag, RATE_LIMIT_TIME)
    return select(0.0, q.steering_rate_limit, clip(rate, -q.steering_rate_limit, q.steering_rate_limit), rate)


@jitable
def sliding_share(sliding_speed: Any) -> Any:
    """Share of the sliding friction's drop that is there at a sliding speed [m/s]."""
    return 1.0 - exp(-sliding_speed / SLIDING_SPEED_SCALE)


@jitable
def tyre_friction(friction: Any, sliding_speed: Any, heat: Any, a_y: Any, p: Constants, q: Effects) -> Any:
    """Friction of an axle after sliding, heat and lateral load transfer."""
    sliding = 1.0 - switched(q.sliding_friction_drop, sliding_share, sliding_speed)
    lateral = 1.0 - q.lateral_load_transfer * (a_y / p.gravity) * (a_y / p.gravity)
    return maximum(friction * sliding * lateral * (1.0 - q.tyre_thermal_fade * heat), 0.05)


@jitable
def shifted_loads(a_x: Any, p: Constants, q: Effects) -> tuple[Any, Any]:
    """Axle loads (F_zf, F_zr) [N] under the filtered acceleration a_x [m/s^2]."""
    f_zf, f_zr = static_loads(p)
    shift = p.mass * q.longitudinal_load_transfer * a_x / (p.front_axle_distance + p.rear_axle_distance)
    front = maximum(f_zf - shift, minimum(MIN_AXLE_LOAD, MIN_LOAD_SHARE * f_zf))
    return front, maximum(f_zr + shift, minimum(MIN_AXLE_LOAD, MIN_LOAD_SHARE * f_zr))


@jitable
def relaxation_rate(speed: Any, slip: Any, kinematic: Any, q: Effects) -> Any:
    """Rate [1/s] of a lateral slip that follows the kinematic one over a length; speed [m/s] of the contact point."""
    rate = maximum(absolute(speed), 1.0) / maximum(q.tyre_relaxation, 1e-3) * (kinematic - slip)
    return rate * select(0.0, q.tyre_relaxation, 1.0, 0.0)


@jitable
def road_wheel(delta: Any, q: Effects) -> Any:
    """The road-wheel angle [rad] that a command delta [rad] asks for: the car's steering ratio is its own."""
    return delta * (1.0 + q.steering_ratio_error)


@jitable
def axle_friction(omega_r: Any, q: Effects) -> Any:
    """Torque [N m] that opposes the rear axle at a rim speed [m/s]."""
    return switched(q.drivetrain_friction, tanh, omega_r)


@jitable
def power_lacking(demand: Any) -> Any:
    """Share of the power asked for that an engine does not give; demand: over its limit [-].

    1 - (1 + x^32)^(-1/32): a limit is sharp, but what plans and fits has derivatives.
    """
    power = maximum(demand, 0.0)
    for _ in range(SHARPNESS):
        power = power * power
    given = 1.0 + power
    for _ in range(SHARPNESS):
        given = sqrt(given)
    return 1.0 - 1.0 / given


@jitable
def axle_torque(tau: Any, omega_r: Any, gear_ratio: Any, wheel_radius: Any, q: Effects) -> Any:
    """Torque [N m] at the rear axle of an engine's [N m], within its power, less friction."""
    torque = gear_ratio * tau
    most = select(0.0, q.power_limit, q.power_limit, UNLIMITED)
    demand = torque * omega_r / (wheel_radius * WATT * most)
    lacking = switched(select(0.0, q.power_limit, 1.0, 0.0), power_lacking, demand)
    return torque * (1.0 - lacking) - axle_friction(omega_r, q)


@jitable
def motion_with_effects(r: Any, v: Any, beta: Any, omega_r: Any, psi: Any, internal: InternalStates, delta: Any,
                        tau: Any, nominal: Constants, q: Effects, force_x: Any = 0.0, force_y: Any = 0.0,
                        moment: Any = 0.0,
                        ) -> tuple[Motion, InternalStates]:  # fmt: skip
    """Motion of the car with effects, and the rates of the effects' own states.

    Args:
        r, v, beta, omega_r: as in `bicycle`; psi: heading [rad] (only a road's grade depends on it).
        internal: the effects' states; delta, tau: commands, after any transport delay [rad], [N m].
        nominal: the car without effects; q: magnitudes.
        force_x, force_y, moment: optional further force [N] and moment [N m] on the body.
    """
    p = changed_constants(nominal, q)
    delta = road_wheel(delta, q)
    lagged_steering = q.steering_lag + q.steering_rate_limit
    own_angle = select(0.0, lagged_steering, internal.steering, delta) + q.steering_offset
    own_torque = select(0.0, q.torque_lag, internal.torque, tau)
    wheel_angle, torque = actuation_of(own_angle, own_torque, v, q, internal)

    (f_zf, f_zr), along = shifted_loads(internal.a_x, p, q), changed.longitudinal_stiffness(1.0, q)
    v_x, v_y = front_contact_velocity(r, v, beta, wheel_angle, p.front_axle_distance)
    u_x, rear_v_y = v * cos(beta), v * sin(beta) - p.rear_axle_distance * r
    sigma_xf, kinematic_front = front_slip(v_x, v_y, omega_r, p.front_coupling)
    sigma_x, kinematic_rear = rear_slip(r, v, beta, omega_r, p.rear_axle_distance)
    sigma_front = select(0.0, q.tyre_relaxation, internal.front_slip, kinematic_front)
    sigma_rear = select(0.0, q.tyre_relaxation, internal.rear_slip, kinematic_rear)
    front_sliding = norm2(p.front_coupling * (omega_r - v_x), v_y)
    rear_sliding = norm2(omega_r - u_x, rear_v_y)

    mu_front = changed.front_friction(nominal.friction, q)
    mu_rear = changed.rear_friction(nominal.friction, q)
    mu_front = tyre_friction(mu_front, front_sliding, internal.front_heat, internal.a_y, p, q)
    mu_rear = tyre_friction(mu_rear, rear_sliding, internal.rear_heat, internal.a_y, p, q)
    f_xf, f_yf = tyre_force(along * sigma_xf, sigma_front, p.front_stiffness, mu_front * f_zf, p.tyre)
    f_xr, f_yr = tyre_force(along * sigma_x, sigma_rear, p.rear_stiffness, mu_rear * f_zr, p.tyre)

    f_x, f_y, m_z = body_wrench(wheel_angle, f_xf, f_yf, f_xr, f_yr, p.front_axle_distance, p.rear_axle_distance)
    f_x, f_y, m_z = with_forces(r, v, beta, omega_r, psi, p, q, internal, (f_x, f_y, m_z))
    f_x, f_y, m_z = f_x + force_x, f_y + force_y, m_z + moment

    a_x, a_y = f_x / p.mass, f_y / p.mass
    v_dot, beta_dot = planar_motion(r, v, beta, a_x, a_y)
    driving = axle_torque(torque, omega_r, p.gear_ratio, p.wheel_radius, q)
    omega_r_dot = wheel_acceleration(driving, f_xr + f_xf, p.wheel_radius, p.rear_axle_inertia)

    rates = (
        select(0.0, lagged_steering, steering_rate(internal.steering, delta, q), 0.0 * delta),
        select(0.0, q.torque_lag, (tau - internal.torque) / maximum(q.torque_lag, 1e-3), 0.0 * tau),
        relaxation_rate(v_x, internal.front_slip, kinematic_front, q),
        relaxation_rate(u_x, internal.rear_slip, kinematic_rear, q),
        norm2(f_xf, f_yf) * front_sliding / HEAT_UNIT - internal.front_heat / COOLING_TIME,
        norm2(f_xr, f_yr) * rear_sliding / HEAT_UNIT - internal.rear_heat / COOLING_TIME,
        (a_x - internal.a_x) / LOAD_FILTER_TIME,
        (a_y - internal.a_y) / LOAD_FILTER_TIME,
    )
    further = internal_rates(r, v, beta, omega_r, own_angle, own_torque, p, q, internal)
    return Motion(m_z / p.yaw_inertia, v_dot, beta_dot, omega_r_dot, a_x, a_y), InternalStates(*(rates + further))


@jitable
def settled_internal_states(
    r: Any, v: Any, beta: Any, omega_r: Any, delta: Any, tau: Any, nominal: Constants, q: Effects, psi: Any = 0.0
) -> InternalStates:
    """InternalStates of a car that has been in this state for long, its tyres cold: where a run starts."""
    p = changed_constants(nominal, q)
    zero, steering = 0.0 * v, road_wheel(delta, q)
    starts = internal_starts(r, v, beta, omega_r, steering + q.steering_offset, tau, p, q)
    unmoved = InternalStates(*((zero, zero, zero, zero, zero, zero, zero, zero) + starts))  # noqa: RUF005 (for numba)
    angle, _ = actuation_of(steering + q.steering_offset, tau, v, q, unmoved)
    v_x, v_y = front_contact_velocity(r, v, beta, angle, p.front_axle_distance)
    _, sigma_rear = rear_slip(r, v, beta, omega_r, p.rear_axle_distance)
    _, sigma_front = front_slip(v_x, v_y, omega_r, p.front_coupling)
    settled = (steering + zero, tau + zero, sigma_front + zero, sigma_rear + zero, zero, zero)
    internal = InternalStates(*(settled + (zero, zero) + starts))  # noqa: RUF005 (for numba)
    motion, _ = motion_with_effects(r, v, beta, omega_r, psi + zero, internal, delta + zero, tau + zero, nominal, q,
                                    zero, zero, zero)  # fmt: skip
    return InternalStates(*(settled + (motion.a_x, motion.a_y) + starts))  # noqa: RUF005 (for numba)
