"""A published multi-body car as a simulator: CommonRoad's, with 29 states, one roll-out at a time in plain Python.

See commonroad_car.yaml. Needs `pip install commonroad-vehicle-models omegaconf`. The model is Althoff and Würsching's
(https://commonroad.in.tum.de), its states and parameters named there.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from vehiclemodels.init_mb import init_mb
from vehiclemodels.parameters_vehicle2 import parameters_vehicle2
from vehiclemodels.vehicle_dynamics_mb import vehicle_dynamics_mb

Numbers = NDArray[np.float64]
STEP = 0.001  # [s], of Heun's method: wheels settle in some milliseconds
RACK = 0.01  # [s] in which the front wheels take on the commanded angle
R, V_X, V_Y, PSI, STEERING, REAR = 5, 3, 10, 4, 2, (25, 26)  # places in the state


def simulate(
    start: Mapping[str, float], inputs: Mapping[str, Numbers], dt: float, parameters: Mapping[str, float]
) -> dict[str, Numbers]:
    """A roll-out from r [rad/s], v [m/s], beta [rad], omega [rad/s] under steering [rad] and torque [N m] at the rear
    axle, each [rows]; returns r, v_x, v_y, omega, psi, each [rows]."""
    p = parameters_vehicle2()
    heavier = parameters["m"] - p.m
    p.m, p.m_s, p.I_z = parameters["m"], p.m_s + heavier, parameters["I_z"]
    p.a, p.b, p.tire.p_dy1, p.tire.p_ky1 = (parameters[name] for name in ("a", "b", "p_dy1", "p_ky1"))
    p.tire.p_dx1, p.T_se, p.T_sb = 1.1 * p.tire.p_dy1, 0.0, 0.0
    angle = float(inputs["steering"][0])
    x = np.array(init_mb([0.0, 0.0, angle, start["v"], 0.0, start["r"], start["beta"]], p))
    x[list(REAR)] = start["omega"]
    steps = max(round(dt / STEP), 1)
    h, out = dt / steps, [x]

    def rates(x: Numbers, steering: float, torque: float) -> Numbers:
        rate = (steering - x[STEERING]) / RACK
        return np.array(vehicle_dynamics_mb(list(x), [rate, torque / (p.m * p.R_w)], p))

    for row in range(len(inputs["steering"]) - 1):
        for step in range(steps):
            first, then = ([u[row] + share * (u[row + 1] - u[row]) for u in (inputs["steering"], inputs["torque"])]
                           for share in (step / steps, (step + 1) / steps))  # fmt: skip
            k = rates(x, first[0], first[1])
            x = x + 0.5 * h * (k + rates(x + h * k, then[0], then[1]))
        out.append(x)
    motion = np.array(out)
    return {"r": motion[:, R], "v_x": motion[:, V_X], "v_y": motion[:, V_Y], "psi": motion[:, PSI],
            "omega": motion[:, list(REAR)].mean(axis=1)}  # fmt: skip
