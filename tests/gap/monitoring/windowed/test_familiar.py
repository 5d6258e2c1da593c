"""Driving that a calibration knows: what is hard in several ways at once is not, though each is."""

import numpy as np

from drift_drake.gap.monitoring.windowed.sums import (
    FAR,
    KnownDriving,
    familiar_of,
    harder,
    unlike,
    weight_of,
    weights_left_out,
)


def driving(rng: np.random.Generator, speed: float, lateral: float) -> np.ndarray:
    middle = np.array([speed, lateral, 0.02, -3.0, 0.0, 50.0])
    return middle + rng.normal(size=(200, 6)) * np.array([1.0, 0.5, 0.01, 0.1, 10.0, 10.0])


def familiar(*recordings: np.ndarray) -> KnownDriving:
    return familiar_of(recordings, [np.ones(len(one)) for one in recordings])


def test_what_is_hard_in_two_ways_at_once_counts_less() -> None:
    rng = np.random.default_rng(0)
    known = familiar(*(driving(rng, *how) for how in ((10.0, 8.0), (10.0, 8.0), (25.0, 1.0), (25.0, 1.0))))
    new = np.concatenate([driving(rng, 10.0, 8.0), driving(rng, 25.0, 1.0)])
    assert np.mean([weight_of(known, one) for one in new]) > 0.95
    both = driving(rng, 25.0, 8.0)
    assert np.mean([weight_of(known, one) for one in both]) < 0.7


def test_what_is_far_off_is_not_judged() -> None:
    rng = np.random.default_rng(0)
    known = familiar(driving(rng, 10.0, 8.0), driving(rng, 10.0, 8.0))
    usual, braked = known.points[0], np.array([10.0, 8.0, 0.02, -3.0, -400.0, 50.0])
    assert unlike(known, usual) is None
    why = unlike(known, braked)
    assert why is not None
    assert harder(why) == "least torque"


def test_errors_are_taken_to_grow_with_the_distance() -> None:
    known = KnownDriving(np.zeros((1, 6)), np.ones(6), 0.5, np.ones(1))
    one = np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    for distance, weight in ((0.5, 1.0), (1.0, 1.0), (2.0, 0.25), (FAR, FAR**-2)):
        np.testing.assert_allclose(weight_of(known, distance * 0.5 * one), weight)


def test_driving_that_was_predicted_badly_counts_less() -> None:
    """Also in the recording that is judged by the others, and not by itself."""
    rng = np.random.default_rng(2)
    recordings = [driving(rng, 10.0, 2.0), driving(rng, 10.0, 2.0), driving(rng, 25.0, 8.0), driving(rng, 25.0, 8.0)]
    errors = [np.full(200, size) for size in (0.5, 0.8, 4.0, 6.0)]
    known = familiar_of(recordings, errors)
    assert weight_of(known, np.array([10.0, 2.0, 0.02, -3.0, 0.0, 50.0])) == 1.0
    assert 1.0 / 6.0 <= weight_of(known, np.array([25.0, 8.0, 0.02, -3.0, 0.0, 50.0])) <= 1.0 / 4.0
    weights = [np.median(found) for found in weights_left_out(known, recordings, errors)]
    np.testing.assert_allclose(weights, [1.0, 1.0, 1.0 / 6.0, 1.0 / 4.0], rtol=0.1)


def test_the_only_recording_is_compared_with_itself_apart_in_time() -> None:
    known = familiar(driving(np.random.default_rng(1), 10.0, 8.0))
    assert 0.1 < known.limit < 10.0
