"""A simulated drive with all that a recorder could have seen of it, for the tests of the importer."""

import functools

import numpy as np
import pandas as pd
from scipy.integrate import solve_ivp

from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.single_track.motion import derivatives, motion, world_rates
from drift_drake.gap.logs.importing.checks import recording_doubts

PERIOD = 0.005  # [s] of the simulation, and of the truth
WHEELBASE = VehicleParameters().front_axle_distance + VehicleParameters().rear_axle_distance


def steering(t):
    """Slow and quick turns at the limit of grip's linear range."""
    return 0.03 * np.sin(0.7 * t) + 0.02 * np.sin(1.9 * t + 1.0) + 0.008 * np.sin(5.3 * t)


def torque(t):
    return 10.0 + 45.0 * np.sin(0.9 * t) + 25.0 * np.sin(2.1 * t)


@functools.cache
def truth(duration: float = 24.0) -> pd.DataFrame:
    """The log's columns of a nominal car's drive, 200 rows a second, without noise."""
    p = VehicleParameters().constants()

    def rates(t, x):
        u = np.array([steering(t), torque(t)])
        return np.concatenate([derivatives(x[:6], u, 0.0, p), world_rates(x[0], x[1], x[2], x[8])])

    start, t = [0.0, 15.0, 0.0, 15.0, 0.0, 0.0, 3.0, -2.0, 0.4], np.arange(round(duration / PERIOD) + 1) * PERIOD
    states = solve_ivp(rates, (0.0, t[-1]), start, "LSODA", t_eval=t, rtol=1e-10, atol=1e-10).y.T
    r, v, beta, omega_r = states[:, :4].T
    moved = motion(r, v, beta, omega_r, steering(t), torque(t), p)
    return pd.DataFrame(
        {
            "t": t,
            "x": states[:, 6],
            "y": states[:, 7],
            "psi": states[:, 8],
            "r": r,
            "v": v,
            "beta": beta,
            "omega_r": omega_r,
            "ax": moved.a_x,
            "ay": moved.a_y,
            "delta_cmd": steering(t),
            "tau_cmd": torque(t),
        }
    )


def rows(period: float = 0.01, noise: float = 0.0, seed: int = 0) -> dict[str, np.ndarray]:
    """The truth each `period`; with `noise` as a share of sensible levels."""
    table = truth().iloc[:: round(period / PERIOD)]
    generator = np.random.default_rng(seed)
    levels = {"r": 0.01, "v": 0.05, "beta": 0.005, "ax": 0.3, "ay": 0.3, "omega_r": 0.05, "psi": 0.001}
    levels |= {"x": 0.005, "y": 0.005}
    return {
        name: table[name].to_numpy() + noise * levels.get(name, 0.0) * generator.standard_normal(len(table))
        for name in table
    }


def column_doubts(columns, period, wheelbase=None):
    """What looks wrong in one run."""
    return recording_doubts([columns], period, wheelbase).sentences
