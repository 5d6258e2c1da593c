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

import numpy as np

from drift_drake.car.actuated import actuated, without_actuators
from drift_drake.car.effects.catalogue import wheelbase
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.equations import CarConstants, kind_of, size_of
from drift_drake.car.foreign.simulator import SimulatorConstants
from drift_drake.car.lanes import LANES
from drift_drake.car.log.table import Run
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.road import NO_WRENCH, on_road, with_bank
from drift_drake.car.single_track.equations import REMEMBERING
from drift_drake.gap.estimation.filter_state import CHANNELS
from drift_drake.gap.estimation.followed import follow_by_steps, follow_in_lanes
from drift_drake.gap.estimation.paired_windows import predict_in_pairs
from drift_drake.gap.estimation.run_data import RunData, prepare_run
from drift_drake.gap.estimation.simulated_windows import LARGEST_ERROR, simulated_errors

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
BOUNDS = (STEP, STEPS_PER_RATE, MOST_STEPS)
TOGETHER = LANES  # cars that a thread takes on at a time
ASKED = 16  # cars at once whose roll-outs a simulator of the user's is asked for
THREADS = 2


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
    """Local parabolas through channels [rows, ...]: at 100 Hz noise falls to 0.4, and motion below 3 Hz stays."""
    from scipy.signal import savgol_filter

    length = max(2 * round(0.5 * SMOOTHING * stride / period) + 1, 5)
    return np.asarray(savgol_filter(values, length, 2, axis=0)) if len(values) > length else values


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
    start_y = smoothed(y, run.period, stride)
    used = np.array([True, not fed, True, not fed and run.omega_r is not None, run.psi is not None])
    return WindowedRun(
        run.name, run.period, y, start_y, data.delta, data.tau, starts, stride, fed, used, run.recording or run.name,
        run.bank, run.omega_r is None,
    )  # fmt: skip


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
    return run_errors_of(run, [(constants, effects)], horizons, wrench)[0]


def run_errors_of(
    run: WindowedRun, cars: Sequence[tuple[CarConstants, Effects]], horizons: int = HORIZONS,
    wrench: np.ndarray = NO_WRENCH,
) -> np.ndarray:  # fmt: skip
    """The same [cars, windows, horizons, 5] of several cars of one kind."""
    if isinstance(cars[0][0], SimulatorConstants):
        return np.stack([found for (found,) in simulated_errors([run], simulated(cars), horizons, [wrench])])
    driven = [_driven(run, constants, effects, wrench) for constants, effects in cars]
    like, kind = cars[0][0], kind_of(cars[0][0])
    deltas, torques, magnitudes, banks = map(np.array, zip(*driven, strict=True))
    numbers = np.array([kind.flattened(car) for car, _ in cars], dtype=float)
    out = np.empty((len(cars), len(run.starts), horizons, len(PREDICTED)))
    internal = np.zeros((len(cars), len(run.starts), size_of(like)))
    if kind.stepped:
        follow_by_steps(run.start_y, run.starts, deltas, torques, run.period, like, numbers, magnitudes, run.fed,
                        banks, BOUNDS, internal)  # fmt: skip
    else:
        some = np.flatnonzero(np.any(magnitudes[:, [Effects._fields.index(name) for name in REMEMBERING]], axis=1))
        if len(some):
            followed = np.empty((len(some), *internal.shape[1:]))
            follow_in_lanes(run.start_y, run.starts, deltas[some], torques[some], run.period, like, numbers[some],
                            magnitudes[some], banks[some], followed)  # fmt: skip
            internal[some] = followed
    predict_in_pairs(
        run.start_y, run.y, run.starts, run.stride_rows, deltas, torques, run.period, like, numbers, magnitudes,
        run.fed, banks, BOUNDS, internal, out,
    )  # fmt: skip
    out[~(np.abs(out) < LARGEST_ERROR)] = LARGEST_ERROR
    out[..., ~run.used] = 0.0
    return out


def _driven(
    run: WindowedRun, constants: CarConstants, effects: Effects, wrench: np.ndarray
) -> tuple[np.ndarray, np.ndarray, Effects, np.ndarray]:
    """What actuators make of the commands, the effects that are left, and the wrench with the road's bank."""
    before = (float(run.delta[0]), float(run.tau[0]))
    delta, torque = actuated(run.delta, run.tau, before, run.period, effects)
    dynamic, banked = on_road(run.bank, constants.mass, constants.gravity, without_actuators(effects))
    return delta, torque, run.read_with(dynamic), with_bank(wrench, banked)


def errors(
    runs: Sequence[WindowedRun], constants: CarConstants, effects: Effects, horizons: int = HORIZONS
) -> np.ndarray:
    """Prediction errors [windows of all runs, horizons, 5] under a car, at the first horizons."""
    if isinstance(constants, SimulatorConstants):
        (found,) = simulated_errors(runs, [(constants, effects)], horizons, [NO_WRENCH] * len(runs))
        return np.concatenate(found)
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


def simulated(cars: Sequence[tuple[CarConstants, Effects]]) -> list[tuple[SimulatorConstants, Effects]]:
    """Those that are of a simulator of the user's."""
    return [(car, effects) for car, effects in cars if isinstance(car, SimulatorConstants)]


def errors_of_all(
    runs: Sequence[WindowedRun], cars: Sequence[tuple[CarConstants, Effects]], threads: int = THREADS,
    horizons: int = HORIZONS,
) -> list[np.ndarray]:  # fmt: skip
    """The same for several cars of one kind at once."""
    if len(cars) == 1:
        return [errors(runs, cars[0][0], cars[0][1], horizons)]
    if isinstance(cars[0][0], SimulatorConstants):
        asked = [simulated(cars[first : first + ASKED]) for first in range(0, len(cars), ASKED)]
        none = [NO_WRENCH] * len(runs)
        return [np.concatenate(one) for part in asked for one in simulated_errors(runs, part, horizons, none)]
    with ThreadPoolExecutor(threads) as pool:
        some = [cars[first : first + TOGETHER] for first in range(0, len(cars), TOGETHER)]
        found = pool.map(lambda part: np.concatenate([run_errors_of(run, part, horizons) for run in runs], 1), some)
        return [e for part in found for e in part]


def regimes(run: WindowedRun) -> np.ndarray:
    """How hard each window is driven [windows, 4]: most speed [m/s], r v [m/s^2], sideslip [rad], rim slip [-]."""
    rows = run.starts[:, None] + np.arange(0, HORIZONS * run.stride_rows + 1, max(run.stride_rows // 4, 1))
    r, v, beta, omega_r = (run.start_y[rows, i] for i in range(4))
    parts = (np.abs(v), np.abs(r * v), np.abs(beta), np.abs(omega_r - v * np.cos(beta)) / np.maximum(np.abs(v), 1.0))
    return np.stack([part.max(axis=1) for part in parts], axis=-1)


def count_of(runs: Sequence[WindowedRun]) -> int:
    """Windows of all runs."""
    return sum(len(run.starts) for run in runs)


def thinned(runs: Sequence[WindowedRun], most: int) -> list[WindowedRun]:
    """The runs with at most so many windows, evenly chosen; starts in one piece: strides would be compiled for anew."""
    every = max(int(np.ceil(count_of(runs) / most)), 1)
    return [dataclasses.replace(run, starts=np.ascontiguousarray(run.starts[::every])) for run in runs]
