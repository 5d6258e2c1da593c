"""Shares of a gap that are removed, of made-up errors: sums, horizons, folds, and the bootstrap's interval."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

from drift_drake.gap.estimation import reduction as reductions
from drift_drake.gap.estimation.reduction import (
    FOLDS,
    HELD_OUT,
    HORIZONS,
    JUDGED,
    NOTHING_REMOVED,
    WORST,
    at_judged,
    fold_of,
    folds,
    held_out_errors,
    mean_squares,
    measured_fold,
    prediction_squares,
    reduction,
    reduction_of,
    removed_share,
    resampled,
    share_removed,
    start_rows,
    with_folds,
    without_effects,
)
from drift_drake.gap.estimation.regression import Responses, equations
from drift_drake.gap.estimation.run_data import RunData

NOISE = np.arange(1.0, 10.0)
STATES = ("r", "v", "beta", "omega_r")


def made_run(rows: int = 700, used: int = 9) -> RunData:
    """At 100 Hz; each channel grows by its own number a second; the first and last rows do not count."""
    y = np.arange(rows)[:, None] * 0.01 * np.arange(1.0, 10.0)
    counted = np.ones(rows, dtype=bool)
    counted[:35], counted[-15:] = False, False
    return RunData("run_0", 0.01, y, np.arange(9) < used, y[:, 0], y[:, 0], counted)


class Made:
    """A problem of two such runs, the second without a rim speed."""

    def __init__(self) -> None:
        self.runs, self.noise, self.nuisances = [made_run(), made_run(420, used=3)], NOISE, 2


def test_predictions_start_ten_a_second_where_rows_count() -> None:
    np.testing.assert_array_equal(start_rows(made_run(101)), np.arange(35, 86, 10))


def test_blocks_of_time_take_turns_in_being_held_out() -> None:
    run = made_run()
    seconds = np.arange(700) * 0.01
    turns = np.floor(seconds / HELD_OUT + 1e-9) % FOLDS
    np.testing.assert_array_equal(fold_of(run), turns)
    np.testing.assert_array_equal(fold_of(run)[[0, 149, 151, 599, 601]], [0, 0, 1, 3, 0])
    few = made_run(420, used=3)
    np.testing.assert_array_equal(measured_fold(few), np.repeat(fold_of(few)[35:405], 3))
    every = folds(Made())
    assert len(every) == FOLDS
    np.testing.assert_array_equal(np.sum(every, axis=0), 1)
    np.testing.assert_array_equal(every[2], np.concatenate([measured_fold(run), measured_fold(few)]) == 2)


def test_equations_of_folds_are_those_of_their_measurements() -> None:
    rng, sums = np.random.default_rng(0), []
    measured = []
    for run in Made().runs:
        count = len(measured_fold(run))
        measured.append(Responses(rng.normal(size=(count, 2)), np.array([0, 1]), rng.normal(size=(count, 3)),
                                  np.arange(3), rng.normal(size=count)))  # fmt: skip
        sums = with_folds(sums, run, measured[-1], 3)
    for fold, of in enumerate(sums):
        rows = [some.rows(measured_fold(run) == fold) for some, run in zip(measured, Made().runs, strict=True)]
        wanted = equations(rows, 3, shared=True)
        np.testing.assert_allclose(of.own, wanted.own)
        np.testing.assert_allclose(of.weights[0].hessian, wanted.weights[0].hessian)
        assert of.squares == pytest.approx(wanted.squares)


@pytest.mark.parametrize("index", [0, 1])
def test_squares_are_of_what_is_measured_that_much_later(monkeypatch: pytest.MonkeyPatch, index: int) -> None:
    """Predicted: what was measured at the start. So a channel is off by its slope times the time, in its noise."""
    problem = Made()

    def held(problem: Made, *given: object) -> np.ndarray:
        _, _, i, _, starts, steps = given
        np.testing.assert_array_equal(steps, [1, 10, 50, 200])
        return np.repeat(problem.runs[i].y[starts][:, None], len(steps), axis=1)

    monkeypatch.setattr(reductions, "predicted_ahead", held)
    starts = np.array([0, 100, 400, len(problem.runs[index].y) - 200, len(problem.runs[index].y) - 2])
    found = prediction_squares(problem, np.zeros(2), (), index, None, starts)
    for row, start in enumerate(starts):
        for h, ahead in enumerate(HORIZONS):
            inside = start + round(ahead * 100) < len(problem.runs[index].y)
            wanted = [ahead**2 if inside and problem.runs[index].used[i] else np.nan for i in range(4)]
            np.testing.assert_allclose(found[row, h], wanted, rtol=1e-9)


def test_diverged_predictions_are_infinite_and_missing_measurements_are_none(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reductions, "predicted_ahead", lambda *_: np.full((2, 4, 9), np.nan))
    found = prediction_squares(Made(), np.zeros(2), (), 1, None, np.array([0, 419]))
    assert np.isinf(found[0, :, :3]).all()
    assert np.isnan(found[0, :, 3]).all()
    assert np.isnan(found[1]).all()


def parts(before: float, after: float, floor: float) -> list[np.ndarray]:
    """Errors [40, 4, 4] that differ by state (1 and 3 times) and horizon; the last horizon and state have none."""
    by_horizon, by_state = np.array([0.25, 0.5, 1.0, np.nan]), np.array([1.0, 3.0, 1.0, np.nan])
    size = np.multiply.outer(by_horizon, by_state)
    return [np.broadcast_to(value * size, (40, 4, 4)).copy() for value in (before, after, floor)]


def test_shares_are_of_sums_above_the_floor() -> None:
    """Before 10, after 4, floor 2 of each: three quarters are removed, and less where more is left."""
    of = parts(10.0, 4.0, 2.0)
    of[1][:, JUDGED, 1] = 3.0 * 6.0  # state v: after 6
    of[1][:, 0] = of[0][:, 0]  # the first horizon: nothing is removed
    found = reduction_of(of, np.arange(40) // 10, STATES, ["a", "b", "c", "d"], JUDGED)
    # (10 - 6) / (10 - 2) of v, (10 - 4) / (10 - 2) of r and beta; v counts three times.
    assert found.by_state == pytest.approx({"r": 0.75, "v": 0.5, "beta": 0.75})
    assert found.estimate == pytest.approx((2.0 * 6.0 + 3.0 * 4.0) / (5.0 * 8.0))
    assert found.by_horizon == pytest.approx({"a": 0.0, "b": 0.75, "c": found.estimate})
    assert (found.low, found.high) == pytest.approx((found.estimate, found.estimate))  # all blocks are alike
    assert found.before[:3] == pytest.approx([10.0 * 5.0 / 3.0 * share for share in (0.25, 0.5, 1.0)])
    assert found.floor[:3] == pytest.approx([2.0 * 5.0 / 3.0 * share for share in (0.25, 0.5, 1.0)])
    assert np.isnan([found.before[3], found.after[3], found.floor[3]]).all()


def test_the_interval_is_that_of_blocks_drawn_anew() -> None:
    """Blocks whose share is 0.9 or 0.1 by turns: of n a mean of 0.5, with the binomial's standard deviation."""
    n = 100
    of = [np.full((n, 4, 1), value) for value in (11.0, 0.0, 1.0)]
    of[1][:, :, 0] = np.where(np.arange(n) % 2, 2.0, 10.0)[:, None]
    found = reduction_of(of, np.arange(n), ("r",), ["a", "b", "c", "d"], JUDGED)
    assert found.estimate == pytest.approx(0.5)
    deviation = 0.4 / np.sqrt(n)
    assert [found.low, found.high] == pytest.approx(
        [0.5 - 1.96 * deviation, 0.5 + 1.96 * deviation], abs=0.2 * deviation
    )


def test_resampled_sums_are_of_as_many_blocks() -> None:
    drawn = resampled(np.ones((7, 3)))
    np.testing.assert_array_equal(drawn, 7.0)
    assert len(np.unique(resampled(np.arange(7.0)))) > 20
    np.testing.assert_array_equal(resampled(np.arange(7.0)), resampled(np.arange(7.0)))


def test_a_share_is_between_minus_one_and_one() -> None:
    assert removed_share(11.0, 6.0, 1.0) == pytest.approx(0.5)
    assert removed_share(11.0, 0.5, 1.0) == 1.0
    assert removed_share(11.0, 50.0, 1.0) == -1.0
    assert removed_share(1.0, 0.0, 1.0) == 0.0
    errors = [np.full((5, 4, 4), 3.0) * np.array([1.0, 2.0, 4.0, 8.0])[:, None]]
    np.testing.assert_array_equal(at_judged(errors)[0], 12.0)
    assert share_removed([np.array([4.0, np.nan]), np.array([7.0])], [np.array([6.0])], [np.array([1.0])]) == 0.5


def test_means_leave_out_what_is_not_there() -> None:
    errors = np.array([[[1.0, 3.0], [np.nan, 5.0], [np.nan, np.nan]], [[2.0, np.nan], [7.0, np.inf], [np.nan, np.nan]]])
    assert mean_squares(errors)[:2] == [2.0, 6.0]
    assert np.isnan(mean_squares(errors)[2])


def test_nothing_is_removed_without_effects() -> None:
    nothing = type("Fitted", (), {"names": ()})
    assert reduction(None, nothing, nothing) is NOTHING_REMOVED
    assert dataclasses.astuple(NOTHING_REMOVED)[:3] == (0.0, 0.0, 0.0)


def test_restarts_are_drawn_in_seconds_of_their_run(monkeypatch: pytest.MonkeyPatch) -> None:
    """25 restarts are three blocks, 10 are one."""
    made = [np.full((count, 4, 4), 1.0) for count in (25, 10)]
    for name in ("without_effects", "held_out_errors", "errors_of"):
        monkeypatch.setattr(reductions, name, lambda *_: made)
    monkeypatch.setattr(reductions, "reduction_of", lambda *given: given)
    fitted = type("Fitted", (), {"names": ("aero_drag",), "theta": None})
    of, block, states, ahead, judged = reduction(None, fitted, fitted)
    np.testing.assert_array_equal(block, np.repeat([0, 1, 2, 3], [10, 10, 5, 10]))
    assert [len(part) for part in of] == [35, 35, 35]
    assert (states, ahead[judged]) == (STATES, "0.5 s")


class Fitted:
    """Of the made-up problem; its derivatives know which of their rows are kept."""

    names, theta, exactness = ("aero_drag",), np.array([0.1, 0.2, 0.3]), 0.5

    def __init__(self, kept: list[np.ndarray] | None = None) -> None:
        self.kept = kept

    def rows(self, kept: list[np.ndarray]) -> "Fitted":
        return Fitted(kept)


def test_a_fold_is_fitted_without_its_rows_and_predicted_by_that_fit(monkeypatch: pytest.MonkeyPatch) -> None:
    """The fits' parameters are numbered by the fold, and the errors of predictions are those numbers."""
    problem, fits = Made(), []
    problem.replace = lambda **changes: SimpleNamespace(**{"runs": problem.runs, "replace": problem.replace} | changes)

    def fit(held: SimpleNamespace, names, theta, iterations: int, jacobian: Fitted) -> SimpleNamespace:
        fits.append(held.runs)
        assert (names, iterations) == (Fitted.names, 3)
        for run, whole, kept in zip(held.runs, problem.runs, jacobian.kept, strict=True):
            np.testing.assert_array_equal(kept, measured_fold(whole) != len(fits) - 1)
            np.testing.assert_array_equal(run.counted, whole.counted & (fold_of(whole) != len(fits) - 1))
        return SimpleNamespace(theta=np.append(theta[:2], len(fits) - 1.0))

    def errors(_problem, theta: np.ndarray, names, starts: list[np.ndarray]) -> list[np.ndarray]:
        assert names == Fitted.names
        return [np.full((len(rows), 4, 4), theta[2]) for rows in starts]

    monkeypatch.setattr(reductions, "filter_case", lambda *_: None)
    monkeypatch.setattr(reductions, "sensitivity", lambda *_: Fitted())
    monkeypatch.setattr(reductions, "minimise", fit)
    monkeypatch.setattr(reductions, "errors_of", errors)
    found = held_out_errors(problem, Fitted())
    assert len(fits) == FOLDS
    for run, of_run in zip(problem.runs, found, strict=True):
        wanted = np.broadcast_to(fold_of(run)[start_rows(run)][:, None, None], of_run.shape)
        np.testing.assert_array_equal(of_run, wanted)


def test_errors_are_those_of_all_starts_and_none_is_worse_than_lost(monkeypatch: pytest.MonkeyPatch) -> None:
    """Under the nominal car: no deviations, or those that were found with the effects."""
    problem, asked = Made(), []
    monkeypatch.setattr(reductions, "with_more_process_noise", lambda given: given)
    monkeypatch.setattr(reductions, "filter_case", lambda _, theta, names: asked.append((list(theta), names)))
    monkeypatch.setattr(
        reductions, "prediction_squares", lambda *given: np.array([1.0, np.inf, np.nan, len(given[-1])])
    )
    for fitted, theta in ((None, [0.0, 0.0]), (Fitted(), [0.1, 0.2])):
        found = without_effects(problem, fitted)
        assert asked.pop() == (theta, ())
        for run, of_run in zip(problem.runs, found, strict=True):
            np.testing.assert_array_equal(of_run, [1.0, WORST, np.nan, len(start_rows(run))])
