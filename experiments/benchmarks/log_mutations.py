"""Mistakes put into good logs by hand: other units, signs and clocks, and columns that are not theirs."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from drift_drake.car.log.table import Run
from drift_drake.car.parameters import VehicleParameters
from drift_drake.gap.logs.screening.screened import MEASURED

DEGREES, G = 180.0 / np.pi, 9.80665


def unit_mistakes(vehicle: VehicleParameters) -> dict[str, dict[str, float]]:
    """By name, the factors that columns (`t`: the clock) are multiplied by."""
    steering = 14.0
    found = {
        "r in deg/s": {"r": DEGREES},
        "psi in deg": {"psi": DEGREES},
        "beta in deg": {"beta": DEGREES},
        "delta_cmd in deg": {"delta_cmd": DEGREES},
        "all angles in deg": {"r": DEGREES, "psi": DEGREES, "beta": DEGREES, "delta_cmd": DEGREES},
        "r converted twice": {"r": 1.0 / DEGREES},
        "delta_cmd converted twice": {"delta_cmd": 1.0 / DEGREES},
        "steering wheel's angle": {"delta_cmd": steering},
        "v in km/h": {"v": 3.6},
        "omega_r in km/h": {"omega_r": 3.6},
        "v and omega_r in km/h": {"v": 3.6, "omega_r": 3.6},
        "v converted twice": {"v": 1.0 / 3.6},
        "omega_r in rad/s": {"omega_r": 1.0 / vehicle.wheel_radius},
        "ay in g": {"ay": 1.0 / G},
        "ax and ay in g": {"ax": 1.0 / G, "ay": 1.0 / G},
        "tau_cmd at the axle": {"tau_cmd": vehicle.gear_ratio},
        "tau_cmd as force": {"tau_cmd": vehicle.gear_ratio / vehicle.wheel_radius},
        "tau_cmd in kN m": {"tau_cmd": 1e-3},
        "clock at half speed": {"t": 0.5},
        "clock at double speed": {"t": 2.0},
        "ax and ay mirrored": {"ax": -1.0, "ay": -1.0},
    }
    return found | {f"{name} mirrored": {name: -1.0} for name in ("r", "psi", "y", "ay", "delta_cmd", "beta")}


def with_factors(runs: Sequence[Run], factors: Mapping[str, float]) -> list[Run]:
    """The runs with columns, which all have, times factors.

    Raises:
        InvalidLogError: no car's log may look like that.
    """
    return [_with_columns(run, {name: q * np.array(run.column(name)) for name, q in factors.items()}) for run in runs]


def _with_columns(run: Run, columns: dict[str, Any]) -> Run:
    return dataclasses.replace(run, **columns)


def mapped_wrongly(run: Run) -> dict[str, Run]:
    """By name, a run with a column that is no measurement of what it is called."""
    columns = {name: np.array(values) for name in MEASURED if (values := run.column(name)) is not None}
    columns["delta_cmd"] = np.array(run.delta_cmd)
    found = {f"{name} without its sign": {name: np.abs(columns[name])} for name in ("r", "ay", "delta_cmd")}
    found |= {f"{name} dead": {name: np.full(len(run), float(columns[name][0]))} for name in MEASURED[2:]}
    found |= {f"{name} at zero": {name: np.zeros(len(run))} for name in ("beta", "ax", "ay", "psi")}
    found["ax and ay swapped"] = {"ax": columns["ay"], "ay": columns["ax"]}
    found["v and omega_r swapped"] = {"v": columns["omega_r"], "omega_r": columns["v"]}
    found["v a roll rate"] = {"v": np.abs(0.02 * np.sin(3.0 * np.array(run.t)))}
    return {name: _with_columns(run, changes) for name, changes in found.items()}


def measured_at(run: Run, ahead: float, left: float) -> Run:
    """The run with speed, sideslip and positions of a point `ahead` and to the `left` [m] of the centre of gravity."""
    v, beta, r = (np.array(run.column(name)) for name in ("v", "beta", "r"))
    along, across = v * np.cos(beta) - left * r, v * np.sin(beta) + ahead * r
    return _with_columns(run, {"v": np.hypot(along, across), "beta": np.arctan2(across, along)})


def held(run: Run, column: str, rows: int) -> Run:
    """The run with a command that is read each so many rows, and held."""
    values = np.array(run.column(column))
    return _with_columns(run, {column: np.repeat(values[::rows], rows)[: len(values)]})
