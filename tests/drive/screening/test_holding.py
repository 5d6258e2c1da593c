"""A sideslip that stays at its value while the car changes, found by course and yaw rate; none found on a good car."""

import numpy as np
import pytest

from drift_drake.car.sensors import MEASURED_STATE, NoiseLevels
from drift_drake.drive.screening.holding import BETA, DOUBTED, DPHI, SETTLED, Holding, R, S

PERIOD, CURVATURE, V = 0.02, 0.05, 12.0
NOISE = np.array([getattr(NoiseLevels(), name) for name in MEASURED_STATE])


def readings(seconds: float, gyro_bias: float = 0.0, gyro_gain: float = 0.0) -> np.ndarray:
    """Noisy readings [rows, 7] of a car that swings from one drift to the other on a bend."""
    t = np.arange(0.0, seconds, PERIOD)
    beta = 0.5 * np.cos(1.5 * t)
    x = np.zeros((len(t), 7))
    x[:, 1] = x[:, 3] = V
    x[:, BETA], x[:, S] = beta, V * t
    x[:, DPHI] = 0.05 * np.sin(2.0 * t)
    x[:, R] = CURVATURE * V + 0.1 * np.cos(2.0 * t) + 0.75 * np.sin(1.5 * t)  # course rate less that of the sideslip
    x[:, R] += gyro_bias + gyro_gain * x[:, R]
    return x + NOISE * np.random.default_rng(0).standard_normal(x.shape)


def found(x: np.ndarray, length: float = np.inf) -> float:
    """When the sideslip is found to be wrong [s]; infinite if it is not."""
    state = Holding()
    for row in range(1, len(x)):
        state = state.after_good(x[row], x[row - 1], CURVATURE, length, PERIOD)
        if state.wrong(NOISE):
            return row * PERIOD
    return np.inf


@pytest.mark.parametrize("sensor", [{}, {"gyro_bias": 0.04}, {"gyro_bias": -0.04}, {"gyro_gain": 0.05}])
def test_a_good_sideslip_is_not_doubted(sensor: dict[str, float]) -> None:
    assert found(readings(30.0, **sensor)) == np.inf


def test_a_path_that_starts_anew_changes_nothing() -> None:
    x = readings(30.0)
    x[:, S] %= 100.0
    assert found(x, 100.0) == np.inf


@pytest.mark.parametrize("begins", [1.0, 2.3, 10.0])
def test_one_that_holds_is_found_once_the_car_has_swung(begins: float) -> None:
    x = readings(begins + 3.0)
    at = round(begins / PERIOD)
    x[at:, BETA] = x[at, BETA] + NOISE[BETA] * np.random.default_rng(1).standard_normal(len(x) - at)
    when = found(x)
    assert begins < when < begins + 1.2
    true = 0.5 * np.cos(1.5 * when)
    state = Holding()
    for row in range(1, round(when / PERIOD) + 1):
        state = state.after_good(x[row], x[row - 1], CURVATURE, np.inf, PERIOD)
    right, fused = state.without(x[round(when / PERIOD)], NOISE)
    assert abs(right[BETA] - true) < 0.5 * abs(x[round(when / PERIOD), BETA] - true)
    assert fused.covariance[BETA, BETA] > 100.0 * NOISE[BETA] ** 2


def test_after_a_bad_reading_it_is_not_judged_for_a_while() -> None:
    state = Holding(error=1.0, turned=0.5).after_bad(PERIOD)
    assert (state.error, state.good) == (0.0, 0.0)
    assert not Holding(error=1.0, good=SETTLED - PERIOD).wrong(NOISE)
    assert Holding(error=1.0, good=SETTLED).wrong(NOISE)
    assert Holding(doubted=DOUBTED).after_bad(PERIOD).doubted == DOUBTED - PERIOD
