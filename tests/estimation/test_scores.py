"""What is normal for a car: blocks, weights, files, and the scores of the day that it was learnt from."""

import dataclasses
import json

import numpy as np
import pytest

from drift_drake.estimation.normal import normal_from_data
from drift_drake.estimation.scores import (
    BEYOND,
    CLIPPED,
    MODEL_FORM,
    block_of,
    block_scores,
    drive_coverage,
    familiarity,
    flat_scores,
    huber_weights,
    make_day,
    scatter_of,
    summed,
)
from drift_drake.estimation.windows import STRIDE, regimes, windowed
from drift_drake.vehicle.catalogue import CATALOGUE


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


def test_what_is_normal_survives_json(other_car):
    normal = other_car.normal
    again = normal_from_data(json.loads(json.dumps(normal.as_data())))
    assert again.names == normal.names
    assert again.blocks == normal.blocks
    assert again.stride == normal.stride == STRIDE
    for field in ("units", "scales", "precision", "mean", "covariance", "modes", "information", "covered", "unknown",
                  "recording"):  # fmt: skip
        np.testing.assert_array_equal(getattr(again, field), getattr(normal, field))


@pytest.mark.parametrize(
    ("key", "value"),
    [("mean", [1.0]), ("covered", [1.0, 2.0]), ("covariance", [[1.0]]), ("modes", [[1.0]]), ("modes", [1.0])],
)
def test_another_shape_is_refused(other_car, key, value):
    with pytest.raises(ValueError, match=f"'{key}' must hold"):
        normal_from_data(other_car.normal.as_data() | {key: value})


def test_numbers_that_are_not_finite_or_missing_are_refused(other_car):
    data = other_car.normal.as_data()
    with pytest.raises(ValueError, match="'mean' must hold"):
        normal_from_data(data | {"mean": [float("nan")] * len(other_car.normal.names)})
    del data["units"]
    with pytest.raises(KeyError):
        normal_from_data(data)


def test_the_day_of_calibration_is_normal(other_car, day):
    normal = other_car.normal
    np.testing.assert_allclose(np.mean(day.weights < 1.0), 0.0, atol=0.1)
    # All its windows have a weight of one where its own normal was learnt.
    whole = dataclasses.replace(day, weights=np.ones(len(day.weights)))
    x = summed(whole, normal, whole.errors) - scatter_of(whole, normal).mean
    deviations = np.sqrt(np.diag(np.linalg.inv(scatter_of(whole, normal).inverse)))
    np.testing.assert_allclose(x / deviations, 0.0, atol=1e-6)
    scores = block_scores(whole, whole.errors, normal.scales, normal.precision)
    np.testing.assert_allclose(scores.mean(axis=0), normal.mean, rtol=1e-9, atol=1e-9 * np.abs(scores).max())


def test_a_score_is_the_slope_of_half_the_squared_errors(other_car, day):
    normal = other_car.normal
    # Small errors, none of which is clipped.
    mild = dataclasses.replace(day, errors=0.05 * np.clip(day.errors / normal.scales, -3.0, 3.0) * normal.scales)
    scores = summed(mild, normal, mild.errors)
    f = flat_scores(mild.errors, normal.scales)

    def cost(q):
        moved = f + day.jacobian @ q
        return 0.5 * np.einsum("w,wi,ij,wj->", day.weights, moved, normal.precision, moved)

    for i in range(len(normal.names)):
        step = 1e-4 * (np.arange(len(normal.names)) == i)
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


def test_a_longer_day_scatters_more(other_car, day):
    normal = other_car.normal
    sizes = []
    for part in (day.block < 4, day.block >= 0):
        some = dataclasses.replace(day, errors=day.errors[part], jacobian=day.jacobian[part], block=day.block[part],
                                   run=day.run[part], weights=day.weights[part])  # fmt: skip
        sizes.append(np.diag(np.linalg.inv(scatter_of(some, normal).inverse)))
    seen = normal.information > 0.0
    assert np.all(sizes[1][seen] > sizes[0][seen])


def test_a_yaw_inertia_is_never_known_better_than_the_equations_hold(other_car):
    normal = other_car.normal
    for name, least in MODEL_FORM.items():
        i = normal.names.index(name)
        assert np.sqrt(normal.unknown[i, i]) * normal.units[i] > least


def test_a_day_of_more_recordings_is_less_alone_in_what_recordings_differ_by(other_car, day):
    normal = other_car.normal
    i = normal.names.index("sideslip_bias")
    one = dataclasses.replace(day, runs=[dataclasses.replace(run, recording="one") for run in day.runs])
    apart = dataclasses.replace(normal, recording=normal.recording * 1e6)  # beside which all else is nothing
    variances = [np.linalg.inv(scatter_of(some, apart).inverse)[i, i] for some in (one, day)]
    assert len(set(day.recordings)) > 1
    assert variances[0] > 1.5 * variances[1]


def test_what_varies_from_recording_to_recording_is_no_gap_of_a_calibrated_car(other_car):
    normal = other_car.normal
    i = normal.names.index("sideslip_bias")
    everyday = 0.5 * CATALOGUE["sideslip_bias"].least_for(other_car.guess) / normal.units[i]
    assert normal.recording[i, i] >= everyday**2
    assert np.all(np.diag(normal.unknown) >= np.diag(normal.recording) / len(other_car.runs) - 1e-12)
