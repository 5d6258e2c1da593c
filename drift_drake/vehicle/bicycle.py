"""Single-track equations of motion in curvilinear coordinates (Appendix A of Davydov et al.).

State (r, v, beta, omega_r, e, dphi): yaw rate [rad/s], speed [m/s], sideslip [rad], rear rim speed [m/s], lateral
[m] and course [rad] deviation from the path. Input (delta, tau): road-wheel angle [rad], engine torque [N m].
ISO 8855: x forward, y left, z up. The small functions are shared by the nominal car and the car with effects.
"""

from typing import Any, NamedTuple

import numpy as np

from drift_drake.vehicle.parameters import Constants
from drift_drake.vehicle.scalar import cos, jitable, maximum, sin
from drift_drake.vehicle.tyre import tyre_force

STATES = ("r", "v", "beta", "omega_r", "e", "dphi")
INPUTS = ("delta", "tau")

MIN_SLIP_SPEED = 0.5  # [m/s] floor of the speed that slips are divided by
MIN_SPEED = 0.1  # [m/s] floor of the speed that the course rate is divided by; the model is not meant for standstill


class Motion(NamedTuple):
    """Time derivatives of the first four states, and the body-frame acceleration that an accelerometer reads."""

    r_dot: Any
    v_dot: Any
    beta_dot: Any
    omega_r_dot: Any
    a_x: Any
    a_y: Any


@jitable
def front_contact_velocity(r: Any, v: Any, beta: Any, delta: Any, a: Any) -> tuple[Any, Any]:
    """Velocity (V_x, V_y) [m/s] of the front contact point in the wheel frame."""
    u_x, u_y = v * cos(beta), v * sin(beta) + a * r
    return u_x * cos(delta) + u_y * sin(delta), -u_x * sin(delta) + u_y * cos(delta)


@jitable
def front_slip(v_x: Any, v_y: Any, omega_r: Any, coupling: Any) -> tuple[Any, Any]:
    """Longitudinal and lateral slip (sigma_x, sigma_y) of the front axle from its contact velocity [m/s].

    Its rim rolls freely (coupling 0: no longitudinal slip), turns with the rear's (1), or in between.
    """
    excess = coupling * (omega_r - v_x)
    rolling = maximum(v_x + excess, MIN_SLIP_SPEED)
    return excess / rolling, v_y / rolling


@jitable
def rear_slip(r: Any, v: Any, beta: Any, omega_r: Any, b: Any) -> tuple[Any, Any]:
    """Longitudinal and lateral slip (sigma_x, sigma_y) of the driven rear axle."""
    u_x, u_y = v * cos(beta), v * sin(beta) - b * r
    rolling = maximum(omega_r, MIN_SLIP_SPEED)
    return (omega_r - u_x) / rolling, u_y / rolling


@jitable
def static_loads(p: Constants) -> tuple[Any, Any]:
    """Static axle loads (F_zf, F_zr) [N]."""
    wheelbase = p.front_axle_distance + p.rear_axle_distance
    weight = p.mass * p.gravity
    return weight * p.rear_axle_distance / wheelbase, weight * p.front_axle_distance / wheelbase


@jitable
def body_wrench(delta: Any, f_xf: Any, f_yf: Any, f_xr: Any, f_yr: Any, a: Any, b: Any) -> tuple[Any, Any, Any]:
    """Force (F_x, F_y) [N] and yaw moment [N m] of the axle forces (wheel frame at the front) in the body frame."""
    lateral_front = f_yf * cos(delta) + f_xf * sin(delta)
    return f_xf * cos(delta) - f_yf * sin(delta) + f_xr, lateral_front + f_yr, a * lateral_front - b * f_yr


@jitable
def planar_motion(r: Any, v: Any, beta: Any, a_x: Any, a_y: Any) -> tuple[Any, Any]:
    """(v_dot, beta_dot) of a body with the acceleration (a_x, a_y) [m/s^2] in its own frame."""
    course_acceleration = a_y * cos(beta) - a_x * sin(beta)
    return a_x * cos(beta) + a_y * sin(beta), course_acceleration / maximum(v, MIN_SPEED) - r


@jitable
def wheel_acceleration(axle_torque: Any, f_x: Any, wheel_radius: Any, axle_inertia: Any) -> Any:
    """d(omega_r)/dt [m/s^2] of the rim: (axle torque - F_x R_w) / I_w * R_w, F_x that of all driven wheels."""
    return (axle_torque - f_x * wheel_radius) / axle_inertia * wheel_radius


@jitable
def motion(r: Any, v: Any, beta: Any, omega_r: Any, delta: Any, tau: Any, p: Constants,
           force_x: Any = 0.0, force_y: Any = 0.0, moment: Any = 0.0) -> Motion:  # fmt: skip
    """The nominal car's motion under its own tyres and an optional body-frame force [N] and yaw moment [N m]."""
    f_zf, f_zr = static_loads(p)
    v_x, v_y = front_contact_velocity(r, v, beta, delta, p.front_axle_distance)
    sigma_xf, sigma_yf = front_slip(v_x, v_y, omega_r, p.front_coupling)
    f_xf, f_yf = tyre_force(sigma_xf, sigma_yf, p.front_stiffness, p.friction * f_zf, p.tyre)
    sigma_x, sigma_y = rear_slip(r, v, beta, omega_r, p.rear_axle_distance)
    f_xr, f_yr = tyre_force(sigma_x, sigma_y, p.rear_stiffness, p.friction * f_zr, p.tyre)
    f_x, f_y, m_z = body_wrench(delta, f_xf, f_yf, f_xr, f_yr, p.front_axle_distance, p.rear_axle_distance)
    a_x, a_y = (f_x + force_x) / p.mass, (f_y + force_y) / p.mass
    v_dot, beta_dot = planar_motion(r, v, beta, a_x, a_y)
    omega_r_dot = wheel_acceleration(p.gear_ratio * tau, f_xr + f_xf, p.wheel_radius, p.rear_axle_inertia)
    return Motion((m_z + moment) / p.yaw_inertia, v_dot, beta_dot, omega_r_dot, a_x, a_y)


@jitable
def path_rates(r: Any, v: Any, beta_dot: Any, e: Any, dphi: Any, curvature: Any) -> tuple[Any, Any, Any]:
    """(e_dot, dphi_dot, s_dot): motion relative to a path of the given curvature [1/m]."""
    s_dot = v * cos(dphi) / (1.0 - curvature * e)
    return v * sin(dphi), beta_dot + r - curvature * s_dot, s_dot


@jitable
def world_rates(r: Any, v: Any, beta: Any, psi: Any) -> tuple[Any, Any, Any]:
    """(x_dot, y_dot, psi_dot): motion of the centre of gravity in the fixed frame, psi the heading [rad]."""
    return v * cos(psi + beta), v * sin(psi + beta), r


def derivatives(x: Any, u: Any, curvature: Any, p: Constants) -> Any:
    """Time derivative of the paper's six states.

    Args:
        x: states [..., 6]; u: inputs [..., 2]; curvature: kappa_ref [...] [1/m]; p: the car. Any leading axes
            (broadcast against each other); floats, complex, AutoDiffXd or Expression.

    Returns:
        x_dot [..., 6].
    """
    r, v, beta, omega_r, e, dphi = np.moveaxis(np.asarray(x), -1, 0)
    delta, tau = np.moveaxis(np.asarray(u), -1, 0)
    rates = motion(r, v, beta, omega_r, delta, tau, p)
    e_dot, dphi_dot, _ = path_rates(r, v, rates.beta_dot, e, dphi, curvature)
    return np.stack(np.broadcast_arrays(*rates[:4], e_dot, dphi_dot), axis=-1)
