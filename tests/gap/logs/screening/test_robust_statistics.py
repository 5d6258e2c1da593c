"""Ranks and slopes that need no import of scipy.stats, held to its own."""

import numpy as np
import pytest
from scipy.stats import rankdata, theilslopes

from drift_drake.gap.logs.screening.relations import _ranks, _theil_sen


@pytest.mark.parametrize("ties", [False, True])
def test_ranks_and_slopes_are_those_of_scipy(ties: bool) -> None:
    x, y = np.random.default_rng(3).normal(size=(2, 60))
    if ties:
        x, y = np.round(x, 1), np.round(y, 1)
    np.testing.assert_allclose(_ranks(x), rankdata(x))
    assert _theil_sen(y, x) == pytest.approx(float(theilslopes(y, x).slope))
