"""Whitening against a brute-force normal distribution of all scores at once, and the cap of a single window."""

import numpy as np
import pytest

from drift_drake.gap.estimation.baseline import Spread
from drift_drake.gap.monitoring.history import of_parts
from drift_drake.gap.monitoring.windowed.null import Null, capped, distance, known_after, noise_of, whitened_after
from drift_drake.gap.monitoring.windowed.sums import WindowSums, no_windows
from tests.gap.monitoring.windowed.simulated import N, null_of_white_scores, window


@pytest.fixture
def null() -> Null:
    rng = np.random.default_rng(3)
    root = rng.normal(size=(N, N))
    spread = Spread(np.eye(N) + 0.1 * root @ root.T, np.full(N, 4.0), 1.5, 60, np.full(N, 0.05), np.full(N, 0.1))
    return Null(spread, rng.normal(size=N), np.eye(N) + 0.2 * root.T @ root, 0.7, 0.2, 100.0, 1.3)


def some(seed: int, windows: int) -> WindowSums:
    parts = [window(np.random.default_rng([seed, i]), np.zeros(N)) for i in range(windows)]
    return of_parts(parts[0], *parts[1:], by=lambda *a: np.sum(a, axis=0))


def test_later_windows_are_judged_given_the_earlier_ones(null: Null) -> None:
    """The joint normal distribution of both scores, conditioned by its blocks."""
    older, recent = some(1, 30), some(2, 7)
    a, b = older.information, recent.information
    stacked = np.concatenate([-a, -b])
    joint = stacked @ null.covariance @ stacked.T
    joint[:N, :N] += noise_of(null, older)
    joint[N:, N:] += noise_of(null, recent)
    mean = stacked @ null.mean
    gain = joint[N:, :N] @ np.linalg.inv(joint[:N, :N])
    off = recent.score - mean[N:] - gain @ (older.score - mean[:N])
    covariance = null.temperature * (joint[N:, N:] - gain @ joint[:N, N:])
    w, m = whitened_after(null, known_after(null, older), recent)
    assert w @ w == pytest.approx(off @ np.linalg.solve(covariance, off), rel=1e-6)
    np.testing.assert_allclose(m.T @ w, -recent.shift.T @ np.linalg.solve(covariance, off), rtol=1e-6)
    np.testing.assert_allclose(m.T @ m, recent.shift.T @ np.linalg.solve(covariance, recent.shift), rtol=1e-6)


def test_earlier_windows_narrow_what_the_car_deviates_by(null: Null) -> None:
    _, before = known_after(null, of_parts(some(1, 1), by=np.zeros_like))
    _, after = known_after(null, some(1, 40))
    assert np.all(np.linalg.eigvalsh(before - after) > -1e-9)
    assert np.trace(after) < 0.8 * np.trace(before)


def test_a_single_window_counts_up_to_the_cap_alone() -> None:
    null, nothing = null_of_white_scores(cap=1.0), no_windows(N, N)
    usual = window(np.random.default_rng(1), np.zeros(N))
    far = usual._replace(score=usual.score + 1e3)
    assert distance(null, nothing, far) > 1e5
    kept = capped(null, nothing, far)
    assert np.linalg.norm(kept.score) < 10.0 * np.linalg.norm(usual.score)
    np.testing.assert_allclose(kept.score / far.score, kept.information[0, 0] / far.information[0, 0])
    near = usual._replace(score=1e-3 * usual.score)
    for kept, given in zip(capped(null, nothing, near), near, strict=True):
        np.testing.assert_allclose(kept, given)
