"""Magnitudes that an effect may have, by hand, and the shifts that would be named, by the normal distribution."""

import numpy as np
import pytest
from scipy.stats import norm

from drift_drake.car.parameters import Tolerance, VehicleParameters
from drift_drake.gap.estimation.prior import (
    RELATIVE_TO_NONE,
    RELATIVE_TO_RIVAL,
    Range,
    at_end,
    clipped,
    farther,
    range_of,
    tried_first,
)

SIGNED = Range(-3.0, 1.5, 0.2, (-2.0, 1.0))
UNSIGNED = Range(0.1, 1.5, 0.1, (0.2, 1.0))


def test_a_shift_is_named_in_19_of_20_days():
    """A log evidence ratio that is d^2 / 2 in the mean scatters by d; a cause pays 5.5 nats, a rival nothing."""
    assert norm.sf(5.5, 0.5 * RELATIVE_TO_NONE**2, RELATIVE_TO_NONE) == pytest.approx(0.95, abs=1e-4)
    assert norm.sf(0.0, 0.5 * RELATIVE_TO_RIVAL**2, RELATIVE_TO_RIVAL) == pytest.approx(0.95, abs=1e-4)


def test_the_range_is_one_and_a_half_times_the_practical_one():
    car = VehicleParameters()
    friction, drag = range_of("friction_level", car), range_of("aero_drag", car)
    assert (friction.low, friction.high) == pytest.approx([1.5 * end for end in friction.usual])
    assert drag.low == drag.least > 0.0
    assert drag.high == pytest.approx(1.5 * drag.usual[1])
    assert range_of("friction_level", car.replace(tolerance=Tolerance(friction=0.1))) == friction


def test_width_is_of_all_that_is_allowed():
    for r in (SIGNED, UNSIGNED, Range(-0.1, 1.5, 0.2, (0.0, 1.0))):
        q = np.linspace(-4.0, 4.0, 800_001)
        assert r.width == pytest.approx(np.mean(r.allows(q)) * 8.0, abs=1e-4)
        for value in tried_first(r):
            assert r.low <= value <= r.high
    assert tried_first(UNSIGNED) == pytest.approx([0.15, 0.3, 0.525, 0.75, 1.05, 1.5])
    assert tried_first(SIGNED) == pytest.approx([-3.0, -1.95, -1.2, -0.6, 0.3, 0.6, 0.975, 1.5])
    assert tried_first(SIGNED, few=True) == pytest.approx([-1.95, -0.6, 0.3, 0.975])
    assert tried_first(UNSIGNED, few=True) == pytest.approx([0.225, 0.75, 1.5])


def test_a_magnitude_is_clipped_to_the_nearest_gap():
    for value, expected in ((5.0, 1.5), (-5.0, -3.0), (0.05, 0.2), (-0.05, -0.2), (0.0, 0.2), (0.7, 0.7), (-0.2, -0.2)):
        assert clipped(value, SIGNED) == expected
    assert clipped(-1.0, UNSIGNED) == 0.1
    assert clipped(0.1, Range(-1.0, 0.1, 0.3, (-1.0, 0.1))) == -0.3  # no gap above zero
    assert clipped(-0.1, Range(-0.1, 1.0, 0.3, (-0.1, 1.0))) == 0.3


def test_ends_are_within_a_fiftieth_of_the_reach():
    assert at_end(1.48, SIGNED)
    assert at_end(-2.98, SIGNED)
    assert not at_end(1.46, SIGNED)
    assert not at_end(0.1, UNSIGNED)  # the least that is a gap is no end
    assert at_end(1.5, UNSIGNED)


def test_farther_is_twice_as_far_within_what_any_car_has():
    car = VehicleParameters()
    near = range_of("aero_drag", car)
    assert farther("aero_drag", near, car).high == pytest.approx(2.0 * near.high)
    assert farther("aero_drag", near, car).usual == near.usual
    friction = range_of("friction_level", car)
    assert farther("friction_level", friction, car).low == pytest.approx(max(2.0 * friction.low, -0.95))
