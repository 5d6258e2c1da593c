"""Blocks whose predictions are lost: found, counted against a baseline's."""

import numpy as np
import pytest
from scipy.stats import betabinom

from drift_drake.gap.estimation.lost_blocks import FAR, as_often, lost_blocks, transitions

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


def test_transitions_are_counted_within_runs() -> None:
    """Given two runs of two windows a block; the second begins as if after driving that is followed."""
    lost, run = np.array([True, True, False, True, True, False, False, True]), np.repeat([0, 1], 4)
    found = transitions(lost, np.repeat(np.arange(8), 2), np.repeat(run, 2))
    assert found.tolist() == [[1, 4], [2, 1]]
    assert found.sum() == len(lost)


@pytest.mark.parametrize(
    ("day", "baseline", "same"),
    [
        ([[18, 1], [1, 4]], [[21, 1], [1, 1]], True),  # one stretch of five blocks, and one of two
        ([[18, 3], [3, 0]], [[21, 1], [1, 1]], True),
        ([[5, 9], [9, 1]], [[22, 1], [1, 0]], False),  # nine stretches, and one
        ([[2, 2], [1, 19]], [[18, 3], [3, 0]], False),  # stretches that do not end, and short ones
        ([[21, 2], [1, 0]], [[24, 0], [0, 0]], False),
        ([[24, 0], [0, 0]], [[20, 2], [2, 0]], False),
        ([[0, 4], [0, 20]], [[20, 2], [2, 0]], False),
    ],
)
def test_they_are_as_often_as_in_the_baseline_where_one_chain_is_more_probable(day, baseline, same) -> None:
    """Of 24 blocks each. A baseline without any, a log without any and a log of nothing else are left as they are."""
    assert as_often(np.array(day), np.array(baseline)) is same


def test_the_bayes_factor_is_that_of_beta_binomial_predictions() -> None:
    """An independent form: the later counts predicted from the baseline's posterior, and from the prior alone."""
    baseline = np.array([[17, 3], [3, 1]])
    for began in range(1, 8):
        for went_on in range(8):
            day = np.array([[16 - began, began], [2, went_on]])
            from_baseline, from_prior = (
                sum(betabinom.logpmf(row[1], row.sum(), 0.5 + b[1], 0.5 + b[0]) for row, b in zip(day, of, strict=True))
                for of in (baseline, np.zeros((2, 2)))
            )
            assert as_often(day, baseline) == (from_baseline > from_prior)
