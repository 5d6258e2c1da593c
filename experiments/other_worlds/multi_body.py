"""CommonRoad's multi-body car (Althoff and Würsching, https://commonroad.in.tum.de) as a car that is stepped.

Its package's equations are plain Python over a parameter object. Here their source is compiled as it stands, the
parameters as nested tuples, so that a second of driving takes some 20 ms. Needs `pip install "drift_drake[worlds]"`.

Cars are drawn one by one: one of the package's three cars with track, compliance and tyres' shapes as published, made
a car to drift with: of about the mass, axles, height and wheels of the coupe that the controllers take it for, its
springs and inertias in proportion to the mass, rear-wheel drive with a limited-slip differential, a quick steering.
"""

import inspect
import math
from collections import namedtuple
from collections.abc import Sequence
from functools import cache
from typing import Any

import numba
import numpy as np

from drift_drake.car.foreign.stepped_plant import WorldMotion
from drift_drake.car.parameters import VehicleParameters
from drift_drake.common.arrays import Array
from drift_drake.common.errors import MissingExtraError

STEP = 0.001  # [s], of Heun's method: wheels settle in some milliseconds
RACK = 0.01  # [s] in which the front wheels take on the commanded angle
STEERING_SPEED = 3.0  # [rad/s]; the published 0.4 is a driver's, too slow for any drift
STEERING, V_X, PSI, R, V_Y, REAR_LEFT, REAR_RIGHT = 2, 3, 4, 5, 10, 25, 26  # places in the state
WHEELS = (23, 24, REAR_LEFT, REAR_RIGHT)
STATES = tuple(f"multi_body_{i}" for i in range(29))
HEIGHT = 0.52  # [m] of the sprung mass
LOCK, LOCK_LIMIT = 300.0, 1500.0  # [N m s/rad], [N m] that the differential moves from the faster rear wheel
AS_DRAWN = {"mass": 0.05, "inertia": 0.08, "axle": 0.03, "grip": 0.05}  # standard deviations, [m] of the axle's
WITH_MASS = ("m_uf", "m_ur", "I_Phi_s", "I_y_s", "I_xz_s", "I_uf", "I_ur", "K_sf", "K_sr", "K_sdf", "K_sdr", "K_tsf",
             "K_tsr", "K_ras", "K_rad", "K_zt")  # fmt: skip


class MultiBodyCar:
    """A `SteppedCar`; `p`: parameters as the package has them."""

    state_names = STATES

    def __init__(self, p: Any, gear_ratio: float) -> None:
        self._p, self._numbers, self._gear = p, as_tuple(p), gear_ratio

    def start(self, state: Sequence[float], pose: Sequence[float], actuation: Sequence[float]) -> Array:
        from vehiclemodels.init_mb import init_mb

        (r, v, beta, omega_r), (x, y, psi) = state, pose
        own = np.array(init_mb([x, y, actuation[0], v, psi, r, beta], self._p), dtype=float)
        own[[REAR_LEFT, REAR_RIGHT]] = omega_r / self._p.R_w
        return own

    def step(self, own: Array, actuation: Array, wrench: Array, duration: float) -> Array:
        out = own.copy()
        drive = float(actuation[1]) * self._gear / (self._p.m * self._p.R_w)
        stepped(out, float(actuation[0]), drive, np.ascontiguousarray(wrench), duration, self._numbers)
        return out

    def motion(self, own: Array) -> WorldMotion:
        cos, sin = math.cos(own[PSI]), math.sin(own[PSI])
        v_x, v_y = cos * own[V_X] - sin * own[V_Y], sin * own[V_X] + cos * own[V_Y]
        rear = 0.5 * self._p.R_w * (own[REAR_LEFT] + own[REAR_RIGHT])
        return WorldMotion(own[0], own[1], own[PSI], own[R], v_x, v_y, rear)


def as_tuple(p: Any) -> Any:
    """The numbers of a parameter object by name, nested ones as nested tuples: what compiled code takes."""
    found = {name: value for name, value in vars(p).items() if value is not None and not isinstance(value, str)}
    fields = {name: as_tuple(value) if hasattr(value, "__dict__") else float(value) for name, value in found.items()}
    return namedtuple(type(p).__name__, fields)(**fields)


@cache
def _rates() -> Any:
    """The package's `vehicle_dynamics_mb`, compiled from its own source."""
    try:
        from vehiclemodels import vehicle_dynamics_mb as body
        from vehiclemodels.utils import (
            acceleration_constraints,
            steering_constraints,
            tire_model,
            vehicle_dynamics_ks_cog,
        )
    except ImportError:
        raise MissingExtraError("the multi-body car", "commonroad-vehicle-models", "worlds") from None
    names = {
        steering_constraints: ("steering_constraints",), acceleration_constraints: ("acceleration_constraints",),
        vehicle_dynamics_ks_cog: ("vehicle_dynamics_ks_cog",), body: ("vehicle_dynamics_mb",),
        tire_model: ("sign", "formula_longitudinal", "formula_lateral", "formula_longitudinal_comb",
                     "formula_lateral_comb"),
    }  # fmt: skip
    namespace: dict[str, Any] = {"math": math}
    for module in (steering_constraints, acceleration_constraints, tire_model, vehicle_dynamics_ks_cog, body):
        for name in names[module]:
            exec(inspect.getsource(getattr(module, name)).replace("tireModel.", ""), namespace)
            namespace[name] = numba.njit(namespace[name], error_model="numpy")
    return namespace["vehicle_dynamics_mb"]


@cache
def _stepping() -> Any:
    rates = _rates()

    @numba.njit(error_model="numpy")
    def of(x: Any, delta: Any, drive: Any, wrench: Any, p: Any) -> Any:
        f = np.array(rates(x, [(delta - x[STEERING]) / RACK, drive], p))
        f[V_X] += wrench[0] / p.m
        f[V_Y] += wrench[1] / p.m_s
        f[R] += wrench[2] / p.I_z
        lock = min(max(LOCK * (x[REAR_LEFT] - x[REAR_RIGHT]), -LOCK_LIMIT), LOCK_LIMIT) / p.I_y_w
        f[REAR_LEFT] -= lock
        f[REAR_RIGHT] += lock
        return f

    @numba.njit(error_model="numpy")
    def steps(x: Any, delta: Any, drive: Any, wrench: Any, count: Any, h: Any, p: Any) -> Any:
        for _ in range(count):
            k = of(x.copy(), delta, drive, wrench, p)
            x += 0.5 * h * (k + of(x + h * k, delta, drive, wrench, p))
            for i in WHEELS:
                x[i] = max(x[i], 0.0)  # the package stops a wheel that turns backwards, for good if it is left below 0

    return steps


def stepped(x: Array, delta: float, drive: float, wrench: Array, duration: float, numbers: Any) -> None:
    """The state [29] `duration` [s] later, in place; `drive`: the acceleration [m/s^2] that the torque would give."""
    count = max(1, round(duration / STEP))
    _stepping()(x, delta, drive, wrench, count, duration / count, numbers)


def draw_multi_body(index: int, seed: int, friction: float = 1.0) -> MultiBodyCar:
    """Car `index` of a draw, the same for the same arguments; friction: factor of its tyres'."""
    from vehiclemodels.parameters_vehicle1 import parameters_vehicle1
    from vehiclemodels.parameters_vehicle2 import parameters_vehicle2
    from vehiclemodels.parameters_vehicle3 import parameters_vehicle3

    p, coupe = (parameters_vehicle1, parameters_vehicle2, parameters_vehicle3)[index % 3](), VehicleParameters()
    mass, inertia, axle, grip = np.random.default_rng([seed, 29, index]).normal(size=4) * list(AS_DRAWN.values())
    heavier = coupe.mass * (1.0 + mass) / p.m
    for name in ("m", "m_s", *WITH_MASS):
        setattr(p, name, getattr(p, name) * heavier)
    p.h_s, p.I_z = HEIGHT, coupe.yaw_inertia * (1.0 + inertia)
    p.a, p.b = coupe.front_axle_distance + axle, coupe.rear_axle_distance - axle
    p.R_w, p.I_y_w = coupe.wheel_radius, 0.5 * coupe.rear_axle_inertia
    p.T_se = p.T_sb = 0.0  # driven, and braked by the engine, at the rear
    p.steering.v_min, p.steering.v_max = -STEERING_SPEED, STEERING_SPEED
    for name in ("p_dx1", "p_dy1"):
        setattr(p.tire, name, getattr(p.tire, name) * (1.0 + grip) * friction)
    return MultiBodyCar(p, coupe.gear_ratio)
