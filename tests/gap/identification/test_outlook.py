"""Which changes would be seen after more recordings: limits of scores that are linear in the magnitudes."""

import numpy as np
import pytest

from drift_drake.car.effects.catalogue import CATALOGUE, LIMITS
from drift_drake.car.parameters import VehicleParameters
from drift_drake.gap.estimation.prior import RELATIVE_TO_NONE, RELATIVE_TO_RIVAL
from drift_drake.gap.identification.outlook import gains, limits, never, outlook, sentences, unknown_after


class Two:
    """The baseline of two effects."""

    names = ("mass_error", "gyro_bias")
    units = np.array([0.05, 0.01])


def test_a_limit_is_where_the_shift_is_far_enough_from_none():
    found = limits(np.diag([10.0, 7.5]), np.diag([25.0, 16.0]), Two, VehicleParameters())
    assert found["mass_error"] == pytest.approx(RELATIVE_TO_NONE / 2.0 * 0.05)
    assert found["gyro_bias"] == pytest.approx(RELATIVE_TO_NONE / 1.875 * 0.01)
    least = limits(np.diag([1e4, 1e4]), np.eye(2), Two, VehicleParameters())
    assert least["mass_error"] == CATALOGUE["mass_error"].least_for(VehicleParameters())  # no gap below it


def test_effects_that_look_alike_have_larger_limits_and_the_same_none():
    cosine = 0.9
    information = 2.0 * np.array([[1.0, cosine], [0.0, np.sqrt(1.0 - cosine**2)]])
    found = limits(information, np.eye(2), Two, VehicleParameters())
    apart = RELATIVE_TO_RIVAL / np.sqrt(1.0 - cosine**2)
    assert apart > RELATIVE_TO_NONE
    assert found["gyro_bias"] == pytest.approx(apart / 2.0 * 0.01)
    same = limits(np.array([[10.0, 10.0], [0.0, 0.0]]), np.eye(2), Two, VehicleParameters())
    assert never({name: [q] * 3 for name, q in same.items()}) == ["mass_error", "gyro_bias"]


def test_a_singular_scatter_shows_nothing_in_its_direction():
    found = limits(np.diag([40.0, 0.0]), np.diag([25.0, 1e-30]), Two, VehicleParameters())
    assert found["mass_error"] is not None
    assert found["gyro_bias"] is None


def test_what_is_unknown_shrinks_with_the_recordings_from_the_prior_on():
    prior = np.array([2.0, 1.0])
    unknown = np.diag(
        [4.0 / 5.0, 1.0]
    )  # of the first the logs tell four times what was believed, of the second nothing
    assert np.allclose(unknown_after(unknown, prior, 1.0), unknown)
    assert np.allclose(unknown_after(unknown, prior, 4.0), np.diag([4.0 / 17.0, 1.0]))


def test_more_recordings_bring_lower_limits(other_car):
    from drift_drake.gap.estimation.scores import make_day
    from drift_drake.gap.estimation.windows import windowed

    normal, found = other_car.normal, other_car.found
    runs = [windowed(run, stride=normal.stride) for run in other_car.runs]
    names, steps = normal.names, normal.units
    day = make_day(runs, found.vehicle.constants(), found.effects, names, steps, normal)
    reported = outlook(day, normal, np.full(len(names), 4.0), other_car.guess)
    assert set(reported) == set(names) - LIMITS
    for now, twice, four in reported.values():
        assert four is not None or twice is None
        assert twice is None or now is None or four <= twice * (1.0 + 1e-9) <= now * (1.0 + 2e-9)


def test_what_is_gained_is_said():
    reported = {"mass_error": [0.1, 0.07, 0.05], "gyro_bias": [0.02, 0.0199, 0.019], "cg_shift": [None, 0.1, 0.08],
            "aero_drag": [None, None, None]}  # fmt: skip
    assert gains(reported) == ["cg_shift", "mass_error"]
    (sentence,) = sentences(reported, 4)
    assert sentence.startswith("4 more recordings like these would let a diagnosis of a later log name cg_shift from")
    assert "mass_error from 0.07 on (0.1 now)" in sentence
    assert sentences({"gyro_bias": reported["gyro_bias"]}, 1) == []
    assert never(reported) == ["aero_drag"]
