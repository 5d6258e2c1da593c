"""A published multi-body car as a simulator: CommonRoad's, with 29 states, one roll-out at a time.

See commonroad_car.yaml. Needs `pip install "drift_drake[worlds]"`. The model is Althoff and Würsching's
(https://commonroad.in.tum.de), its states and parameters named there. Its equations are plain Python over a parameter
object; here their source is compiled as it stands, the parameters as nested tuples: a hundred times faster.
"""

import inspect
import math
from collections import namedtuple
from collections.abc import Mapping
from functools import cache, lru_cache
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray
from vehiclemodels import vehicle_dynamics_mb as body
from vehiclemodels.init_mb import init_mb
from vehiclemodels.parameters_vehicle2 import parameters_vehicle2
from vehiclemodels.utils import acceleration_constraints, steering_constraints, tire_model, vehicle_dynamics_ks_cog

Numbers = NDArray[np.float64]
STEP = 0.001  # [s], of Heun's method: wheels settle in some milliseconds
RACK = 0.01  # [s] in which the front wheels take on the commanded angle
R, V_X, V_Y, PSI, STEERING, REAR = 5, 3, 10, 4, 2, (25, 26)  # places in the state
WHEELS = (23, 24, *REAR)
COMPILED = {
    steering_constraints: ("steering_constraints",), acceleration_constraints: ("acceleration_constraints",),
    tire_model: ("sign", "formula_longitudinal", "formula_lateral", "formula_longitudinal_comb",
                 "formula_lateral_comb"),
    vehicle_dynamics_ks_cog: ("vehicle_dynamics_ks_cog",), body: ("vehicle_dynamics_mb",),
}  # fmt: skip


def as_tuple(p: Any) -> Any:
    """The numbers of a parameter object by name, nested ones as nested tuples."""
    found = {name: value for name, value in vars(p).items() if value is not None and not isinstance(value, str)}
    fields = {name: as_tuple(value) if hasattr(value, "__dict__") else float(value) for name, value in found.items()}
    return namedtuple(type(p).__name__, fields)(**fields)


@cache
def stepping() -> Any:
    """Compiled: a state [29] stepped in place, steering and torque linear over the steps."""
    namespace: dict[str, Any] = {"math": math}
    for module, names in COMPILED.items():
        for name in names:
            exec(inspect.getsource(getattr(module, name)).replace("tireModel.", ""), namespace)
            namespace[name] = numba.njit(namespace[name], error_model="numpy")
    rates = namespace["vehicle_dynamics_mb"]

    @numba.njit(error_model="numpy")  # type: ignore[untyped-decorator]
    def step(x: Any, steering: Any, drive: Any, steps: Any, h: Any, p: Any) -> None:
        for i in range(steps):
            first, then = i / steps, (i + 1) / steps
            delta, later = (
                steering[0] + first * (steering[1] - steering[0]),
                steering[0] + then * (steering[1] - steering[0]),
            )
            k = np.array(rates(x.copy(), [(delta - x[STEERING]) / RACK, drive[0] + first * (drive[1] - drive[0])], p))
            ahead = x + h * k
            rate = (later - ahead[STEERING]) / RACK
            x += 0.5 * h * (k + np.array(rates(ahead, [rate, drive[0] + then * (drive[1] - drive[0])], p)))
            for wheel in WHEELS:
                x[wheel] = max(x[wheel], 0.0)  # one that has lifted and stopped would never turn again below 0

    return step


@lru_cache(maxsize=64)
def car_of(parameters: tuple[tuple[str, float], ...]) -> tuple[Any, Any]:
    """The package's parameter object of a car with these parameters, and its numbers as tuples."""
    p, given = parameters_vehicle2(), dict(parameters)
    p.m_s += given["m"] - p.m
    p.m, p.I_z = given["m"], given["I_z"]
    p.a, p.b, p.tire.p_dy1, p.tire.p_ky1 = (given[name] for name in ("a", "b", "p_dy1", "p_ky1"))
    p.tire.p_dx1, p.T_se, p.T_sb = 1.1 * p.tire.p_dy1, 0.0, 0.0
    return p, as_tuple(p)


def simulate(
    start: Mapping[str, float], inputs: Mapping[str, Numbers], dt: float, parameters: Mapping[str, float]
) -> dict[str, Numbers]:
    """A roll-out from r [rad/s], v [m/s], beta [rad], omega [rad/s] under steering [rad] and torque [N m] at the rear
    axle, each [rows]; returns r, v_x, v_y, omega, psi, each [rows].

    Up to the first row with lead_in 0, the body follows the measured led_r, led_v_x and led_v_y, so that roll,
    suspension, tyres and wheels settle under that motion.
    """
    p, numbers = car_of(tuple(parameters.items()))
    angle = float(inputs["steering"][0])
    x = np.array(init_mb([0.0, 0.0, angle, start["v"], 0.0, start["r"], start["beta"]], p))
    x[list(REAR)] = start["omega"]
    steps, step, out = max(round(dt / STEP), 1), stepping(), [x.copy()]
    drive, led = inputs["torque"] / (p.m * p.R_w), int(np.argmin(inputs["lead_in"]))
    for row in range(len(drive) - 1):
        if led and row <= led:
            x[[R, V_X, V_Y]] = [inputs[name][row] for name in ("led_r", "led_v_x", "led_v_y")]
            out[-1] = x.copy()
        step(x, inputs["steering"][row : row + 2], drive[row : row + 2], steps, dt / steps, numbers)
        out.append(x.copy())
    motion = np.array(out)
    return {"r": motion[:, R], "v_x": motion[:, V_X], "v_y": motion[:, V_Y], "psi": motion[:, PSI],
            "omega": motion[:, list(REAR)].mean(axis=1)}  # fmt: skip
