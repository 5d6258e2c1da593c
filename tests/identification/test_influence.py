"""What is said of recordings that estimates hang on."""

import numpy as np

from drift_drake.identification.influence import ALONE, influences


def test_a_recording_that_moves_an_estimate_is_named_with_it() -> None:
    shifts = np.array([[0.0, 0.02], [3.0, -0.09], [0.5, 0.0]])
    (sentence,) = influences(["circles", "laps", "ramp"], ["friction", "mass"], shifts, np.array([1.0, 0.1]))
    assert sentence.startswith("laps alone holds the estimate of friction (3.0 standard deviations):")


def test_one_recording_is_said_to_be_one() -> None:
    assert influences(["circles"], ["friction"], np.zeros((1, 1)), np.ones(1)) == [ALONE]
