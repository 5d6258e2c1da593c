"""Scores of made-up windows: blocks and stretches of time, clipping, information, and how recordings differ."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

from drift_drake.car.double_track.parameters import CARS
from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.equations import kind_of
from drift_drake.car.parameters import VehicleParameters
from drift_drake.gap.estimation import scores
from drift_drake.gap.estimation.scores import (
    ALIKE,
    BEYOND,
    CLIPPED,
    LARGEST,
    STRETCH,
    Day,
    between_recordings,
    block_information,
    block_of,
    block_scores,
    drive_coverage,
    familiarity,
    flat_scores,
    make_day,
    moved_by,
    pulls,
    scaled,
    scores_by_recording,
    shrunk,
    spread,
    summed,
    summed_over,
    units,
    window_scores,
)
from drift_drake.gap.estimation.windows import WindowedRun

HORIZONS, CHANNELS, MOVED = 2, 3, 4


def windowed_run(starts: list[int], name: str = "run_0", speed: float = 10.0) -> WindowedRun:
    """At 100 Hz, in a steady turn."""
    rows = max(starts, default=0) + 100
    y = np.tile([0.5, speed, -0.1, 1.1 * speed, 0.0], (rows, 1))
    return WindowedRun(name, 0.01, y, y, y[:, 0], y[:, 0], np.array(starts, dtype=int), 0.1, False,
                       np.ones(5, dtype=bool), name)  # fmt: skip


@pytest.fixture
def day() -> Day:
    """Two runs of one recording and one of another, eight windows; errors of which none is clipped."""
    runs = [windowed_run([0, 150, 210]), windowed_run([0, 450]), windowed_run([40, 60, 230])]
    runs = [dataclasses.replace(run, recording=name) for run, name in zip(runs, ("b", "a", "b"), strict=True)]
    rng = np.random.default_rng(4)
    return Day(runs, VehicleParameters().constants(), Effects(), rng.normal(size=(8, HORIZONS, CHANNELS)),
               rng.normal(size=(8, HORIZONS * CHANNELS, MOVED)), block_of(runs), np.repeat([0, 1, 2], [3, 2, 3]),
               rng.uniform(0.3, 1.0, 8), np.empty(0), np.empty(0))  # fmt: skip


def test_blocks_are_two_seconds_of_a_run_by_the_windows_starts() -> None:
    runs = [windowed_run([0, 100, 199, 200, 650]), windowed_run([]), windowed_run([350, 399, 400])]
    np.testing.assert_array_equal(block_of(runs), [0, 0, 0, 1, 2, 3, 3, 4])


def test_a_days_windows_are_of_runs_of_recordings_of_blocks(day: Day) -> None:
    np.testing.assert_array_equal(day.recordings, [1, 0, 1])
    np.testing.assert_array_equal(day.block, [0, 0, 1, 2, 3, 4, 4, 5])
    assert day.blocks == 6
    assert day.ahead == ["0.1 s", "0.2 s", "0.3 s", "0.4 s", "0.5 s"]
    kept = day.kept(np.array([False, True, False, False, False, True, False, True]))
    assert [list(run.starts) for run in kept.runs] == [[150], [40, 230]]
    np.testing.assert_array_equal(kept.block, [0, 1, 2])
    np.testing.assert_array_equal(kept.run, [0, 1, 1])
    np.testing.assert_array_equal(kept.errors, day.errors[[1, 5, 7]])
    np.testing.assert_array_equal(kept.jacobian, day.jacobian[[1, 5, 7]])
    np.testing.assert_array_equal(kept.weights, day.weights[[1, 5, 7]])
    score = np.arange(12.0).reshape(6, 2)
    by_recording, blocks = scores_by_recording(day, score)
    np.testing.assert_array_equal(by_recording, [score[2] + score[3], score[[0, 1, 4, 5]].sum(axis=0)])
    np.testing.assert_array_equal(blocks, [2, 4])


def test_a_run_falls_into_equal_stretches(day: Day) -> None:
    """Two of a run of about twice that long, counted from its first window; a short one, or one window, is one."""
    seconds = 2.2 * STRETCH
    long = windowed_run([300, *(300 + round(100 * seconds * share) for share in (0.49, 0.51, 1.0))])
    runs = [windowed_run([7]), long, windowed_run([0, 100])]
    made = dataclasses.replace(day, runs=runs, run=np.repeat([0, 1, 2], [1, 4, 2]))
    np.testing.assert_array_equal(made.stretch, [0, 1, 1, 2, 2, 3, 3])


def test_a_clipped_error_has_the_size_of_the_clip_and_keeps_its_direction() -> None:
    scales = np.array([[2.0, 1.0, 0.5], [4.0, 1.0, 0.25]])
    e = np.ones((1, HORIZONS, CHANNELS)) * scales * [3.0 * CLIPPED, 0.9 * CLIPPED, -7.0 * CLIPPED]
    np.testing.assert_allclose(flat_scores(e, scales), [[CLIPPED, 0.9 * CLIPPED, -CLIPPED] * 2], rtol=1e-12)
    moved = scaled(e, scales)
    np.testing.assert_allclose(moved, [[3.0 * CLIPPED, 0.9 * CLIPPED, -LARGEST] * 2], rtol=1e-12)


def test_scores_and_information_are_first_and_second_derivatives_of_half_the_squares(day: Day) -> None:
    """Of each window's errors, in scales, under what moves them: half of weight times e' P e."""
    scales = np.random.default_rng(5).uniform(2.0, 3.0, (HORIZONS, CHANNELS))
    root = np.random.default_rng(6).normal(size=(6, 6))
    precision = root @ root.T

    def costs(q: np.ndarray) -> np.ndarray:
        moved = (day.errors / scales).reshape(8, -1) + day.jacobian @ q
        return 0.5 * day.weights * np.einsum("wi,ij,wj->w", moved, precision, moved)

    steps = 1e-4 * np.eye(MOVED)
    slopes = np.stack([(costs(d) - costs(-d)) / 2e-4 for d in steps], axis=-1)
    found = window_scores(day, day.errors, scales, precision)
    np.testing.assert_allclose(found, slopes, rtol=1e-7, atol=1e-7)
    by_block = [slopes[day.block == block].sum(axis=0) for block in range(6)]
    np.testing.assert_allclose(block_scores(day, day.errors, scales, precision), by_block, rtol=1e-7, atol=1e-7)
    kept = np.array([True, False, True, True, False, True, True, True])
    for which in (None, kept):
        rows = kept if which is not None else np.ones(8, dtype=bool)
        bent = np.einsum("w,wip,ij,wjq->pq", day.weights[rows], day.jacobian[rows], precision, day.jacobian[rows])
        np.testing.assert_allclose(block_information(day, scales, precision, which), bent, rtol=1e-10)
    some = np.array([True, False, True, True, False, False])
    normal = type("Known", (), {"scales": scales, "precision": precision})
    np.testing.assert_allclose(summed(day, normal, day.errors), np.sum(by_block, axis=0), rtol=1e-6, atol=1e-6)
    wanted = np.sum(np.array(by_block)[some], axis=0)
    np.testing.assert_allclose(summed(day, normal, day.errors, some), wanted, rtol=1e-6, atol=1e-6)


def test_clipped_errors_hold_information_by_their_weight(day: Day) -> None:
    """One channel, one window, clipped to a fifth."""
    one = dataclasses.replace(day, errors=np.full((1, 2, 1), 10.0 * CLIPPED), weights=np.array([0.8]),
                              jacobian=np.ones((1, 2, 1)))  # fmt: skip
    found = block_information(one, np.full((2, 1), 2.0), np.diag([1.0, 3.0]))
    assert found == pytest.approx((1.0 + 3.0) * 0.8 / 5.0)


def test_a_window_beyond_what_is_known_counts_half_at_its_measure() -> None:
    covered = np.array([10.0, 5.0, 0.3, 1.0])
    for beyond, weight in ((-0.5, 1.0), (0.0, 1.0), (BEYOND, 0.5), (2.0 * BEYOND, 0.2)):
        runs = [windowed_run([0, 50], speed=10.0 * (1.0 + beyond))]
        np.testing.assert_allclose(familiarity(runs, covered), weight, rtol=1e-9)


def test_a_calibration_covers_all_but_its_hardest_windows() -> None:
    runs = [windowed_run([0], speed=float(speed)) for speed in range(101)]
    covered = drive_coverage(runs)
    assert covered[:2] == pytest.approx([98.0, 49.0])
    assert covered[2] > 1.2 * 0.1  # a changed car slides more on the same drive


def test_a_days_derivatives_are_by_effects_their_parts_and_the_kinds_deviations(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Errors that each car is off by as much as its effects say; a double-track car has deviations of its own."""
    runs, car = [windowed_run([0, 200]), windowed_run([100])], CARS["coupe"].constants()
    names, steps, off = ("mass_error", "aero_drag"), np.array([0.1, 0.5]), np.arange(30.0).reshape(3, 2, 5)
    kinds = len(kind_of(car).deviations)

    def errors_of(_runs, constants, effects: Effects) -> np.ndarray:
        return off + 10.0 * effects.mass_error + effects.aero_drag + (0.25 if constants != car else 0.0)

    monkeypatch.setattr(scores, "errors", errors_of)
    monkeypatch.setattr(scores, "errors_of_all", lambda runs, cars, _: [errors_of(runs, *one) for one in cars])
    monkeypatch.setattr(scores, "free_columns", lambda *_: {})
    monkeypatch.setattr(scores, "partial_columns", lambda jacobian, *_: ([], 7.0 * jacobian[..., :1]))
    monkeypatch.setattr(scores, "familiarity", lambda *_: np.full(3, 0.5))
    normal = SimpleNamespace(scales=np.full((2, 5), 2.0), standard="standard", kind_units=3.0, covered=None)
    day = make_day(runs, car, Effects(), names, steps, normal)
    np.testing.assert_array_equal(day.errors, off)
    columns = [0.5, 0.25, 3.5, *[3.0 * 0.125] * kinds]
    np.testing.assert_allclose(day.jacobian, np.tile(columns, (3, 10, 1)), rtol=1e-12)
    np.testing.assert_array_equal(day.kind_units, [3.0] * kinds)
    np.testing.assert_array_equal(day.run, [0, 0, 1])
    np.testing.assert_array_equal(day.block, [0, 1, 2])
    np.testing.assert_array_equal(day.weights, 0.5)
    known = np.full((3, 10, 4), 9.0)
    given = make_day(runs, car, Effects(), names, steps, normal, of_kind=known)
    np.testing.assert_array_equal(given.jacobian[..., 3:], known)
    monkeypatch.setattr(scores, "standards", lambda _: "own")
    first = make_day(runs, car, Effects(), names, steps)
    assert first.standard == "own"
    np.testing.assert_array_equal(first.weights, 1.0)


def test_values_add_up_by_group() -> None:
    values = np.array([[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]])
    np.testing.assert_array_equal(summed_over(values, np.array([2, 0, 2])), [[3.0, 4.0], [0.0, 0.0], [6.0, 8.0]])


def test_recordings_of_a_mean_ask_for_their_own_and_scatter_by_their_variance() -> None:
    """K recordings of n readings each of one vector: the estimate is the mean, of which one shifts it by a K-th."""
    own = np.random.default_rng(1).normal(size=(5, 2))
    n, estimate = 7.0, own.mean(axis=0)
    slopes, covariance = n * (estimate - own), np.eye(2) / (5 * n)
    found = pulls(slopes, np.full(5, n), covariance)
    np.testing.assert_allclose(found, (own - estimate) / 5, rtol=1e-12)
    np.testing.assert_allclose(spread(found), np.cov(own.T), rtol=1e-12)
    np.testing.assert_allclose(spread(found[:1]), found[:1].T @ found[:1])
    # What all recordings ask for alike, as against a prior, is no difference between them; longer ones ask for more.
    lengths = np.array([1.0, 2.0, 3.0, 4.0, 5.0])
    np.testing.assert_allclose(pulls(np.outer(lengths, [0.3, -2.0]), lengths, covariance), 0.0, atol=1e-15)


def test_recordings_that_differ_alike_in_all_that_logs_show_are_taken_as_they_are() -> None:
    rng = np.random.default_rng(2)
    root = rng.normal(size=(3, 3))
    information, prior = root @ root.T, np.diag([0.1, 1.0, 4.0])
    alone = np.linalg.inv(information + prior)
    shown = alone @ information @ alone
    for count in (2, 5):
        np.testing.assert_allclose(shrunk(2.5 * shown, alone, information, count), 2.5 * shown, rtol=1e-9)
        share = ALIKE / (ALIKE + count - 1)
        less = shrunk(2.5 * shown, alone, information, count, chance=1.0)
        np.testing.assert_allclose(less, (2.5 - share) * shown, rtol=1e-9)
        none = shrunk(2.5 * shown, alone, information, count, chance=9.0)
        np.testing.assert_allclose(none, (1.0 - share) * 2.5 * shown, rtol=1e-9)
    seen = np.diag([1.0, 0.0, 0.0])
    np.testing.assert_allclose(shrunk(seen, alone, information, 1), shrunk(seen, alone, information, 1).T, rtol=1e-9)
    assert np.linalg.matrix_rank(shrunk(seen, alone, information, 1)) == 3


def test_two_deviations_from_recording_to_recording_are_a_gap_where_an_effect_varies() -> None:
    car, names = VehicleParameters(), tuple(CATALOGUE)
    found = between_recordings(names, car)
    for name, deviation in zip(names, found, strict=True):
        assert 2.0 * deviation == pytest.approx(CATALOGUE[name].least_for(car) if CATALOGUE[name].varies else 0.0)
    assert 0 < np.count_nonzero(found) < len(names)


def test_derivatives_are_taken_over_a_part_of_each_range() -> None:
    car, names = VehicleParameters(), tuple(CATALOGUE)
    for name, unit in zip(names, units(names, car), strict=True):
        low, high = CATALOGUE[name].range_for(car)
        assert 0.1 < unit / max(abs(low), abs(high)) < 1.0


@pytest.mark.parametrize(
    ("name", "channel"), [("gyro_gain_error", 0), ("speed_gain_error", 1), ("wheel_radius_error", 3)]
)
def test_what_a_sensors_gain_moves_holds_no_noise_of_the_readings(name: str, channel: int) -> None:
    """A reading y = p + n of a prediction p has the error n, and y / (1 + q) - p with the gain: -q p / (1 + q), and a
    share q of the noise, which scores, products with the error, would be off by."""
    rng, q = np.random.default_rng(7), 0.02
    predicted = rng.normal(0.0, 0.5, (400, 5, 5))  # of what changes in a window: no more than the noise
    noise = 0.2 * rng.standard_normal(predicted.shape)
    with_gain = noise.copy()
    with_gain[..., channel] = (predicted + noise)[..., channel] / (1.0 + q) - predicted[..., channel]
    moved = moved_by(with_gain, noise, name, q)
    np.testing.assert_allclose(moved[..., channel], -q * predicted[..., channel] / (1.0 + q), atol=1.1 * q**2)
    assert not np.any(np.delete(moved, channel, axis=-1))
    own = moved[..., channel].ravel(), noise[..., channel].ravel()
    assert abs(np.corrcoef(*own)[0, 1]) * np.sqrt(len(own[0])) < 3.0
    np.testing.assert_array_equal(moved_by(with_gain, noise, "gyro_bias", q), with_gain - noise)
