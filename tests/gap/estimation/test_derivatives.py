"""Derivatives by runs against the dense matrix that they stand for."""

import numpy as np
import pytest

from drift_drake.gap.estimation.fit import Derivatives

PARAMETERS = 7


@pytest.fixture
def derivatives():
    rng = np.random.default_rng(0)
    columns = [np.array([0, 1, 6]), np.array([0, 1, 2, 3, 6]), np.array([0, 1, 4, 5, 6])]
    return Derivatives([rng.normal(size=(n, c.size)) for n, c in zip((20, 9, 14), columns, strict=True)], columns,
                       PARAMETERS)  # fmt: skip


def test_normal_equations_are_those_of_the_dense_matrix(derivatives):
    dense = derivatives.dense()
    assert dense.shape == (43, PARAMETERS)
    assert np.count_nonzero(dense) == sum(block.size for block in derivatives.blocks)
    e, last = np.random.default_rng(1).normal(size=(2, len(dense)))
    np.testing.assert_allclose(derivatives.information, dense.T @ dense, atol=1e-12)
    np.testing.assert_allclose(derivatives.pull(e), dense.T @ e, atol=1e-12)
    wider = np.column_stack([dense, last])
    np.testing.assert_allclose(derivatives.bordered(last), wider.T @ wider, atol=1e-12)


def test_parts_are_those_of_the_runs(derivatives):
    e = np.arange(43.0)
    parts = list(derivatives.by_run(e))
    assert [len(part) for part in parts] == [20, 9, 14]
    np.testing.assert_array_equal(np.concatenate(parts), e)
