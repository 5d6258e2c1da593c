"""Intervals under innovations that hang together, against scatter over many draws."""

import dataclasses

import numpy as np
import pytest
from scipy.signal import lfilter

from drift_drake.car.log.table import Run
from drift_drake.gap.estimation.fit import Derivatives
from drift_drake.gap.estimation.run_data import prepare_run
from drift_drake.gap.identification.model_discrepancy import widening

ROWS = 3000


def run_of(rows):
    t = np.arange(rows) * 0.01
    run = prepare_run(Run("run", t, np.ones(rows), np.full(rows, 10.0), np.zeros(rows)))
    return dataclasses.replace(run, counted=np.ones(rows, dtype=bool))


def of_one_run(jacobian):
    return Derivatives([jacobian], [np.arange(jacobian.shape[1])], jacobian.shape[1])


def test_what_a_prior_alone_holds_is_not_widened():
    """Innovations that hang together, and a parameter that they hardly show with one that they do."""
    e = lfilter([0.3], [1.0, -0.95], np.random.default_rng(1).standard_normal((ROWS, 2)), axis=0)
    jacobian = np.column_stack([np.ones(2 * ROWS), np.full(2 * ROWS, 1e-4)])
    jacobian[::2, 1] *= -1.0
    covariance = np.linalg.inv(jacobian.T @ jacobian + np.diag([0.0, 1.0]))
    reported, held = widening([run_of(ROWS)], of_one_run(jacobian), e.ravel(), covariance)
    assert reported > 2.0
    assert held == pytest.approx(1.0, abs=0.01)


def test_rounding_of_what_no_prior_holds_narrows_nothing():
    """Without a prior all of the variance is expected, to rounding: no root of a negative number."""
    jacobian = np.random.default_rng(3).standard_normal((2 * ROWS, 6)) * 10.0 ** np.arange(6)
    covariance = np.linalg.inv(jacobian.T @ jacobian) * (1.0 + 1e-12)
    np.testing.assert_array_equal(
        widening([run_of(ROWS)], of_one_run(jacobian), np.zeros(2 * ROWS), covariance), np.ones(6)
    )


@pytest.mark.parametrize("hanging", [0.0, 0.95])
def test_the_widening_is_the_ratio_of_the_true_scatter_to_the_white_one(hanging):
    rng = np.random.default_rng(1)
    run, found, estimates = run_of(ROWS), [], []
    jacobian = np.ones((2 * ROWS, 1))
    covariance = np.array([[1.0 / (2 * ROWS)]])
    for _ in range(60):
        e = rng.standard_normal((ROWS, 2))
        e = lfilter([np.sqrt(1.0 - hanging**2)], [1.0, -hanging], e, axis=0)
        found.append(widening([run], of_one_run(jacobian), e.ravel(), covariance)[0])
        estimates.append(np.mean(e))
    truth = np.std(estimates) * np.sqrt(2 * ROWS)
    assert np.median(found) == pytest.approx(truth, rel=0.25)
    assert min(found) >= 1.0
