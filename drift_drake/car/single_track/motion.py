"""Single-track equations of motion in curvilinear coordinates (Appendix A of Davydov et al.).

State (r, v, beta, omega_r, e, dphi): yaw rate [rad/s], speed [m/s], sideslip [rad], rear rim speed [m/s], lateral
[m] and course [rad] deviation from the path. Input (delta, tau): road-wheel angle [rad], engine torque [N m].
ISO 8855: x forward, y left, z up. The small functions are shared by the nominal car and the car with effects.

A car that backs up has a negative speed and a small sideslip: so all rates are smooth where it stops. Slips are divided
by a speed's magnitude, held above a floor (Bernard and Clover 1995), and the course's rate by the speed.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from drift_drake.car.compilation import compiled
from drift_drake.car.parameters import Constants
from drift_drake.car.scalar import absolute, cos, jitable, maximum, signed_floor, sin
from drift_drake.car.tyre import tyre_force, tyre_gradient
from drift_drake.common.arrays import Array

STATES = ("r", "v", "beta", "omega_r", "e", "dphi")
INPUTS = ("delta", "tau")

MIN_SLIP_SPEED = 0.5  # [m/s] floor of the speed that slips are divided by
MIN_SPEED = 0.1  # [m/s] floor of the speed that the course rate is divided by


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
    rolling = maximum(absolute(v_x + excess), MIN_SLIP_SPEED)
    return excess / rolling, v_y / rolling


@jitable
def rear_slip(r: Any, v: Any, beta: Any, omega_r: Any, b: Any) -> tuple[Any, Any]:
    """Longitudinal and lateral slip (sigma_x, sigma_y) of the driven rear axle."""
    u_x, u_y = v * cos(beta), v * sin(beta) - b * r
    rolling = maximum(absolute(omega_r), MIN_SLIP_SPEED)
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
    return a_x * cos(beta) + a_y * sin(beta), course_acceleration / signed_floor(v, MIN_SPEED) - r


@jitable
def body_acceleration(r: Any, v: Any, beta: Any, v_dot: Any, beta_dot: Any) -> tuple[Any, Any]:
    """(a_x, a_y) [m/s^2] of a body in its own frame: the inverse of `planar_motion`."""
    across = (beta_dot + r) * signed_floor(v, MIN_SPEED)
    return v_dot * cos(beta) - across * sin(beta), v_dot * sin(beta) + across * cos(beta)


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


@jitable
def slip_point(r: Any, v: Any, beta: Any, omega_r: Any, delta: Any, p: Constants, slip: Any, gradient: Any) -> None:
    """Writes the slips (sigma_x, sigma_y) of the front and of the rear axle [4] and their gradients [4, 5].

    Gradients are with respect to (r, v, beta, omega_r, delta); the slips are `bicycle.front_slip`'s and `rear_slip`'s.
    """
    sb, cb, sd, cd = sin(beta), cos(beta), sin(delta), cos(delta)
    lf, lr, share = p.front_axle_distance, p.rear_axle_distance, p.front_coupling
    u_x, u_y = v * cb, v * sb
    du_x = (0.0, cb, -u_y, 0.0, 0.0)
    du_y = (0.0, sb, u_x, 0.0, 0.0)
    front_y = u_y + lf * r
    v_x, v_y = u_x * cd + front_y * sd, -u_x * sd + front_y * cd
    rim_f = v_x + share * (omega_r - v_x)
    floor_f, floor_r = abs(rim_f) <= MIN_SLIP_SPEED, abs(omega_r) <= MIN_SLIP_SPEED
    den_f = MIN_SLIP_SPEED if floor_f else abs(rim_f)
    den_r = MIN_SLIP_SPEED if floor_r else abs(omega_r)
    slip[0], slip[1] = share * (omega_r - v_x) / den_f, v_y / den_f
    slip[2], slip[3] = (omega_r - u_x) / den_r, (u_y - lr * r) / den_r
    for j in range(5):
        dfront_y = du_y[j] + (lf if j == 0 else 0.0)
        steer = 1.0 if j == 4 else 0.0
        dv_x = du_x[j] * cd + dfront_y * sd + steer * v_y
        dv_y = -du_x[j] * sd + dfront_y * cd - steer * v_x
        spin = 1.0 if j == 3 else 0.0
        dexcess = share * (spin - dv_x)
        dden_f = 0.0 if floor_f else math.copysign(1.0, rim_f) * (dv_x + dexcess)
        dden_r = 0.0 if floor_r else math.copysign(spin, omega_r)
        gradient[0, j], gradient[1, j] = (dexcess - slip[0] * dden_f) / den_f, (dv_y - slip[1] * dden_f) / den_f
        gradient[2, j] = (spin - du_x[j] - slip[2] * dden_r) / den_r
        gradient[3, j] = (du_y[j] - (lr if j == 0 else 0.0) - slip[3] * dden_r) / den_r


@jitable
def linearize_point(x: Any, u: Any, curvature: Any, p: Constants, x_dot: Any, a: Any, b: Any) -> None:
    """Writes x_dot [6], A = d x_dot / dx [6, 6] and B = d x_dot / du [6, 2] at one point into the given arrays."""
    r, v, beta, omega_r, e, dphi = x[0], x[1], x[2], x[3], x[4], x[5]
    delta, tau = u[0], u[1]
    rates = motion(r, v, beta, omega_r, delta, tau, p)
    e_dot, dphi_dot, s_dot = path_rates(r, v, rates.beta_dot, e, dphi, curvature)
    x_dot[0], x_dot[1], x_dot[2], x_dot[3], x_dot[4], x_dot[5] = (
        rates.r_dot, rates.v_dot, rates.beta_dot, rates.omega_r_dot, e_dot, dphi_dot)  # fmt: skip
    f_zf, f_zr = static_loads(p)
    lf, lr = p.front_axle_distance, p.rear_axle_distance
    sb, cb, sd, cd = sin(beta), cos(beta), sin(delta), cos(delta)
    slip, dslip = np.empty(4), np.empty((4, 5))
    slip_point(r, v, beta, omega_r, delta, p, slip, dslip)
    f_xf, f_yf, k_fxx, k_fxy, k_fyx, k_fyy = tyre_gradient(
        slip[0], slip[1], p.front_stiffness, p.friction * f_zf, p.tyre
    )
    _, _, k_xx, k_xy, k_yx, k_yy = tyre_gradient(slip[2], slip[3], p.rear_stiffness, p.friction * f_zr, p.tyre)
    slow, v_floor = abs(v) <= MIN_SPEED, signed_floor(v, MIN_SPEED)
    course = rates.a_y * cb - rates.a_x * sb
    for j in range(5):
        steer = 1.0 if j == 4 else 0.0
        df_xf = k_fxx * dslip[0, j] + k_fxy * dslip[1, j]
        df_yf = k_fyx * dslip[0, j] + k_fyy * dslip[1, j]
        df_xr = k_xx * dslip[2, j] + k_xy * dslip[3, j]
        df_yr = k_yx * dslip[2, j] + k_yy * dslip[3, j]
        dlateral = df_yf * cd - steer * f_yf * sd + df_xf * sd + steer * f_xf * cd
        da_x = (df_xf * cd - steer * f_xf * sd - df_yf * sd - steer * f_yf * cd + df_xr) / p.mass
        da_y = (dlateral + df_yr) / p.mass
        turn = 1.0 if j == 2 else 0.0
        dv_dot = da_x * cb + da_y * sb + turn * course
        dcourse = da_y * cb - da_x * sb - turn * rates.v_dot
        dbeta_dot = dcourse / v_floor - (0.0 if slow or j != 1 else course / (v * v)) - (1.0 if j == 0 else 0.0)
        drim = -(df_xr + df_xf) * p.wheel_radius * p.wheel_radius / p.rear_axle_inertia
        ds_dot = s_dot / v if j == 1 else 0.0
        ddphi_dot = dbeta_dot + (1.0 if j == 0 else 0.0) - curvature * ds_dot
        column = (
            (lf * dlateral - lr * df_yr) / p.yaw_inertia, dv_dot, dbeta_dot, drim,
            sin(dphi) if j == 1 else 0.0, ddphi_dot)  # fmt: skip
        for i in range(6):
            if j < 4:
                a[i, j] = column[i]
            else:
                b[i, 0] = column[i]
    for i in range(6):
        a[i, 4] = 0.0
        a[i, 5] = 0.0
        b[i, 1] = 0.0
    a[4, 5] = v * cos(dphi)
    a[5, 4] = -curvature * curvature * s_dot / (1.0 - curvature * e)
    a[5, 5] = curvature * v * sin(dphi) / (1.0 - curvature * e)
    b[3, 1] = p.gear_ratio / p.rear_axle_inertia * p.wheel_radius


@compiled
def _linearize(x: Array, u: Array, curvature: Array, p: Constants, x_dot: Array, a: Array, b: Array) -> None:
    for i in range(x.shape[0]):
        linearize_point(x[i], u[i], curvature[i], p, x_dot[i], a[i], b[i])


def linearize(x: Array, u: Array, curvature: Array, p: Constants) -> tuple[Array, Array, Array]:
    """Value and analytic Jacobians of `bicycle.derivatives` over a batch.

    Args:
        x: states [..., 6]; u: inputs [..., 2]; curvature: [...] [1/m], leading axes broadcast; p: the car.

    Returns:
        (x_dot [..., 6], A [..., 6, 6], B [..., 6, 2]).
    """
    curvature = np.asarray(curvature, dtype=float)
    batch = np.broadcast_shapes(np.shape(x)[:-1], np.shape(u)[:-1], curvature.shape)
    flat_x, flat_u, flat_curvature = _flat(x, (*batch, 6)), _flat(u, (*batch, 2)), _flat(curvature, batch)
    count = math.prod(batch)
    x_dot, a, b = np.empty((count, 6)), np.empty((count, 6, 6)), np.empty((count, 6, 2))
    _linearize(flat_x.reshape(-1, 6), flat_u.reshape(-1, 2), flat_curvature.reshape(-1), p, x_dot, a, b)
    return x_dot.reshape(*batch, 6), a.reshape(*batch, 6, 6), b.reshape(*batch, 6, 2)


def _flat(values: Any, shape: tuple[int, ...]) -> Array:
    """Contiguous floats of a shape; a copy, as a view that is read only would be compiled for anew."""
    array = np.asarray(values, dtype=float)
    return np.array(array if array.shape == shape else np.broadcast_to(array, shape), order="C")
