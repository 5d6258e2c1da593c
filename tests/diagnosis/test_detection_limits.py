"""What logs can show: limits of scores that are linear in the magnitudes, against their formula."""

from types import SimpleNamespace

import numpy as np
import pytest

from drift_drake.diagnosis.day_hypotheses import REACH, range_of
from drift_drake.diagnosis.detection_limits import AGAINST_NONE, RATE_LIMIT, SURE, detection_limits
from drift_drake.vehicle.catalogue import CATALOGUE
from drift_drake.vehicle.parameters import VehicleParameters

BESIDE_NONE = SURE + np.sqrt(SURE**2 + 2.0 * AGAINST_NONE)


class Linear:
    """A search whose scores are linear in every magnitude; slopes by effect."""

    def __init__(self, slopes, covariance=None):
        self.slopes = {name: np.array(slope, dtype=float) for name, slope in slopes.items()}
        self.vehicle = VehicleParameters()
        self.ranges = {name: range_of(name, self.vehicle) for name in slopes}
        size = len(next(iter(self.slopes.values())))
        self.scatter = SimpleNamespace(inverse=np.linalg.inv(np.eye(size) if covariance is None else covariance))

    def scores(self, effects):
        offset = 0.3 * np.ones(len(self.scatter.inverse))  # of the day itself, which no limit may depend on
        return offset + sum((q * self.slopes[name] for name, q in effects.items()), np.zeros(len(offset)))

    def nats(self, scores):
        return 0.5 * np.einsum("...i,ij,...j->...", scores, self.scatter.inverse, scores)


def test_an_effect_like_no_other_need_only_beat_none():
    limits = detection_limits(Linear({"mass_error": [100.0, 0.0], "torque_lag": [0.0, 60.0]}))
    assert limits["mass_error"].least == pytest.approx(BESIDE_NONE / 100.0)
    assert limits["torque_lag"].least == pytest.approx(BESIDE_NONE / 60.0)
    assert limits["mass_error"].taken_for == "none"
    assert limits["torque_lag"].unit == "s"


def test_scatter_makes_limits_larger():
    covariance = np.array([[4.0, 0.0], [0.0, 1.0]])
    limits = detection_limits(Linear({"mass_error": [100.0, 0.0], "torque_lag": [0.0, 60.0]}, covariance))
    assert limits["mass_error"].least == pytest.approx(2.0 * BESIDE_NONE / 100.0)
    assert limits["torque_lag"].least == pytest.approx(BESIDE_NONE / 60.0)


def test_effects_that_look_alike_must_be_told_from_each_other():
    cosine = 0.95
    other = 200.0 * np.array([cosine, np.sqrt(1.0 - cosine**2)])
    limits = detection_limits(Linear({"mass_error": [200.0, 0.0], "yaw_inertia_error": other}))
    assert limits["mass_error"].taken_for == "yaw_inertia_error"
    assert limits["mass_error"].least == pytest.approx(2.0 * SURE / (200.0 * np.sqrt(1.0 - cosine**2)))


def test_effects_that_look_the_same_cannot_be_named():
    limits = detection_limits(Linear({"mass_error": [50.0, 0.0], "yaw_inertia_error": [-90.0, 0.0]}))
    assert limits["mass_error"].least is None
    assert limits["mass_error"].taken_for == "yaw_inertia_error"
    assert limits["yaw_inertia_error"].taken_for == "mass_error"


def test_no_limit_is_below_what_counts_as_a_gap_or_beyond_the_reach():
    search = Linear({"mass_error": [1e6, 0.0], "torque_lag": [0.0, 1.0]})
    limits = detection_limits(search)
    assert limits["mass_error"].least == pytest.approx(search.ranges["mass_error"].least)
    assert REACH * CATALOGUE["torque_lag"].high < BESIDE_NONE
    assert limits["torque_lag"].least is None


def test_a_rate_limit_is_named_up_to_a_highest_one():
    class Limited(Linear):
        def scores(self, effects):
            limit = effects.get(RATE_LIMIT, np.inf)
            return np.array([max(1.0 - limit, 0.0) * 20.0, 0.3])

    limits = detection_limits(Limited({RATE_LIMIT: [1.0, 0.0], "mass_error": [0.0, 1.0]}))
    highest = limits[RATE_LIMIT].least
    assert 20.0 * (1.0 - highest) >= BESIDE_NONE
    r = range_of(RATE_LIMIT, VehicleParameters())
    assert 20.0 * (1.0 - (highest + (r.high - r.least) / 11)) < BESIDE_NONE  # the next one that is tried

    class Slow(Linear):
        def scores(self, _effects):
            return np.zeros(2)

    assert detection_limits(Slow({RATE_LIMIT: [1.0, 0.0]}))[RATE_LIMIT].least is None
