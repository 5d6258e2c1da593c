"""Offsets between clocks that are known, and the honesty of their uncertainty."""

import numpy as np
import pytest

from drift_drake.gap.logs.clock_offset import estimate_offset


def motion_at(t, generator_seed):
    generator = np.random.default_rng(generator_seed)
    frequencies, phases = generator.uniform(0.3, 6.0, 12), generator.uniform(0.0, 6.3, 12)
    return np.sin(np.outer(t, frequencies) + phases) @ (1.0 / frequencies)


def sparse_and_dense(offset, seed, noise=0.3, duration=40.0):
    t_ref = np.arange(0.0, duration, 0.01)
    t = np.arange(1.0, duration - 1.0, 0.1)
    z = 2.0 * motion_at(t + offset, seed) + 0.7
    return t, z + noise * np.random.default_rng(seed + 1000).standard_normal(len(t)), t_ref, motion_at(t_ref, seed)


def test_known_offsets_lie_within_their_uncertainty():
    deviations = []
    for seed in range(60):
        offset = np.random.default_rng(seed).uniform(-0.3, 0.3)
        found = estimate_offset(*sparse_and_dense(offset, seed), start=0.0, search=0.5)
        deviations.append((found.offset - offset) / found.std)
    assert 0.8 < np.std(deviations) < 1.3
    assert abs(np.mean(deviations)) < 0.4


def test_uncertainty_of_coloured_noise():
    deviations = []
    for seed in range(60):
        t, z, t_ref, ref = sparse_and_dense(0.1, seed, noise=0.0)
        shocks = np.random.default_rng(seed).standard_normal(len(t) + 20)
        z = z + 0.3 * np.convolve(shocks, np.ones(5) / np.sqrt(5.0), "same")[10:-10]
        found = estimate_offset(t, z, t_ref, ref, 0.0, 0.5)
        deviations.append((found.offset - 0.1) / found.std)
    assert 0.75 < np.std(deviations) < 1.35


def test_gain_and_correlation():
    t, z, t_ref, ref = sparse_and_dense(-0.13, 3, noise=0.01)
    found = estimate_offset(t, -z, t_ref, ref, 0.0, 0.5)
    assert found.gain == pytest.approx(-2.0, rel=0.01)
    assert found.correlation < -0.999
    assert found.offset == pytest.approx(-0.13, abs=1e-3)


def test_clocks_of_different_epochs():
    t, z, t_ref, ref = sparse_and_dense(0.05, 4, noise=0.01)
    found = estimate_offset(t - 500.0, z, t_ref + 1.7e9, ref, 1.7e9 + 500.0, 0.5)
    assert found.offset - 1.7e9 - 500.0 == pytest.approx(0.05, abs=1e-3)


def test_what_cannot_be_said():
    t, z, t_ref, ref = sparse_and_dense(0.9, 5, noise=0.01)
    with pytest.raises(ValueError, match="no best offset within"):
        estimate_offset(t[5:-5], np.cumsum(np.ones(len(t) - 10)), t_ref, t_ref**2, 0.0, 0.5)
    with pytest.raises(ValueError, match="stands still"):
        estimate_offset(t, np.ones(len(t)), t_ref, ref, 0.0, 0.5)
    with pytest.raises(ValueError, match="20 are needed"):
        estimate_offset(t[:10], z[:10], t_ref, ref, 0.0, 0.5)


def test_the_uncertainty_next_to_a_trend_is_the_straight_regressions():
    """Of A sin(w t) on a trend that the constant takes up: sigma / (A w sqrt(n / 2)), whatever the trend's slope."""
    t_ref, t = np.arange(0.0, 40.0, 0.01), np.arange(1.0, 39.0, 0.02)
    amplitude, frequency, noise, stds = 1.0, 2.0 * np.pi / 2.0, 0.05, []
    for seed in range(8):
        shaken = noise * np.random.default_rng(seed).standard_normal(len(t))
        z = 4.0 * t + amplitude * np.sin(frequency * t) + shaken
        found = estimate_offset(t, z, t_ref, 4.0 * t_ref + amplitude * np.sin(frequency * t_ref), 0.0, 0.4)
        stds.append(found.std)
    assert np.mean(stds) == pytest.approx(noise / (amplitude * frequency * np.sqrt(len(t) / 2.0)), rel=0.2)
