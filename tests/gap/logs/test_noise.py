"""The white noise on a signal and the step of its numbers, against signals whose noise is known in closed form."""

import math

import numpy as np
import pytest

from drift_drake.gap.logs.noise import FAR, coarse, noise_of, step, white_noise_level, without_jumps, wrap_size

T = 0.01 * np.arange(3000)


def test_the_noise_of_a_signal_that_alternates_follows_from_the_binomial_coefficients():
    """Fourth differences of (-1)^k a are 16 a: by the sum of squared coefficients, 70, a noise of 16 a / sqrt(70)."""
    alternating = 0.3 * (-1.0) ** np.arange(100)
    assert white_noise_level(alternating) == pytest.approx(0.3 * 16.0 / math.sqrt(70.0), rel=1e-12)
    cubic = 5.0 - 2.0 * T + 0.7 * T**2 - 0.01 * T**3
    assert white_noise_level(alternating + cubic[:100]) == pytest.approx(0.3 * 16.0 / math.sqrt(70.0), rel=1e-9)


def test_white_noise_is_found_to_a_hundredth_beneath_motion_and_jolts():
    noise = 0.02 * np.random.default_rng(3).standard_normal(60_000)
    motion = np.sin(0.01 * np.arange(60_000))
    assert white_noise_level(motion + noise) == pytest.approx(0.02, rel=0.015)
    jolts = np.zeros(60_000)
    jolts[::500] = 1.0
    assert white_noise_level(motion + noise + jolts) == pytest.approx(0.02, rel=0.02)
    assert white_noise_level(np.ones(9)) == 0.0


@pytest.mark.parametrize("size", [0.0039, 0.25])
def test_a_step_is_found_and_rounding_to_it_is_uniform_noise(size):
    smooth = 3.0 * np.sin(T) + 0.4 * np.sin(2.3 * T)
    rounded = 0.07 + size * np.round(smooth / size)
    assert step(rounded) == pytest.approx(size, rel=1e-6)
    # The standard deviation of a uniform error over one step.
    assert noise_of(size) == pytest.approx(np.std(np.linspace(-0.5, 0.5, 100_001) * size), rel=1e-4)
    assert np.std(rounded - 0.07 - smooth) == pytest.approx(noise_of(size), rel=0.1)
    assert coarse(rounded, size)
    noisy = smooth + 2.0 * size * np.random.default_rng(1).standard_normal(len(T))
    assert not coarse(size * np.round(noisy / size), size)
    assert step(smooth) == 0.0
    assert step(np.array([1.0, 2.0])) == 0.0


def test_a_wrap_is_as_large_as_the_range_that_it_leaves():
    there_and_back = 9.0 * np.sin(2.0 * math.pi * T / T[-1])
    there_and_back += 0.002 * np.random.default_rng(0).standard_normal(len(T))
    wrapped = (there_and_back + math.pi) % (2.0 * math.pi) - math.pi
    assert wrap_size(wrapped) == pytest.approx(2.0 * math.pi, rel=1e-3)
    continued = without_jumps(wrapped)
    kept = np.isfinite(continued)
    assert np.mean(kept) > 0.99
    np.testing.assert_allclose((continued - there_and_back)[kept], continued[0] - there_and_back[0], atol=0.02)
    assert wrap_size(np.sin(T)) is None
    assert wrap_size(np.array([])) is None


@pytest.mark.parametrize(("size", "left_out"), [(0.7, False), (1.4, True)])
def test_a_spike_is_left_out_beyond_so_many_standard_deviations_of_the_differences(size, left_out):
    """A spike h is 6 h in its middle fourth difference, where noise of one has a standard deviation of sqrt(70)."""
    values = np.random.default_rng(2).standard_normal(3000)
    values[1500] += size * FAR * math.sqrt(70.0) / 6.0
    assert bool(np.isnan(without_jumps(values)[1500])) is left_out
