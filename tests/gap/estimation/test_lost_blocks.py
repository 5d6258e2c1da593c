"""Blocks whose predictions are lost: found, counted against a baseline's."""

import numpy as np
import pytest
from scipy.stats import betabinom

from drift_drake.gap.estimation.lost_blocks import FAR, as_often, lost_blocks

HORIZONS, CHANNELS = 3, 2


def test_a_block_is_lost_where_its_root_mean_square_error_is_far() -> None:
    """Given three blocks of two windows, one of which is just beyond the bound, and one lost in one window alone."""
    scales, offset = np.full((HORIZONS, CHANNELS), 0.5), np.full((HORIZONS, CHANNELS), 2.0)
    size = np.array([1.01, 1.01, 0.99, 0.99, 0.0, 1.6]) * FAR
    errors = offset + size[:, None, None] * scales
    assert lost_blocks(errors, offset, scales, np.array([0, 0, 1, 1, 2, 2])).tolist() == [True, False, True]


def test_one_window_far_beyond_all_does_not_count_without_bound() -> None:
    """A diverged prediction counts as a hundred scales, so that it loses a block of a hundred windows, not more."""
    errors = np.zeros((1000, 1, 1))
    errors[7] = 1e6
    assert not lost_blocks(errors, np.zeros((1, 1)), np.ones((1, 1)), np.zeros(1000, dtype=int))[0]


@pytest.mark.parametrize(
    ("lost", "baseline", "same"),
    [(5, 4, True), (1, 4, True), (6, 4, True), (20, 4, False), (3, 0, False), (0, 4, False), (24, 24, False)],
)
def test_a_share_is_the_baselines_where_one_share_is_more_probable(lost: int, baseline: int, same: bool) -> None:
    """Of 24 blocks each. A baseline without any, a log without any and a log of nothing else are left as they are."""
    assert as_often(lost, 24, baseline, 24) is same


def test_the_bayes_factor_is_that_of_beta_binomial_predictions() -> None:
    """An independent form: the later count predicted from the baseline's posterior, and from the prior alone."""
    for lost in range(1, 24):
        from_baseline = betabinom.logpmf(lost, 24, 0.5 + 4, 0.5 + 20)
        from_prior = betabinom.logpmf(lost, 24, 0.5, 0.5)
        assert as_often(lost, 24, 4, 24) == (from_baseline > from_prior)
