"""What is asked of arrays of numbers."""

import numpy as np
import pytest

from drift_drake.common.arrays import correlation

RNG = np.random.default_rng(0)


def test_correlation_is_that_of_the_definition_whatever_the_size():
    a, b = RNG.normal(size=50), RNG.normal(size=50)
    expected = np.mean((a - a.mean()) * (b - b.mean())) / (a.std() * b.std())
    assert correlation(a, b) == pytest.approx(expected, abs=1e-12)
    assert correlation(1e300 * a, -b) == pytest.approx(-expected, abs=1e-12)


@pytest.mark.parametrize("other", [np.ones(50), np.full(50, 1e300), np.append(RNG.normal(size=49), np.nan)])
def test_what_does_not_vary_or_is_no_number_is_like_nothing(other):
    assert correlation(RNG.normal(size=50), other) == 0.0
    assert correlation(other[:1], other[:1]) == 0.0
