"""What is said of recordings that disagree."""

import numpy as np

from drift_drake.identification.by_prediction import ALONE, differences


def test_estimates_that_recordings_disagree_about_are_named_with_the_recording() -> None:
    pulled = np.array([[0.0, 0.1, 0.5], [3.0, -0.1, 0.2], [-1.0, 0.0, -0.7]])
    names = ["friction", "mass", "drag"]
    first, second = differences(["circles", "laps", "ramp"], names, pulled, np.array([9.0, 0.1, 0.6]),
                                np.array([10.0, 1.0, 1.0]))  # fmt: skip
    assert first.startswith("the recordings ask for different values of friction, laps the most,")
    assert second.startswith("the recordings ask for different values of drag, ramp the most,")


def test_one_recording_is_said_to_be_one() -> None:
    assert differences(["circles"], ["friction"], np.zeros((1, 1)), np.zeros(1), np.ones(1)) == [ALONE]
