"""Analytic Jacobians of the nominal car, compiled: the hand-differentiated twin of `bicycle.derivatives`.

The MPC's hot path. `tests/vehicle/test_bicycle.py` holds it to Drake's AutoDiffXd on `bicycle.derivatives`.
"""

import math
from typing import Any

import numpy as np

from drift_drake.arrays import Array
from drift_drake.vehicle.bicycle import MIN_SLIP_SPEED, MIN_SPEED, motion, path_rates, static_loads
from drift_drake.vehicle.compilation import compiled
from drift_drake.vehicle.parameters import Constants
from drift_drake.vehicle.scalar import cos, jitable, sin
from drift_drake.vehicle.tyre import tyre_gradient


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
    floor_f, floor_r = rim_f <= MIN_SLIP_SPEED, omega_r <= MIN_SLIP_SPEED
    den_f = MIN_SLIP_SPEED if floor_f else rim_f
    den_r = MIN_SLIP_SPEED if floor_r else omega_r
    slip[0], slip[1] = share * (omega_r - v_x) / den_f, v_y / den_f
    slip[2], slip[3] = (omega_r - u_x) / den_r, (u_y - lr * r) / den_r
    for j in range(5):
        dfront_y = du_y[j] + (lf if j == 0 else 0.0)
        steer = 1.0 if j == 4 else 0.0
        dv_x = du_x[j] * cd + dfront_y * sd + steer * v_y
        dv_y = -du_x[j] * sd + dfront_y * cd - steer * v_x
        spin = 1.0 if j == 3 else 0.0
        dexcess = share * (spin - dv_x)
        dden_f = 0.0 if floor_f else dv_x + dexcess
        dden_r = 0.0 if floor_r else spin
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
    slow = v <= MIN_SPEED
    v_floor = MIN_SPEED if slow else v
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
