"""The noise on readings: where it is white, and whether a day's is the baseline's."""

import dataclasses

import numpy as np
import pytest
from scipy.signal import butter, filtfilt
from scipy.stats import t

from drift_drake.gap.estimation.noise_levels import NOT_WHITE, changed, is_white, log_levels
from drift_drake.gap.estimation.windows import PREDICTED, WindowedRun
from drift_drake.gap.evidence.left_over import with_noise

ROWS = 1200
DEVIATIONS = np.array([0.002, 0.02, 0.002, 0.04, 0.001])  # of the channels
WHEEL = PREDICTED.index("omega_r")


def recording(seed: int, name: str) -> WindowedRun:
    rng, s = np.random.default_rng(seed), 0.01 * np.arange(ROWS)
    motion = np.stack([0.4 * np.sin(s), 12.0 + np.cos(s), 0.1 * np.sin(2.0 * s), 12.0 + np.cos(s), -np.cos(s)], -1)
    y = motion + DEVIATIONS * rng.normal(size=(ROWS, len(PREDICTED)))
    zeros = np.zeros(ROWS)
    return WindowedRun(name, 0.01, y, y, zeros, zeros, np.arange(5), 0.1, False, np.ones(5, dtype=bool), name)


@pytest.fixture(scope="module")
def baseline() -> np.ndarray:
    return log_levels([recording(seed, f"run_{seed}") for seed in range(4)], white=True)


def with_wheel(run: WindowedRun, wheel: np.ndarray) -> WindowedRun:
    y = run.y.copy()
    y[:, WHEEL] = wheel
    return dataclasses.replace(run, y=y)


def test_levels_are_the_deviations_of_white_noise(baseline: np.ndarray) -> None:
    np.testing.assert_allclose(np.exp(baseline), np.tile(DEVIATIONS, (4, 1)), rtol=0.1)


def test_what_is_left_of_a_smoothed_signal_is_no_noise() -> None:
    run = recording(0, "run_0")
    smooth = filtfilt(*butter(2, 8.0, fs=100.0), run.y[:, WHEEL])
    assert is_white(run.y[:, WHEEL])
    assert not is_white(smooth)
    levels = log_levels([with_wheel(run, smooth)], white=True)
    assert levels[0, WHEEL] == NOT_WHITE
    _, evidence = changed(levels, [run])
    assert evidence[WHEEL] == 0.0


def test_the_same_noise_is_evidence_for_no_change(baseline: np.ndarray) -> None:
    for seed in range(10, 20):
        ratios, evidence = changed(baseline, [recording(seed, "later")])
        assert np.all(np.abs(ratios) < 0.2)
        assert np.all(evidence < -1.0)


def test_evidence_is_that_of_students_t(baseline: np.ndarray) -> None:
    """scipy's density, with the variance that four recordings and a prior worth four teach."""
    run = recording(31, "later")
    ratios, evidence = changed(
        baseline, [with_wheel(run, run.y[:, WHEEL] + 0.03 * np.random.default_rng(1).normal(size=ROWS))]
    )
    apart = baseline - baseline.mean(axis=0)
    variance = (4.0 * 0.25**2 + np.sum(apart**2, axis=0)) / 7.0 * 1.25
    same, other = (t.logpdf(ratios, 7.0, scale=np.sqrt(v)) for v in (variance, variance + 1.2**2))
    np.testing.assert_allclose(evidence, other - same, rtol=1e-9)


@pytest.mark.parametrize("coarse", [0.25, 0.5])
def test_a_coarse_a_noisier_and_a_filtered_wheel_speed_are_seen(baseline: np.ndarray, coarse: float) -> None:
    run = recording(30, "later")
    wheel = run.y[:, WHEEL]
    noisier = wheel + 0.2 * np.random.default_rng(1).normal(size=ROWS)
    filtered = filtfilt(*butter(2, 8.0, fs=100.0), wheel)
    for changed_wheel, sign in ((coarse * np.round(wheel / coarse), 0.0), (noisier, 1.0), (filtered, -1.0)):
        ratios, evidence = changed(baseline, [with_wheel(run, changed_wheel)])
        assert evidence[WHEEL] > 3.0
        assert sign == 0.0 or np.sign(ratios[WHEEL]) == sign
        assert np.all(np.delete(evidence, WHEEL) < 0.0)


def test_a_yaw_rate_in_degrees_is_said_and_a_spike_is_not(baseline: np.ndarray) -> None:
    run = recording(9, "later")
    spike, degrees = run.y.copy(), run.y.copy()
    spike[600, WHEEL] += 30.0
    degrees[:, 0] *= 57.3
    assert changed(baseline, [dataclasses.replace(run, y=spike)]).sentences() == []
    (sentence,) = changed(baseline, [dataclasses.replace(run, y=degrees)]).sentences()
    assert sentence.startswith("the noise on r is more than 20 times the baseline's: another sensor")


def test_changed_noise_alone_is_something_else_and_no_change_costs_little() -> None:
    assert with_noise(4.0, None) == 4.0
    assert with_noise(-2.0, 8.0) > 4.0  # though the scores speak against it
    assert -0.2 < with_noise(4.0, -1.5) - 4.0 < 0.0
