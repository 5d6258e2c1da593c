"""The part of long logs that is looked at: how much, and that it is spread over all of them."""

import numpy as np
import pytest

from drift_drake.car.log.table import Run
from drift_drake.gap.estimation.usable import PIECE, part_of


def runs_of(seconds, count, period=0.05):
    rows = round(seconds / period) + 1
    t = 7.0 + period * np.arange(rows)
    v = 10.0 + 0.001 * np.arange(rows)
    return [Run(f"run_{i}", t, np.full(rows, 0.1), v, np.zeros(rows)) for i in range(count)]


def seconds(runs):
    return sum(run.t[-1] - run.t[0] for run in runs)


def test_logs_within_the_limit_are_left_as_they_are():
    runs = runs_of(12.0, 25)
    kept, said = part_of(runs, 300.0)
    assert all(a is b for a, b in zip(kept, runs, strict=True))
    assert said == []


def test_of_longer_logs_the_limit_is_taken_and_said():
    kept, said = part_of(runs_of(12.0, 300), 300.0)
    assert 300.0 - PIECE < seconds(kept) <= 300.0 + 1e-6
    assert said == ["of 3600 s of logs 300 s are used, 25 pieces spread evenly over them"]


@pytest.mark.parametrize("rhythm", [2, 3, 4, 5, 8, 12])
def test_manoeuvres_that_take_turns_are_all_met(rhythm):
    """Every twelfth run of 300 would be the same of four manoeuvres each time."""
    names = [run.name for run in part_of(runs_of(12.0, 300), 300.0)[0]]
    at = np.array([int(name.removeprefix("run_")) for name in names])
    assert np.all(np.diff(at) > 0)
    assert np.max(np.diff(at)) < 2 * 300 / len(at)
    met = np.bincount(at % rhythm, minlength=rhythm)
    assert np.min(met) >= len(at) // rhythm // 2


def test_a_long_run_is_cut_into_pieces_of_its_rows():
    (run,) = runs_of(3600.0, 1)
    kept, said = part_of([run], 300.0)
    assert len(said) == 1
    assert 300.0 - PIECE < seconds(kept) <= 300.0 + 1e-6
    first = [int(np.searchsorted(run.t, piece.t[0])) for piece in kept]
    for start, piece in zip(first, kept, strict=True):
        np.testing.assert_array_equal(piece.v, run.v[start : start + len(piece)])
        assert piece.recording == "run_0"
        assert piece.name == f"run_0 from {piece.t[0] - run.t[0]:.0f} s"
    assert len({piece.name for piece in kept}) == len(kept)
    assert np.max(np.diff(first)) < 2 * len(run) / len(kept)


def test_a_limit_below_one_piece_takes_one():
    kept, _ = part_of(runs_of(12.0, 3), 1.0)
    assert len(kept) == 1
