"""How far the gap shrinks: folds, shares, predictions of a right model."""

import numpy as np
import pytest

from drift_drake.car.parameters import VehicleParameters
from drift_drake.gap.estimation import reduction as reductions
from drift_drake.gap.estimation.filtered import filter_case
from drift_drake.gap.estimation.freeform import misfit
from drift_drake.gap.estimation.make_problem import make_problem
from drift_drake.gap.estimation.reduction import (
    FOLDS,
    HELD_OUT,
    WORST,
    errors_of,
    fold_of,
    mean_squares,
    prediction_squares,
    reduction,
    share_removed,
    start_rows,
    without_effects,
)
from drift_drake.gap.evidence.where import find_gap
from tests.gap.fits import fit

NAMES = ("rear_stiffness_error",)


@pytest.fixture(scope="module")
def problem(stiffness_case):
    return make_problem(stiffness_case[1], VehicleParameters())


def test_blocks_take_turns_in_being_held_out(problem):
    run = problem.runs[0]
    folds = fold_of(run)
    assert set(folds) == set(range(min(FOLDS, int(np.ceil(len(folds) * run.period / HELD_OUT)))))
    changes = np.flatnonzero(np.diff(folds))
    assert np.all(np.diff(changes) == round(HELD_OUT / run.period))


def test_shares_count_from_the_floor():
    def part(value):
        return [np.full((5, 4), value)]

    assert share_removed(part(11.0), part(2.0), part(1.0)) == pytest.approx(0.9)
    assert share_removed(part(11.0), part(21.0), part(1.0)) == pytest.approx(-1.0)
    assert share_removed(part(1.0), part(1.0), part(1.0)) == 0.0


def test_a_right_model_predicts_to_the_noise(problem, stiffness_case):
    theta = np.append(np.zeros(problem.nuisances), stiffness_case[0].effects[NAMES[0]])
    theta[5], theta[0] = 1.0, -1.0  # torque and mass, in tolerances: as in the case
    starts = start_rows(problem.runs[2])
    right, wrong = (
        prediction_squares(problem, t, n, 2, filter_case(problem, t, n), starts)
        for t, n in ((theta, NAMES), (theta[:-1] * 0.0, ()))
    )
    one_step = np.nanmean(right[:, 0])
    assert 0.8 < one_step < 1.5
    assert np.nanmean(wrong[:, 2]) > 2.0 * np.nanmean(right[:, 2])
    assert np.isnan(right[-1, 3]).all()


def test_a_horizon_that_no_run_reaches_has_no_number(stiffness_case):
    runs = [run.rows(0, 180) for run in stiffness_case[1]]
    short = make_problem(runs, VehicleParameters())
    found = fit(short, NAMES, np.append(np.zeros(short.nuisances), -0.2))
    shrinks = reduction(short, found, found)
    assert list(shrinks.by_horizon) == ["0.01 s", "0.1 s", "0.5 s"]
    assert np.isnan(shrinks.before[3])
    where = find_gap(short, without_effects(short, None), errors_of(short, found.theta, NAMES), misfit(short, found))
    assert list(where["horizons"]) == ["0.01 s", "0.1 s", "0.5 s"]
    assert np.isfinite(list(where["horizons"].values())).all()


def test_a_prediction_without_a_number_is_the_worst_not_a_missing_one(problem, monkeypatch):
    def lost(*arguments):
        out = roll_out(*arguments)
        out[0] = np.nan
        return out

    roll_out = reductions.roll_out
    monkeypatch.setattr(reductions, "roll_out", lost)
    squares = errors_of(problem, np.zeros(problem.nuisances), ())[0]
    assert (squares[0, :3] == WORST).all()
    assert mean_squares(squares[:1])[:3] == [WORST] * 3
