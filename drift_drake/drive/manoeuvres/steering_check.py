"""How a car's steering follows its commands, asked of a slow drive before any bold one: its lag, and the limit of its
rate. A drive that is planned for a typical steering spins with one that is 0.15 s late or turns at 1.2 rad/s.
"""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from drift_drake.car.actuated import STAGES, actuated
from drift_drake.car.compilation import compiled
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.log.table import InvalidLogError, Run
from drift_drake.car.parameters import Constants, VehicleParameters
from drift_drake.car.single_track.motion import motion
from drift_drake.common.arrays import Array
from drift_drake.drive.learnt.command_lag import TYPICAL
from drift_drake.drive.manoeuvres.drivers import ROW_PERIOD, RowByRowDriver
from drift_drake.drive.reference.similarity import similarity
from drift_drake.drive.reference.trajectory import straight_line

# Of the check of a car of the default one's size; of others in their own units (`similarity`).
SPEED = 6.0  # [m/s], at which the tyres hardly slide
ANGLE = 0.12  # [rad] to either side: 0.3 rad/s of yaw rate, and at most 1 m off the lane's middle
SCRIPT = ((0.5, 0.0), (1.3, 1.0), (2.5, -1.0), (3.0, 0.6), (4.5, 0.0))  # until when [s], which share of the angle
DURATION = SCRIPT[-1][0]  # [s]
HALF_WIDTH = 3.0  # [m] of a lane for it
SPEED_TIME = 0.5  # [s] in which an error in speed is taken off
BACK = (0.05, 0.25)  # [rad/m], [-]: slow enough for a steering that is a second late
LAGS = (0.02, 0.05, 0.1, 0.2, 0.4, 0.8)  # [s] from which the search begins, and
RATES = (0.1, 0.2, 0.4, 0.8, 1.6)  # [rad/s]
LIMITED = 0.6  # of the squares that are left over without a limit of the rate, below which there is one
UNEXPLAINED = 0.1  # share of the yaw rate's variance, from which on a log is of something else
CLOSE = 1e-4  # [s] between rows
LEAST, MOST = np.log([0.01, 0.05]), np.log([2.0, 20.0])  # of both
USUAL = (0.1, 2.2)  # [s], [rad/s]: up to this lag and from this rate on, plans for a typical steering hold


class Steering(NamedTuple):
    """How a car's road wheel follows its command: first-order, and no faster than a rate."""

    lag: float = TYPICAL[0]  # [s]
    rate: float = math.inf  # [rad/s]; infinite where no limit was met

    @property
    def usual(self) -> bool:
        """Whether drives may be planned and tracked as for a typical steering."""
        return self.lag <= USUAL[0] and self.rate >= USUAL[1]

    def sentence(self) -> str:
        """What it is, for a message."""
        limit = f", as if it turned at most {self.rate:.2g} rad/s" if math.isfinite(self.rate) else ""
        return f"a steering that is {self.lag:.2g} s late{limit}"

    @property
    def effects(self) -> Effects:
        """The same as magnitudes."""
        return Effects(steering_lag=self.lag, steering_rate_limit=self.rate if math.isfinite(self.rate) else 0.0)

    @property
    def lags(self) -> Array:
        """Lags [2] of a learnt model of such a car [s]."""
        return np.array([self.lag, TYPICAL[1]])


USUAL_STEERING = Steering()


class SteeringCheck(RowByRowDriver):
    """Steers to and fro at a low speed along a straight lane.

    Ports and state: see `RowByRowDriver`.

    Attributes:
        speed, duration: [m/s], [s]; lane: that it needs.
    """

    def __init__(self, parameters: VehicleParameters) -> None:
        super().__init__(parameters)
        self._units = similarity(parameters)
        self.speed, self.duration = SPEED * self._units.speed, DURATION * self._units.time
        self.lane = straight_line(self.speed, self.speed, self.duration, HALF_WIDTH * self._units.length)

    def start(self) -> Array:
        """The state [6] that it starts from."""
        return np.array([0.0, self.speed, 0.0, self.speed, 0.0, 0.0])

    def wanted(self, t: float, measured: Array) -> Array:
        share = next((share for until, share in SCRIPT if t < until * self._units.time), 0.0)
        delta = ANGLE * share - BACK[0] / self._units.length * measured[4] - BACK[1] * measured[5]
        acceleration = (self.speed - measured[1]) / (SPEED_TIME * self._units.time)
        return np.array([delta, self.torque(acceleration)])


def steering_of(run: Run, parameters: VehicleParameters) -> Steering:
    """The lag and the limit of the rate by which the check's commands explain its yaw rate best.

    The rest of the car is the first guess, rolling; its steering ratio and an offset are free.

    Args:
        run: log at 100 Hz of a `SteeringCheck`, which begins straight on; parameters: a first guess of the car.

    Raises:
        InvalidLogError: a log of something else.
    """
    commands, measured = np.asarray(run.delta_cmd, dtype=float), np.asarray(run.r, dtype=float)
    speed, constants, none = np.asarray(run.v, dtype=float), parameters.constants(), np.zeros(len(run))
    if abs(run.period - ROW_PERIOD) > CLOSE:
        raise InvalidLogError(f"{run.name}: rows are {run.period:.3g} s apart; give a log with {ROW_PERIOD:g} s")

    def left_over(steering: Steering) -> Array:
        delta = actuated(commands, none, (float(commands[0]), 0.0), ROW_PERIOD, steering.effects)[0][::STAGES]
        yaw_rate = _yaw_rate(delta, speed, constants, ROW_PERIOD)
        regressors = np.stack([yaw_rate, np.ones_like(yaw_rate)], axis=1)
        return measured - regressors @ np.linalg.lstsq(regressors, measured, rcond=None)[0]

    def best(rates: Sequence[float]) -> Steering:
        starts = (Steering(lag, rate) for lag in LAGS for rate in rates)
        return _refined(left_over, min(starts, key=lambda start: square(left_over(start))))

    free, limited = best([math.inf]), best(RATES)
    found = limited if square(left_over(limited)) < LIMITED * square(left_over(free)) else free
    if not square(left_over(found)) < UNEXPLAINED * square(measured - measured.mean()):
        raise InvalidLogError(
            f"{run.name}: the steering does not explain the yaw rate; drive the check that 'drift-drake simulate "
            "steering_check' writes, on a straight"
        )
    return found


def square(values: Array) -> float:
    """The sum of squares."""
    return float(values @ values)


def _refined(left_over: Callable[[Steering], Array], start: Steering) -> Steering:
    """The best steering near a first guess, with a limit of the rate where that has one."""
    count = 2 if math.isfinite(start.rate) else 1

    def of(logs: Array) -> Steering:
        return Steering(*np.exp(logs).tolist())

    found = least_squares(lambda logs: left_over(of(logs)), np.log(start[:count]), bounds=(LEAST[:count], MOST[:count]),
                          diff_step=1e-3)  # fmt: skip
    return of(found.x)


@compiled
def _yaw_rate(delta: Array, speed: Array, constants: Constants, dt: float) -> Array:
    """Yaw rate [rad/s] of a single-track car that rolls at a speed [rows] [m/s], from straight on."""
    out, beta = np.zeros(len(delta)), 0.0
    for k in range(len(delta) - 1):
        r, v, angle = out[k], speed[k], 0.5 * (delta[k] + delta[k + 1])
        first = motion(r, v, beta, v, angle, 0.0, constants)
        half_r, half_beta = r + 0.5 * dt * first.r_dot, beta + 0.5 * dt * first.beta_dot
        middle = motion(half_r, v, half_beta, v, angle, 0.0, constants)
        out[k + 1] = r + dt * middle.r_dot
        beta += dt * middle.beta_dot
    return out
