"""The solver's work: times against the period, failures marked."""

import numpy as np
import pandas as pd
import pytest

from drift_drake.view.pictures.time_series import solver_work
from drift_drake.view.style import save

STATISTICS = pd.DataFrame({
    "t": [0.0, 0.01, 0.02, 0.03], "seconds": [0.002, 0.004, 0.012, 0.003], "iterations": [1.0, 2.0, 3.0, 1.0],
    "qp_iterations": [25.0, 50.0, 100.0, 25.0], "qp_fallbacks": [0.0, 1.0, 2.0, 0.0],
    "qp_unsolved": [0.0, 0.0, 1.0, 0.0], "failed": [0.0, 0.0, 1.0, 0.0]})  # fmt: skip


def test_times_are_in_milliseconds_and_late_and_failed_plans_marked(tmp_path):
    figure = solver_work(STATISTICS, 0.01)
    assert save(figure, tmp_path / "work.png").stat().st_size > 10_000
    time = figure.axes[0]
    solve, period, late, failed = time.get_lines()
    np.testing.assert_allclose(solve.get_ydata(), [2.0, 4.0, 12.0, 3.0])
    assert period.get_ydata()[0] == 10.0
    np.testing.assert_allclose(late.get_ydata(), [12.0])
    np.testing.assert_allclose(failed.get_ydata(), [12.0])
    assert (late.get_label(), failed.get_label()) == ("late (1)", "failed (1)")


def test_a_table_without_failures_has_no_marks():
    figure = solver_work(STATISTICS.assign(failed=0.0), 0.02)
    assert len(figure.axes[0].get_lines()) == 2


def test_how_the_qps_were_solved_is_reported():
    solved = {line.get_label(): line.get_ydata() for line in solver_work(STATISTICS, 0.01).axes[1].get_lines()}
    assert {name: list(count) for name, count in solved.items()} == {
        "QPs solved (2)": [1.0, 1.0], "second attempt (1)": [2.0], "unsolved (1)": [3.0]}  # fmt: skip


def test_missing_statistics_are_named():
    with pytest.raises(ValueError, match="lacks the column"):
        solver_work(STATISTICS.drop(columns="seconds"), 0.01)


def test_rows_before_the_first_solve_are_left_out():
    before = STATISTICS.assign(seconds=[0.0, 0.004, 0.012, 0.003])
    assert len(solver_work(before, 0.01).axes[0].get_lines()[0].get_ydata()) == 3
    with pytest.raises(ValueError, match="solver statistics' is empty"):
        solver_work(STATISTICS.assign(seconds=0.0), 0.01)
