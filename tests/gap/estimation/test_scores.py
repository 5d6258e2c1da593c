"""The baseline of a car: blocks, weights, files, and the scores of the day that it was learnt from."""

import dataclasses
import json

import numpy as np
import pytest

from drift_drake.gap.estimation.normal import normal_from_data
from drift_drake.gap.estimation.scores import (
    BEYOND,
    CLIPPED,
    STRETCH,
    block_of,
    drive_coverage,
    familiarity,
    flat_scores,
    huber_weights,
    make_day,
    summed,
)
from drift_drake.gap.estimation.windows import STRIDE, regimes, windowed


@pytest.fixture(scope="module")
def runs(other_car):
    return [windowed(run) for run in other_car.runs]


@pytest.fixture(scope="module")
def day(other_car, runs):
    n, car = other_car.normal, other_car.found
    return make_day(runs, car.vehicle.constants(), car.effects, n.names, n.units, n)


def test_blocks_are_of_one_run_each_and_follow_without_gaps(runs):
    empty = dataclasses.replace(runs[1], starts=runs[1].starts[:0])
    parts = [runs[0], empty, runs[2]]
    block = block_of(parts)
    first, last = block[: len(runs[0].starts)], block[len(runs[0].starts) :]
    assert set(first).isdisjoint(last)  # also with a run between that has no window
    assert sorted(set(block)) == list(range(block.max() + 1))


def test_clipped_errors_are_no_larger_than_the_clip():
    e, scales = np.random.default_rng(0).standard_cauchy((50, 5, 5)), np.full((5, 5), 2.0)
    size = np.sqrt(np.mean(flat_scores(e, scales).reshape(e.shape) ** 2, axis=1))
    assert size.max() <= CLIPPED * (1.0 + 1e-9)
    small = 0.1 * np.ones((1, 5, 5))
    np.testing.assert_array_equal(huber_weights(small, scales), 1.0)


def test_the_baseline_survives_json(other_car):
    normal = other_car.normal
    again = normal_from_data(json.loads(json.dumps(normal.as_data())))
    assert again.names == normal.names
    assert again.blocks == normal.blocks
    assert again.stride == normal.stride == STRIDE
    for field in ("units", "scales", "precision", "standard", "covariance", "information", "expected", "left_open",
                  "least_deviations", "left_out", "left_out_none", "covered", "unknown", "recording"):  # fmt: skip
        np.testing.assert_array_equal(getattr(again, field), getattr(normal, field))


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("expected", [1.0]),
        ("covered", [1.0, 2.0]),
        ("covariance", [[1.0]]),
        ("standard", [1.0]),
        ("left_out", [[1.0]]),
        ("lost", [1.0]),
        ("lost", [[2.5, 0.0], [0.0, 0.0]]),
        ("lost", [[0.0, 0.0], [0.0, 0.0]]),
    ],
)
def test_another_shape_and_impossible_counts_are_refused(other_car, key, value):
    with pytest.raises(ValueError, match=f"'{key}' must hold"):
        normal_from_data(other_car.normal.as_data() | {key: value})


def test_numbers_that_are_not_finite_or_missing_are_refused(other_car):
    data = other_car.normal.as_data()
    with pytest.raises(ValueError, match="'expected' must hold"):
        normal_from_data(data | {"expected": [float("nan")] * len(other_car.normal.expected)})
    del data["units"]
    with pytest.raises(KeyError):
        normal_from_data(data)


def test_a_stretch_is_of_one_run_and_about_as_long_as_is_said(day):
    for k in np.unique(day.stretch):
        (run,) = np.unique(day.run[day.stretch == k])
        starts = day.runs[run].starts[day.stretch[day.run == run] == k]
        assert np.ptp(starts) * day.runs[run].period < 1.6 * STRETCH
    assert list(np.unique(day.stretch)) == list(range(day.stretch.max() + 1))


def test_a_long_run_is_several_stretches(day):
    run = dataclasses.replace(day.runs[0], starts=np.arange(0, 6000, 20), period=0.01)
    long = dataclasses.replace(day, runs=[run], run=np.zeros(300, dtype=int))
    assert long.stretch.max() + 1 == 5
    assert np.bincount(long.stretch) == pytest.approx(np.full(5, 60), abs=2)


def test_a_score_is_the_slope_of_half_the_squared_errors(other_car, day):
    normal = other_car.normal
    # Small errors, none of which is clipped.
    mild = dataclasses.replace(day, errors=0.05 * np.clip(day.errors / normal.scales, -3.0, 3.0) * normal.scales)
    scores = summed(mild, normal, mild.errors)
    f = flat_scores(mild.errors, normal.scales)

    def cost(q):
        moved = f + day.jacobian @ q
        return 0.5 * np.einsum("w,wi,ij,wj->", day.weights, moved, normal.precision, moved)

    for i in range(len(scores)):
        step = 1e-4 * (np.arange(len(scores)) == i)
        slope = (cost(step) - cost(-step)) / 2e-4
        assert scores[i] == pytest.approx(slope, rel=1e-4, abs=1e-6 * np.abs(scores).max())


def test_windows_beyond_what_calibration_drove_count_less(runs):
    covered = drive_coverage(runs)
    hard = np.concatenate([regimes(run) for run in runs])
    weights = familiarity(runs, covered)
    np.testing.assert_array_equal(weights[np.all(hard <= covered, axis=1)], 1.0)
    np.testing.assert_allclose(familiarity(runs, hard.max(axis=0)), 1.0)
    slower = covered.copy()
    slower[0] = hard[:, 0].min() / (1.0 + BEYOND)  # every window is faster by so much at least
    assert np.all(familiarity(runs, slower) <= 0.5 + 1e-9)
