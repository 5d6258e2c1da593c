"""Magnitudes by name, and what wrong sensors read."""

import numpy as np
import pytest

from drift_drake.car.effects.magnitudes import (
    NO_INTERNAL_STATES,
    Effects,
    combined,
    magnitudes_of,
    make_effects,
    measured,
    reading_gains,
    unbiased,
)

TRUE = (0.4, 12.0, -0.3, 15.0)


def test_what_has_no_states_has_zeros() -> None:
    assert not any(NO_INTERNAL_STATES)
    assert not any(Effects())


@pytest.mark.parametrize(
    ("magnitudes", "read"),
    [
        ({}, TRUE),
        ({"gyro_bias": 0.05}, (0.45, 12.0, -0.3, 15.0)),
        ({"sideslip_bias": -0.02}, (0.4, 12.0, -0.32, 15.0)),
        ({"gyro_gain_error": 0.1}, (0.44, 12.0, -0.3, 15.0)),
        ({"speed_gain_error": -0.05}, (0.4, 11.4, -0.3, 15.0)),
        ({"wheel_radius_error": 0.04}, (0.4, 12.0, -0.3, 15.6)),
        ({"gyro_bias": 0.05, "gyro_gain_error": 0.1, "speed_gain_error": 0.5}, (0.49, 18.0, -0.3, 15.0)),
    ],
)
def test_a_reading_is_gain_times_truth_plus_bias_and_stands_for_it(magnitudes: dict[str, float], read: tuple) -> None:
    q = make_effects(magnitudes)
    assert measured(*TRUE, q) == pytest.approx(read, rel=1e-12)
    assert unbiased(*read, q) == pytest.approx(TRUE, rel=1e-12)
    slopes = [(after - before) / (0.5 * value) for before, after, value in zip(
        measured(*TRUE, q), measured(*(1.5 * value for value in TRUE), q), TRUE, strict=True)]  # fmt: skip
    np.testing.assert_allclose(reading_gains(q), slopes, rtol=1e-12)


def test_effects_add_up_and_are_named() -> None:
    one, other = make_effects({"mass_error": 0.1, "aero_drag": 0.4}), make_effects({"mass_error": -0.3})
    assert magnitudes_of(combined(one, other)) == pytest.approx({"mass_error": -0.2, "aero_drag": 0.4})
    with pytest.raises(ValueError, match=r"unknown effect mass, odd; the catalogue has .*aero_drag"):
        make_effects({"mass": 1.0, "odd": 0.0, "aero_drag": 0.1})
