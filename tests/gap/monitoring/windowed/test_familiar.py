"""Driving that a calibration knows: what is hard in several ways at once is not, though each is."""

import numpy as np

from drift_drake.gap.monitoring.windowed.sums import familiar_of, harder, unlike


def driving(rng: np.random.Generator, speed: float, lateral: float) -> np.ndarray:
    middle = np.array([speed, lateral, 0.02, -3.0, 0.0, 50.0])
    return middle + rng.normal(size=(200, 6)) * np.array([1.0, 0.5, 0.01, 0.1, 10.0, 10.0])


def test_what_is_hard_in_two_ways_at_once_is_not_known() -> None:
    rng = np.random.default_rng(0)
    known = familiar_of([driving(rng, 10.0, 8.0), driving(rng, 10.0, 8.0), driving(rng, 25.0, 1.0),
                         driving(rng, 25.0, 1.0)])  # fmt: skip
    new = np.concatenate([driving(rng, 10.0, 8.0), driving(rng, 25.0, 1.0)])
    assert np.mean([unlike(known, one) is None for one in new]) > 0.9
    both = driving(rng, 25.0, 8.0)
    assert np.mean([unlike(known, one) is not None for one in both]) > 0.9
    braked = new[0] + np.array([0.0, 0.0, 0.0, 0.0, -400.0, 0.0])
    why = unlike(known, braked)
    assert why is not None
    assert harder(why) == "least torque"


def test_the_only_recording_is_compared_with_itself_apart_in_time() -> None:
    known = familiar_of([driving(np.random.default_rng(1), 10.0, 8.0)])
    assert 0.1 < known.limit < 10.0
