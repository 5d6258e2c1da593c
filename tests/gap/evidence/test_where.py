"""Where the gap is: shares, regions, lags."""

import numpy as np
import pytest

from drift_drake.car.parameters import VehicleParameters
from drift_drake.gap.estimation.freeform import misfit
from drift_drake.gap.estimation.make_problem import make_problem
from drift_drake.gap.estimation.reduction import HORIZONS, STATES, start_rows
from drift_drake.gap.estimation.regression import Regression
from drift_drake.gap.evidence.where import _correlation, find_gap, region_names, region_of
from tests.gap.fits import fit

NO_FORCES = Regression(0.0, np.zeros(0), np.zeros(0, dtype=int), np.ones(5), 0.0)


def beyond(excess):
    """Errors and their floor with so much between them."""
    return [1.0 + e for e in excess], [np.ones_like(e) for e in excess]


@pytest.fixture(scope="module")
def problem(stiffness_case):
    return make_problem(stiffness_case[1], VehicleParameters())


def test_a_gap_in_one_state_of_one_run_is_put_there(problem):
    rows = [start_rows(run) for run in problem.runs]
    excess = [np.zeros((len(first), len(HORIZONS), len(STATES))) for first in rows]
    excess[3][10:, :, 2] = 7.0
    where = find_gap(problem, *beyond(excess), NO_FORCES)
    assert where["states"] == {"r": 0.0, "v": 0.0, "beta": 1.0, "omega_r": 0.0}
    assert where["runs"]["run_3"] == 1.0
    assert list(where["onset"]) == ["run_3"]
    assert where["onset"]["run_3"] == pytest.approx(rows[3][10] * 0.01, abs=0.15)
    assert all(region.startswith("slide") for region in where["regions"])


def test_without_a_gap_nothing_is_named(problem):
    rows = [start_rows(run) for run in problem.runs]
    excess = [np.zeros((len(first), len(HORIZONS), len(STATES))) for first in rows]
    where = find_gap(problem, *beyond(excess), NO_FORCES)
    assert sum(where["states"].values()) == 0.0
    assert where["regions"] == []
    assert where["onset"] == {}


def test_runs_of_unequal_length_share_the_force_channels(stiffness_case):
    runs = [stiffness_case[1][0].rows(0, 180), stiffness_case[1][2]]
    problem = make_problem(runs, VehicleParameters())
    nothing = fit(problem, (), np.zeros(problem.nuisances))
    rows = [start_rows(run) for run in problem.runs]
    excess = [np.ones((len(first), len(HORIZONS), len(STATES))) for first in rows]
    where = find_gap(problem, *beyond(excess), misfit(problem, nothing))
    assert sum(where["channels"].values()) == pytest.approx(1.0)


def test_each_row_has_a_region(problem):
    names = region_names()
    assert len(names) == len(set(names))
    for i in range(len(problem.runs)):
        y = problem.runs[i].y
        assert region_of(y[:, 1], y[:, 0], y[:, 2], 9.81).max() < len(names)


def test_the_lag_between_two_signals_is_found():
    rng = np.random.default_rng(0)
    signal = np.convolve(rng.standard_normal(600), np.ones(20) / 20.0, "same")
    scores = _correlation(np.roll(signal, 7), signal, 30)
    assert max(scores, key=lambda k: scores[k]) == 7
