"""Predictions over short windows that start from measured states: errors some tenths of a second ahead.

What a simulator is for is prediction. A window starts every fifth of a second from the smoothed measurement, is driven
by the logged commands, and is compared with the measurement a tenth to half a second later. A small car moves faster:
these times are shorter for it, as the square root of its length (Froude's scaling), or its predictions would diverge.
Internal states that no sensor reads (slips that lag, heat, loads, roll) are carried along the measured motion up to
each start. Any car is predicted (`car.equations`).
"""

import dataclasses
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np

from drift_drake.car.actuated import STAGES, actuated, without_actuators
from drift_drake.car.compilation import compiled, copied
from drift_drake.car.effects.catalogue import wheelbase
from drift_drake.car.effects.installed import installed_effects
from drift_drake.car.effects.magnitudes import Effects, unbiased
from drift_drake.car.equations import CarConstants, decays, fastest, kind_of, rates, settle, size_of
from drift_drake.car.foreign.simulator import SimulatorConstants
from drift_drake.car.integrate import runge_kutta
from drift_drake.car.log.table import Run
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.road import NO_WRENCH, on_road, with_bank
from drift_drake.car.scalar import jitable, signed_floor
from drift_drake.gap.estimation.filter_state import CHANNELS, MIN_FILTER_SPEED, commanded, hold_speeds
from drift_drake.gap.estimation.lane_windows import predict_in_lanes
from drift_drake.gap.estimation.run_data import RunData, prepare_run
from drift_drake.gap.estimation.simulated_windows import simulated_errors

PREDICTED = ("r", "v", "beta", "omega_r", "psi")  # channels that are compared; psi by what it changes
STATES = 4  # of these: r, v, beta, omega_r
HORIZONS = 5  # of a tenth of a second
STRIDE = 0.1  # [s] between horizons, of a car with a wheelbase of FULL_LENGTH or more
FULL_LENGTH = 1.0  # [m]
START_EVERY = 2.0  # strides
SMOOTHING = 1.5  # strides of measurements behind a start, a parabola through them
SETTLING = 0.35  # [s] at a run's start without windows: commands before it are unknown
STEP = 0.01  # [s] of Runge-Kutta, at most
STEPS_PER_RATE = 1.5  # of the fastest settling time that a step may take
MOST_STEPS = 32  # a row
FOLLOWING = 0.0125  # [s] of a step of internal states along the measured motion, at most
FEW = 2  # windows, up to which one by one takes less than `LANES` at once
LARGEST_ERROR = 1e3  # of any channel, where a prediction diverges


@dataclasses.dataclass(frozen=True)
class WindowedRun:
    """One run, its windows' starts and what is measured there."""

    name: str
    period: float  # [s]
    y: np.ndarray  # [rows, 5] r, v, beta, omega_r, psi as measured
    start_y: np.ndarray  # [rows, 5] smoothed
    delta: np.ndarray  # [rows] commands
    tau: np.ndarray
    starts: np.ndarray  # [windows] rows
    stride: float  # [s] between horizons, before rounding to rows
    fed: bool  # speeds are fed as measured: no torque is logged
    used: np.ndarray  # [5] bool: channels that are measured and predicted
    recording: str = ""  # that the run is a part of
    bank: np.ndarray | None = None  # [rows] of the road [rad], where the log has it
    rolls: bool = False  # no rim speed is logged: the reading of the car's speed stands for it

    @property
    def stride_rows(self) -> int:
        """Rows between horizons."""
        return max(round(self.stride / self.period), 1)

    def read_with(self, effects: Effects) -> Effects:
        """The effects, the rim sensor's error that of the speed's sensor where its reading stands for the rim's."""
        return effects._replace(wheel_radius_error=effects.speed_gain_error) if self.rolls else effects

    @property
    def horizons(self) -> tuple[float, ...]:
        """Times [s] ahead that errors are of [HORIZONS]."""
        return tuple(round(self.stride_rows * self.period * (k + 1), 3) for k in range(HORIZONS))


def stride_of(vehicle: VehicleParameters) -> float:
    """Time [s] between the horizons that a car of this size is judged by."""
    return STRIDE * min(np.sqrt(wheelbase(vehicle) / FULL_LENGTH), 1.0)


def rows_between_starts(stride: float, period: float) -> int:
    """Rows from one window's start to the next; stride: time [s] between horizons."""
    return max(round(START_EVERY * stride / period), 1)


def smoothed(values: np.ndarray, period: float, stride: float = STRIDE) -> np.ndarray:
    """Local parabolas through a channel [rows]: at 100 Hz noise falls to 0.4, and motion below 3 Hz stays."""
    from scipy.signal import savgol_filter

    length = max(2 * round(0.5 * SMOOTHING * stride / period) + 1, 5)
    return np.asarray(savgol_filter(values, length, 2)) if len(values) > length else values


def windowed(run: Run, left_out: np.ndarray | None = None, stride: float = STRIDE) -> WindowedRun:
    """A run as windows.

    Args:
        left_out: rows [rows] (bool) that no window may touch; stride: time [s] between horizons (`stride_of`).
    """
    data: RunData = prepare_run(run)
    y = data.y[:, [CHANNELS.index(name) for name in PREDICTED]].copy()
    fed = run.tau_cmd is None
    if run.omega_r is None:
        y[:, 3] = y[:, 1]
    if run.psi is None:
        y[:, 4] = np.concatenate([[0.0], np.cumsum(0.5 * (y[1:, 0] + y[:-1, 0]) * run.period)])
    rows = max(round(stride / run.period), 1)
    first = round(SETTLING / run.period)
    starts = np.arange(first, len(y) - HORIZONS * rows - rows, rows_between_starts(stride, run.period))
    if left_out is not None:
        bad = np.concatenate([[0], np.cumsum(left_out)])
        margin = round(SMOOTHING * stride / run.period)
        clean = bad[starts + HORIZONS * rows + 1] == bad[np.maximum(starts - margin, 0)]
        starts = starts[clean]
    start_y = np.stack([smoothed(y[:, i], run.period, stride) for i in range(len(PREDICTED))], axis=1)
    used = np.array([True, not fed, True, not fed and run.omega_r is not None, run.psi is not None])
    return WindowedRun(
        run.name, run.period, y, start_y, data.delta, data.tau, starts, stride, fed, used, run.recording or run.name,
        run.bank, run.omega_r is None,
    )  # fmt: skip


@jitable
def _advance(z: Any, delta: Any, torque: Any, row: Any, period: Any, constants: Any, effects: Any, fed: Any,
             fed_from: Any, fed_to: Any, wrench: Any, k: Any, w: Any) -> Any:  # fmt: skip
    """One row of Runge-Kutta steps, in place; with `fed`, speeds (of car and rim [2]) are those of the measurement."""
    by_time = int(np.ceil(period / STEP - 1e-9))
    steps = min(max(by_time, int(period * fastest(z, constants, effects) / STEPS_PER_RATE) + 1), MOST_STEPS)
    h = period / steps
    for step in range(steps):
        at = STAGES * (row + step / steps)
        end = STAGES * (row + (step + 1) / steps)
        if fed:
            share = step / steps
            z[1] = fed_from[0] + share * (fed_to[0] - fed_from[0])
            z[3] = fed_from[1] + share * (fed_to[1] - fed_from[1])
        runge_kutta(rates, z, commanded(delta, torque, at), commanded(delta, torque, 0.5 * (at + end)),
                    commanded(delta, torque, end), h, (constants, effects, wrench), k, w)  # fmt: skip
        hold_speeds(z)


@jitable
def _measured_state(y: Any, effects: Any, z: Any) -> Any:
    """The car's states from what sensors read, their errors taken out."""
    z[0], v, z[2], z[3] = unbiased(y[0], y[1], y[2], y[3], effects)
    z[1] = signed_floor(v, MIN_FILTER_SPEED)
    z[4] = y[4]


@jitable
def _measured_speeds(y: Any, effects: Any) -> Any:
    """Speeds of the car and of its rim [m/s] from what sensors read, their errors taken out."""
    _, v, _, omega_r = unbiased(y[0], y[1], y[2], y[3], effects)
    return v, omega_r


@compiled
def predict_windows(
    start_y: Any, y: Any, starts: Any, stride_rows: Any, delta: Any, torque: Any, period: Any, constants: Any,
    effects: Any, fed: Any, wrenches: Any, size: Any, stepped: Any, out: Any,
) -> Any:  # fmt: skip
    """Prediction errors out [windows, horizons, 5], measured less predicted, of the windows of one run.

    Args:
        start_y, y: smoothed and raw measurements [rows, 5]; starts: rows [windows], ascending; stride_rows: between
            horizons; delta, torque: on the stages' grid (`filter_state.actuated`); constants: of any car
            (`car.equations`); effects: without those of actuators; wrenches: further force and moment on the body
            [rows, 3] (`road.on_road`), none with zero rows; size: states of the car; stepped: its internal states
            follow the measured motion by the steps of a prediction, row by row from what is measured.
    """
    has_wrench = wrenches.shape[0] == y.shape[0]
    z, carried, k, w, wrench = np.zeros(size), np.zeros(size), np.zeros(size), np.zeros((2, size)), np.zeros(3)
    decay = np.zeros(size)
    _measured_state(start_y[0], effects, carried)
    settle(carried, delta[0], torque[0], constants, effects)
    at_row, follow = 0, max(2, int(np.ceil(period / FOLLOWING - 1e-9)))
    for s in range(len(starts)):
        start = starts[s]
        # Internal states follow the measured motion up to this start.
        while at_row < start:
            if has_wrench:
                copied(wrenches[at_row], wrench)
            if stepped:
                _measured_state(start_y[at_row], effects, carried)
                _advance(carried, delta, torque, at_row, period, constants, effects, fed,
                         _measured_speeds(start_y[at_row], effects), _measured_speeds(start_y[at_row + 1], effects),
                         wrench, k, w)  # fmt: skip
            for step in range(0 if stepped else follow):
                share = (step + 0.5) / follow
                at = STAGES * (at_row + share)
                _measured_state(start_y[at_row] + share * (start_y[at_row + 1] - start_y[at_row]), effects, carried)
                rates(carried, commanded(delta, torque, at), (constants, effects, wrench), k)
                decays(carried, constants, effects, decay)
                h = period / follow
                for i in range(5, size):
                    carried[i] += h * k[i] / (1.0 + h * decay[i])
            at_row += 1
        copied(carried, z)
        _measured_state(start_y[start], effects, z)
        for h in range(out.shape[1]):
            for row in range(start + h * stride_rows, start + (h + 1) * stride_rows):
                if has_wrench:
                    copied(wrenches[row], wrench)
                _advance(z, delta, torque, row, period, constants, effects, fed,
                         _measured_speeds(start_y[row], effects), _measured_speeds(start_y[row + 1], effects),
                         wrench, k, w)  # fmt: skip
            end = start + (h + 1) * stride_rows
            r, v, beta, omega_r = unbiased(y[end, 0], y[end, 1], y[end, 2], y[end, 3], effects)
            out[s, h, 0], out[s, h, 1] = r - z[0], v - z[1]
            out[s, h, 2], out[s, h, 3] = beta - z[2], omega_r - z[3]
            out[s, h, 4] = y[end, 4] - z[4]
            for i in range(5):
                if not abs(out[s, h, i]) < LARGEST_ERROR:
                    out[s, h, i] = LARGEST_ERROR


def run_errors(
    run: WindowedRun,
    constants: CarConstants,
    effects: Effects,
    horizons: int = HORIZONS,
    wrench: np.ndarray = NO_WRENCH,
) -> np.ndarray:
    """Prediction errors [windows, horizons, 5] of one run under a car; zero where a channel is not measured.

    Args:
        wrench: further force (F_x, F_y) [N] and yaw moment [N m] on the body [rows, 3]; none with zero rows.
    """
    if isinstance(constants, SimulatorConstants):
        return simulated_errors([run], constants, effects, horizons, [wrench])[0]
    before = (float(run.delta[0]), float(run.tau[0]))
    delta, torque = actuated(run.delta, run.tau, before, run.period, effects)
    out = np.empty((len(run.starts), horizons, len(PREDICTED)))
    dynamic, banked = on_road(run.bank, constants.mass, constants.gravity, without_actuators(effects))
    stepped = kind_of(constants).STEPPED
    arguments = (run.start_y, run.y, run.starts, run.stride_rows, delta, torque, run.period, constants,
                 run.read_with(dynamic), run.fed, with_bank(wrench, banked), size_of(constants))  # fmt: skip
    if stepped and not installed_effects() and len(run.starts) > FEW:
        predict_in_lanes(*arguments, (STEP, STEPS_PER_RATE, MOST_STEPS), out)
        out[~(np.abs(out) < LARGEST_ERROR)] = LARGEST_ERROR
    else:
        predict_windows(*arguments, stepped, out)
    out[..., ~run.used] = 0.0
    return out


def errors(
    runs: Sequence[WindowedRun], constants: CarConstants, effects: Effects, horizons: int = HORIZONS
) -> np.ndarray:
    """Prediction errors [windows of all runs, horizons, 5] under a car, at the first horizons."""
    if isinstance(constants, SimulatorConstants):
        return np.concatenate(simulated_errors(runs, constants, effects, horizons, [NO_WRENCH] * len(runs)))
    return np.concatenate([run_errors(run, constants, effects, horizons) for run in runs])


def forecast_error(found: np.ndarray) -> float:
    """How far predictions are off at the last horizon [-].

    Args:
        found: errors [windows, horizons, channels] of which the first four are r [rad/s], v [m/s], beta [rad] and
            omega_r [m/s].

    Returns:
        the geometric mean over these of the median absolute error: of two models of a car, the ratio does not depend
        on units.
    """
    last = np.abs(found[:, -1, :STATES])
    return float(np.exp(np.mean(np.log(np.median(last, axis=0) + 1e-12))))


def errors_of_all(
    runs: Sequence[WindowedRun], cars: Sequence[tuple[CarConstants, Effects]], pool: ThreadPoolExecutor
) -> list[np.ndarray]:
    """The same for several cars at once, on the pool's threads."""
    return list(pool.map(lambda car: errors(runs, *car), cars))


def regimes(run: WindowedRun) -> np.ndarray:
    """How hard each window is driven [windows, 4]: most speed [m/s], r v [m/s^2], sideslip [rad], rim slip [-]."""
    rows = run.starts[:, None] + np.arange(0, HORIZONS * run.stride_rows + 1, max(run.stride_rows // 4, 1))
    r, v, beta, omega_r = (run.start_y[rows, i] for i in range(4))
    parts = (np.abs(v), np.abs(r * v), np.abs(beta), np.abs(omega_r - v * np.cos(beta)) / np.maximum(np.abs(v), 1.0))
    return np.stack([part.max(axis=1) for part in parts], axis=-1)


def thinned(runs: Sequence[WindowedRun], most: int) -> list[WindowedRun]:
    """The runs with at most so many windows, evenly chosen; starts in one piece: strides would be compiled for anew."""
    every = max(int(np.ceil(sum(len(run.starts) for run in runs) / most)), 1)
    return [dataclasses.replace(run, starts=np.ascontiguousarray(run.starts[::every])) for run in runs]
