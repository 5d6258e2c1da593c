"""A simulator as one may have it: a car on four wheels in NumPy, many roll-outs at once. See four_wheels.yaml.

Vertical loads follow the accelerations with a lag, tyres saturate as tanh of their slip within the friction circle, and
both rear wheels turn at one speed.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

Numbers = NDArray[np.float64]
GRAVITY = 9.81  # [m/s^2]
LOAD_TIME = 0.06  # [s]
STEPS = 4  # of Heun's method in a row


def rates(z: Numbers, steering: Numbers, torque: Numbers, wrench: Numbers, p: Mapping[str, float]) -> Numbers:
    """Rates of z [n, 7]: yaw rate, v_x, v_y, wheel speed [rad/s], heading, lagged a_x and a_y."""
    r, v_x, v_y, wheel, _, a_x, a_y = z.T
    lf, lr, track = p["lf"], p["lr"], p["track"]
    base, weight = lf + lr, p["m"] * GRAVITY
    shift = p["m"] * a_x * p["h"] / base  # to the rear
    front, rear = weight * lr / base - shift, weight * lf / base + shift
    roll = p["m"] * a_y * p["h"] / track  # to the right, in a left turn
    force_x, force_y, moment, on_wheels = (
        wrench[:, 0].copy(),
        wrench[:, 1].copy(),
        wrench[:, 2].copy(),
        np.zeros_like(r),
    )
    for axle, (load, x, share, stiffness, grip) in enumerate((
        (front, lf, p["roll_front"], p["Cf"], p["mu_f"]), (rear, -lr, 1.0 - p["roll_front"], p["Cr"], p["mu_r"]),
    )):  # fmt: skip
        angle = steering if axle == 0 else np.zeros_like(r)
        for side in (1.0, -1.0):  # left, right
            normal = np.maximum(0.5 * load - side * share * roll, 50.0)
            y = 0.5 * side * track
            w_x, w_y = v_x - y * r, v_y + x * r
            along = np.maximum(w_x * np.cos(angle) + w_y * np.sin(angle), 0.5)
            across = -w_x * np.sin(angle) + w_y * np.cos(angle)
            slip_x = np.zeros_like(r) if axle == 0 else (p["R"] * wheel - along) / along
            slip_y = -across / along
            slip = np.hypot(slip_x, slip_y) + 1e-9
            peak = grip * normal * (1.0 - p["sens"] * (normal * 4.0 / weight - 1.0))
            force = peak * np.tanh(0.5 * stiffness * slip * (normal / (0.5 * load)) / peak)
            f_x, f_y = force * slip_x / slip, force * slip_y / slip
            b_x, b_y = f_x * np.cos(angle) - f_y * np.sin(angle), f_x * np.sin(angle) + f_y * np.cos(angle)
            force_x += b_x
            force_y += b_y
            moment += x * b_y - y * b_x
            on_wheels += f_x * p["R"]
    force_x -= p["drag"] * v_x * np.abs(v_x)
    accel_x, accel_y = force_x / p["m"], force_y / p["m"]
    return np.stack([
        moment / p["Izz"], accel_x + r * v_y, accel_y - r * v_x, (torque - on_wheels) / p["Iw"], r,
        (accel_x - a_x) / LOAD_TIME, (accel_y - a_y) / LOAD_TIME,
    ], axis=-1)  # fmt: skip


def simulate(
    start: Mapping[str, Numbers], inputs: Mapping[str, Numbers], dt: float, parameters: Mapping[str, float]
) -> dict[str, Numbers]:
    """Roll-outs from measured starts.

    Args:
        start: yaw_rate [rad/s], v_x, v_y [m/s], wheel [rad/s], each [n]; inputs: hand_wheel [deg], axle_torque [N m],
            F_x, F_y [N], M_z [N m], each [n, rows], linear between rows that are dt [s] apart.

    Returns:
        yaw_rate [deg/s], v_x, v_y [m/s], wheel [rpm], heading [deg], each [n, rows].
    """
    p = parameters
    r, v_x, v_y = (np.asarray(start[name], dtype=float) for name in ("yaw_rate", "v_x", "v_y"))
    z = np.stack([r, v_x, v_y, start["wheel"], 0.0 * r, 0.0 * r, r * v_x], axis=-1)
    steering = np.radians(inputs["hand_wheel"]) / p["steering_ratio"]
    wrench = np.stack([inputs["F_x"], inputs["F_y"], inputs["M_z"]], axis=-1)
    rows, h = steering.shape[-1], dt / STEPS
    out = [z]
    torque = inputs["axle_torque"]
    for row in range(rows - 1):
        for step in range(STEPS):
            a, b = step / STEPS, (step + 1) / STEPS
            first, then = ([u[:, row] + share * (u[:, row + 1] - u[:, row]) for u in (steering, torque, wrench)]
                           for share in (a, b))  # fmt: skip
            k = rates(z, first[0], first[1], first[2], p)
            z = z + 0.5 * h * (k + rates(z + h * k, then[0], then[1], then[2], p))
        out.append(z)
    motion = np.stack(out, axis=1)
    return {
        "yaw_rate": np.degrees(motion[..., 0]), "v_x": motion[..., 1], "v_y": motion[..., 2],
        "wheel": motion[..., 3] * 30.0 / np.pi, "heading": np.degrees(motion[..., 4]),
    }  # fmt: skip
