"""A program's linear rows by stages: what they become, and which are refused."""

import numpy as np
import pytest
import scipy.sparse as sparse

from drift_drake.drive.qp.stagewise_qp import by_stages, one_sided

SIZE, HORIZON = 3, 2
STATES, INPUTS = SIZE * (HORIZON + 1), 2 * (HORIZON + 1)
EYE = np.eye(STATES + INPUTS + HORIZON)
X, U, SLACK = EYE[:STATES], EYE[STATES : STATES + INPUTS], EYE[STATES + INPUTS :]
GIVEN = [*U[:2], *X[:SIZE]]
SOFT = X[4] - 2.0 * U[3] - SLACK[0]  # of the first stage


def rows(*lines: np.ndarray) -> sparse.csr_matrix:
    return sparse.csr_matrix(np.array(lines))


def test_rows_fall_to_their_stages_as_inequalities_from_below() -> None:
    linear = by_stages(rows(SLACK[1], *GIVEN, U[4], SOFT, SLACK[0]), HORIZON, SIZE)
    np.testing.assert_array_equal(linear.given, [3, 4, 5, 1, 2])
    low = np.array([0.0, *np.zeros(5), -0.5, -np.inf, 0.0])
    high = np.array([np.inf, *np.zeros(5), 0.7, 9.0, np.inf])
    inequalities, place, side = one_sided(linear, low, high)
    np.testing.assert_array_equal(inequalities.first, [0, 2, 5])
    np.testing.assert_array_equal(inequalities.row[0], [0.0, -1.0, 0.0, 0.0, 2.0])
    np.testing.assert_array_equal(inequalities.row[2:4], [[0, 0, 0, -1, 0], [0, 0, 0, 1, 0]])
    np.testing.assert_array_equal(inequalities.softness, [1.0, 1.0, 0.0, 0.0, 1.0])
    np.testing.assert_array_equal(inequalities.bound, [-9.0, 0.0, -0.7, -0.5, 0.0])
    np.testing.assert_array_equal(place, [7, 8, 6, 6, 0])
    np.testing.assert_array_equal(side, [-1.0, 1.0, -1.0, 1.0, 1.0])


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ([*GIVEN, X[4] - X[7], *SLACK], "several stages"),
        ([*GIVEN, X[1] + X[2], *SLACK], "first state and input"),
        ([*GIVEN[1:], *SLACK], "first state and input"),
        ([*GIVEN, SOFT, SLACK[1]], "each stage's slack"),
    ],
)
def test_rows_of_another_kind_are_refused(lines: list[np.ndarray], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        by_stages(rows(*lines), HORIZON, SIZE)
