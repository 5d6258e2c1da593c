"""Differentiates a recording: a Kalman (Rauch-Tung-Striebel) smoother whose noise and bandwidth are estimated from it.

The signal is taken as driven by white jerk (its acceleration is a random walk) and measured with white noise. Both
intensities follow from the signal by maximum likelihood: the noise in closed form, their ratio by a line search. The
ratio says up to which frequency the smoother takes what it sees for motion: its gain there is one half, and falls with
the sixth power beyond.
Clocks may be uneven and readings may be missing (NaN): the smoother bridges the gap and says how badly.
"""

import dataclasses
import math
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import minimize_scalar

from drift_drake.car.compilation import compiled
from drift_drake.common.arrays import Array

SHORTEST = 20  # readings; the ratio cannot be estimated from fewer
TIME_SCALES = (0.3, 300.0)  # of the smoother, 1 / (2 pi bandwidth), in sampling periods
START = 10  # first readings, through which the parabola goes that the state's start is sought about
START_VARIANCE = (1e4, 1e4, 1e4)  # of the start, in units of third differences and periods: more than it can be off
UNINFORMED = 5  # first innovations, which show the start and nothing of the noise


@dataclasses.dataclass(frozen=True)
class Smoothed:
    """A signal z [n, k] with its derivatives.

    value, rate, acceleration: [n, k], units of z, z/s, z/s^2. std [n, 3]: of each, posterior, the same in all k.
    noise: standard deviation of one reading [z]. bandwidth: frequency [Hz] up to which the smoother sees motion; errors
    of neighbouring rows are correlated over about 1 / (2 pi bandwidth).
    """

    value: Array
    rate: Array
    acceleration: Array
    std: Array
    noise: float
    bandwidth: float


class _Fit(NamedTuple):
    """A signal's columns [k, n] less a parabola (bend, slope, origin) along the time [n, 1] in periods, all in units of
    its noise's order, and what the smoother's ratio and the noise are."""

    steps: Array
    columns: Array
    parabola: tuple[Array, Array, Array]
    along: Array
    unit: float
    period: float
    log_scale: float
    noise: float


def noise_of(t: Array, z: Array) -> float:
    """Standard deviation of one reading of z [n] at times t [n] [s], as `smooth` estimates it, in less time.

    Raises:
        ValueError: fewer than SHORTEST readings.
    """
    return _fit(t, z, math.inf).noise


def smooth(t: Array, z: Array, highest: float = math.inf) -> Smoothed:
    """Smooths and differentiates z [n] or [n, k] (its k columns share noise and bandwidth), read at times t [n] [s].

    highest: bandwidth [Hz] that the estimate may not exceed; what is faster is taken for noise (a vibration, say).

    Raises:
        ValueError: fewer than SHORTEST readings.
    """
    fit = _fit(t, z, highest)
    (bend, slope, origin), along, period = fit.parabola, fit.along, fit.period
    states = [_smoothed(fit.steps, column, float(np.exp(-6.0 * fit.log_scale))) for column in fit.columns]
    mean = np.stack([state[0] for state in states], axis=1) * fit.unit
    std = np.sqrt(np.maximum(states[0][1], 0.0)) * fit.noise / period ** np.arange(3)
    return Smoothed(
        value=mean[:, :, 0] + origin + slope * along + bend * along**2,
        rate=(mean[:, :, 1] + slope + 2.0 * bend * along) / period,
        acceleration=(mean[:, :, 2] + 2.0 * bend) / period**2,
        std=std,
        noise=fit.noise,
        bandwidth=float(np.exp(-fit.log_scale)) / (2.0 * np.pi * period),
    )


def _fit(t: Array, z: Array, highest: float) -> _Fit:
    z = np.asarray(z, dtype=float).reshape(len(t), -1)
    seen = np.isfinite(z).all(axis=1)
    if np.count_nonzero(seen) < SHORTEST:
        raise ValueError(f"{np.count_nonzero(seen)} readings cannot be differentiated; give at least {SHORTEST}")
    period = float(np.median(np.diff(t)))
    steps = np.diff(t, prepend=t[0]) / period
    # Readings that stand still have no noise to estimate: take rounding's.
    readings, floor = z[seen], 1e-12 * max(1.0, float(np.nanmax(np.abs(z))))
    unit = max(float(np.std(np.diff(readings, n=3, axis=0))), floor)
    start = int(np.flatnonzero(seen)[0])
    # A parabola has no jerk: taking one off changes nothing but the start's numbers.
    passed = np.cumsum(steps)
    bend, slope, origin = np.polyfit(passed[seen][:START] - passed[start], readings[:START], 2)
    along = (passed - passed[start])[:, None]
    # Columns one behind the other: what takes one column would be compiled anew for strides.
    columns = np.ascontiguousarray(((z - (origin + slope * along + bend * along**2)) / unit).T)

    def cost(log_scale: float) -> float:
        ratio, total, log_det, count = np.exp(-6.0 * log_scale), 0.0, 0.0, 0
        for column in columns:
            chi2, logs, used = _likelihood(steps, column, ratio, start)
            total, log_det, count = total + chi2, log_det + logs, count + used
        return float(log_det + count * np.log(max(total / count, 1e-30)))

    low, high = np.log(TIME_SCALES)
    low = min(max(low, -math.log(2.0 * math.pi * highest * period)), high - 0.1)
    grid = np.linspace(low, high, 13)
    best = int(np.argmin([cost(g) for g in grid]))
    found = minimize_scalar(cost, bounds=(grid[max(best - 1, 0)], grid[min(best + 1, 12)]), method="bounded",
                            options={"xatol": 0.02})  # fmt: skip
    ratio = float(np.exp(-6.0 * found.x))
    chi2, _, count = np.sum([_likelihood(steps, column, ratio, start) for column in columns], axis=0)
    noise = unit * float(np.sqrt(chi2 / count))
    return _Fit(steps, columns, (bend, slope, origin), along, unit, period, float(found.x), noise)


@compiled
def _transition(h: float) -> Any:
    """Moves (value, rate, acceleration) on by h periods [3, 3]."""
    f = np.eye(3)
    f[0, 1] = f[1, 2] = h
    f[0, 2] = 0.5 * h * h
    return f


@compiled
def _product(f: Any, m: Any) -> Any:
    """f m of a matrix [3, 3] and a vector [3]."""
    result = np.zeros(3)
    for i in range(3):
        for j in range(3):
            result[i] += f[i, j] * m[j]
    return result


@compiled
def _congruence(f: Any, p: Any) -> Any:
    """f p f' of two matrices [3, 3] (loops compile in a tenth of the time of matrix products)."""
    result = np.zeros((3, 3))
    for i in range(3):
        for j in range(3):
            for k in range(3):
                for n in range(3):
                    result[i, j] += f[i, k] * p[k, n] * f[j, n]
    return result


@compiled
def _predict(h: float, m: Any, p: Any, ratio: float) -> None:
    """Moves the state m [3] with covariance p [3, 3] on by h periods, in place."""
    m[0] += h * m[1] + 0.5 * h * h * m[2]
    m[1] += h * m[2]
    # f p f' + q written out: this is where the likelihood's time goes.
    a, b, c, d, e, f = p[0, 0], p[0, 1], p[0, 2], p[1, 1], p[1, 2], p[2, 2]
    p[0, 0] = a + 2.0 * h * b + h**2 * (c + d) + h**3 * e + 0.25 * h**4 * f + ratio * h**5 / 20.0
    p[0, 1] = p[1, 0] = b + h * (c + d) + 1.5 * h**2 * e + 0.5 * h**3 * f + ratio * h**4 / 8.0
    p[0, 2] = p[2, 0] = c + h * e + 0.5 * h**2 * f + ratio * h**3 / 6.0
    p[1, 1] = d + 2.0 * h * e + h**2 * f + ratio * h**3 / 3.0
    p[1, 2] = p[2, 1] = e + h * f + ratio * h**2 / 2.0
    p[2, 2] = f + ratio * h


@compiled
def _correct(z: float, m: Any, p: Any) -> tuple[float, float]:
    """Takes in one reading of unit noise, in place; returns the innovation and its variance."""
    innovation, variance = z - m[0], p[0, 0] + 1.0
    a, b, c = p[0, 0], p[0, 1], p[0, 2]
    m[0] += a * innovation / variance
    m[1] += b * innovation / variance
    m[2] += c * innovation / variance
    p[0, 0] -= a * a / variance
    p[0, 1] -= a * b / variance
    p[0, 2] -= a * c / variance
    p[1, 1] -= b * b / variance
    p[1, 2] -= b * c / variance
    p[2, 2] -= c * c / variance
    p[1, 0], p[2, 0], p[2, 1] = p[0, 1], p[0, 2], p[1, 2]
    return innovation, variance


@compiled
def _likelihood(steps: Any, z: Any, ratio: float, start: int) -> tuple[float, float, int]:
    """Sum of squared whitened innovations, sum of the logarithms of their variances, and their number."""
    m, p = np.zeros(3), np.diag(np.array(START_VARIANCE))
    chi2, logs, seen = 0.0, 0.0, 0
    for k in range(start, len(z)):
        if k > start:
            _predict(steps[k], m, p, ratio)
        if np.isnan(z[k]):
            continue
        innovation, variance = _correct(z[k], m, p)
        seen += 1
        if seen > UNINFORMED:
            chi2 += innovation * innovation / variance
            logs += np.log(variance)
    return chi2, logs, max(seen - UNINFORMED, 1)


@compiled
def _smoothed(steps: Any, z: Any, ratio: float) -> tuple[Any, Any]:
    """Means [n, 3] and variances [n, 3] given all readings (noise and period are 1), after Bryson and Frazier:
    the backward pass carries the adjoint of the innovations and needs no inverse."""
    n = len(z)
    means, covariances, variances = np.zeros((n, 3)), np.zeros((n, 3, 3)), np.zeros((n, 3))
    innovations, spreads = np.zeros(n), np.ones(n)
    m, p = np.zeros(3), np.diag(np.array(START_VARIANCE))
    for k in range(n):
        if k > 0:
            _predict(steps[k], m, p, ratio)
        means[k], covariances[k] = m, p  # before reading k
        if not np.isnan(z[k]):
            innovations[k], spreads[k] = _correct(z[k], m, p)
    adjoint, information = np.zeros(3), np.zeros((3, 3))
    for k in range(n - 1, -1, -1):
        if k < n - 1:
            back = _transition(steps[k + 1]).T
            adjoint, information = _product(back, adjoint), _congruence(back, information)
        if not np.isnan(z[k]):
            left = np.eye(3)
            for i in range(3):
                left[0, i] -= covariances[k, i, 0] / spreads[k]  # transpose of I - gain [1, 0, 0]
            adjoint, information = _product(left, adjoint), _congruence(left, information)
            adjoint[0] -= innovations[k] / spreads[k]
            information[0, 0] += 1.0 / spreads[k]
        spread = _congruence(covariances[k], information)
        for i in range(3):
            variances[k, i] = covariances[k, i, i] - spread[i, i]
            for j in range(3):
                means[k, i] -= covariances[k, i, j] * adjoint[j]
    return means, variances
