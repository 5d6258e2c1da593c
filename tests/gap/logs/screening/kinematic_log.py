"""A log whose columns agree with each other exactly, but for their noise: kinematics, no tyres, made at once."""

import numpy as np

from drift_drake.car.log.table import Run

LENGTH = 2.5  # [m] of the wheelbase
UNDERSTEER = 0.003  # [rad s^2/m]
NOISE = {"r": 0.004, "v": 0.03, "beta": 0.004, "omega_r": 0.04, "ax": 0.1, "ay": 0.1, "x": 0.02, "y": 0.02,
         "psi": 0.002}  # fmt: skip
STEP = 0.001  # [s] of the integration


def kinematic_log(
    seconds: float = 30.0,
    noise: float = 1.0,
    seed: int = 0,
    speed: float = 14.0,
    drifting: float = 0.0,
    size: float = 1.0,
) -> Run:
    """Turns of many sizes at a changing speed; `drifting`: sideslip [rad] at most; `size`: of the car, by Froude."""
    rng = np.random.default_rng(seed)
    slow = np.sqrt(size)
    t = np.arange(round(seconds / STEP)) * STEP
    s = t / slow
    a, b, c, d = rng.uniform(0.0, 6.0, 4)
    v = slow * (speed + 4.0 * np.sin(0.31 * s + a) + 1.5 * np.sin(1.1 * s + b))
    pull = 4.0 * np.sin(0.9 * s + c) * np.sin(0.13 * s) + 2.0 * np.sin(2.3 * s + d) * np.sin(0.17 * s + a)
    course_rate = pull / v
    beta = -0.004 * pull + drifting * np.sin(0.23 * s + b)
    course = 0.3 + np.cumsum(course_rate) * STEP
    psi = course - beta
    r = np.gradient(psi, STEP)
    gain, swing = np.gradient(v, STEP), course_rate
    ax = gain * np.cos(beta) - v * swing * np.sin(beta)
    ay = gain * np.sin(beta) + v * swing * np.cos(beta)
    length = LENGTH * size
    columns = {
        "x": np.cumsum(v * np.cos(course)) * STEP, "y": np.cumsum(v * np.sin(course)) * STEP, "psi": psi, "r": r,
        "v": v, "beta": beta, "omega_r": v * np.cos(beta) * (1.0 + 0.03 * ax),
        "ax": ax, "ay": ay, "delta_cmd": (length + UNDERSTEER * v**2) * r / v,
    }  # fmt: skip
    every = slice(None, None, 10)
    scale = {"r": 1.0 / slow, "v": slow, "omega_r": slow, "x": size, "y": size}
    noisy = {
        name: values[every] + noise * scale.get(name, 1.0) * NOISE.get(name, 0.0) * rng.standard_normal(len(t[every]))
        for name, values in columns.items()
    }
    return Run(name=f"run_{seed}", t=t[every], tau_cmd=None, **noisy)
