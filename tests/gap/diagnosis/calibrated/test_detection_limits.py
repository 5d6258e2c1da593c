"""What logs can show: limits of scores that are linear in the magnitudes, against their formula."""

from types import SimpleNamespace

import numpy as np
import pytest

from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.car.parameters import VehicleParameters
from drift_drake.gap.diagnosis.calibrated.posterior import (
    DetectionLimit,
    detection_limits,
    distances,
    unless_hidden,
)
from drift_drake.gap.estimation.prior import AGAINST_NONE, REACH, SURE, range_of
from drift_drake.gap.estimation.reduction import Reduction
from drift_drake.gap.evidence.ranking import DayRanked
from drift_drake.gap.evidence.search import Curve

RELATIVE_TO_NONE = SURE + np.sqrt(SURE**2 + 2.0 * AGAINST_NONE)
FINE = 0.002  # relative spacing of the magnitudes that are tried


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

    def limits(self):
        curves = []
        for name, r in self.ranges.items():
            grid = np.linspace(r.low, r.high, 101)
            curves.append(Curve(name, 0.0, list(grid), [self.scores({name: q}) for q in grid]))
        return detection_limits(self, curves)


def test_an_effect_like_no_other_need_only_beat_none():
    limits = Linear({"mass_error": [100.0, 0.0], "torque_lag": [0.0, 60.0]}).limits()
    assert limits["mass_error"].least == pytest.approx(RELATIVE_TO_NONE / 100.0, rel=FINE)
    assert limits["torque_lag"].least == pytest.approx(RELATIVE_TO_NONE / 60.0, rel=FINE)
    assert limits["mass_error"].taken_for == "none"
    assert limits["torque_lag"].unit == "s"


def test_scatter_makes_limits_larger():
    covariance = np.array([[4.0, 0.0], [0.0, 1.0]])
    limits = Linear({"mass_error": [100.0, 0.0], "torque_lag": [0.0, 60.0]}, covariance).limits()
    assert limits["mass_error"].least == pytest.approx(2.0 * RELATIVE_TO_NONE / 100.0, rel=FINE)
    assert limits["torque_lag"].least == pytest.approx(RELATIVE_TO_NONE / 60.0, rel=FINE)


def test_a_scatter_that_is_singular_shows_nothing_in_that_direction():
    """As of a baseline that turns to one side alone: rounding leaves its inverse without a sign."""
    search = Linear({"mass_error": [100.0, 0.0], "torque_lag": [0.0, 60.0]})
    search.scatter.inverse = np.array([[1.0, 0.0], [0.0, -1e-18]])
    limits = search.limits()
    assert limits["mass_error"].least == pytest.approx(RELATIVE_TO_NONE / 100.0, rel=FINE)
    assert limits["torque_lag"].least is None
    search.scatter.inverse = np.array([[1.0, 1.0 + 1e-12], [1.0 + 1e-12, 1.0]])  # no root of its own
    assert all(np.isfinite(limit.least or 0.0) for limit in search.limits().values())


def test_effects_that_look_alike_must_be_distinguished_from_each_other():
    cosine = 0.95
    other = 50.0 * np.array([cosine, np.sqrt(1.0 - cosine**2)])
    limits = Linear({"mass_error": [50.0, 0.0], "yaw_inertia_error": other}).limits()
    assert limits["mass_error"].taken_for == "yaw_inertia_error"
    assert limits["mass_error"].least == pytest.approx(2.0 * SURE / (50.0 * np.sqrt(1.0 - cosine**2)), rel=FINE)


def test_effects_that_look_the_same_cannot_be_named():
    limits = Linear({"mass_error": [50.0, 0.0], "yaw_inertia_error": [-90.0, 0.0]}).limits()
    assert limits["mass_error"].least is None
    assert limits["mass_error"].taken_for == "yaw_inertia_error"
    # A larger yaw inertia than any mass could pass for is named.
    assert 90.0 * limits["yaw_inertia_error"].least == pytest.approx(15.0 + 2.0 * SURE, rel=FINE)


def test_no_limit_is_below_what_counts_as_a_gap_or_beyond_the_reach():
    search = Linear({"mass_error": [1e6, 0.0], "torque_lag": [0.0, 1.0]})
    limits = search.limits()
    assert limits["mass_error"].least == pytest.approx(search.ranges["mass_error"].least, rel=0.01)
    assert REACH * CATALOGUE["torque_lag"].high < RELATIVE_TO_NONE
    assert limits["torque_lag"].least is None


def test_a_rate_limit_is_named_up_to_a_highest_one():
    class Limited(Linear):
        def scores(self, effects):
            limit = effects.get("steering_rate_limit", np.inf)
            return np.array([max(1.0 - limit, 0.0) * 20.0, 0.3])

    limits = Limited({"steering_rate_limit": [1.0, 0.0], "mass_error": [0.0, 1.0]}).limits()
    highest = limits["steering_rate_limit"].least
    assert 20.0 * (1.0 - highest) >= RELATIVE_TO_NONE
    assert 20.0 * (1.0 - highest) == pytest.approx(RELATIVE_TO_NONE, rel=0.01)

    class Slow(Linear):
        def scores(self, _effects):
            return np.zeros(2)

    assert Slow({"steering_rate_limit": [1.0, 0.0]}).limits()["steering_rate_limit"].least is None


def test_an_effect_that_bends_is_judged_where_it_acts():
    """To first order at zero, this lag would be named never; from 0.1 s on it acts."""

    class Bent(Linear):
        def scores(self, effects):
            return np.array([40.0 * max(effects.get("torque_lag", 0.0) - 0.1, 0.0) / 0.1, 0.3])

    limit = Bent({"torque_lag": [0.0, 0.0]}).limits()["torque_lag"]
    assert limit.least == pytest.approx(0.1 + 0.1 * RELATIVE_TO_NONE / 40.0, rel=0.02)


def test_the_larger_of_two_signs_is_the_limit():
    class Lopsided(Linear):
        def scores(self, effects):
            q = effects.get("mass_error", 0.0)
            return np.array([100.0 * q if q > 0.0 else 50.0 * q, 0.3])

    assert Lopsided({"mass_error": [0.0, 0.0]}).limits()["mass_error"].least == pytest.approx(
        RELATIVE_TO_NONE / 50.0, rel=FINE)  # fmt: skip


def test_distances_are_to_the_nearest():
    points, others = np.random.default_rng(0).normal(size=(2, 7, 3))
    by_hand = [min(np.linalg.norm(p - q) for q in others) for p in points]
    np.testing.assert_allclose(distances(points, others), by_hand)


@pytest.mark.parametrize(
    ("names", "verdict"),
    [(("mass_error",), "none"), (("torque_lag",), "effect"), (("mass_error", "torque_lag"), "effect"),
     (("front_stiffness_error",), "effect")],
)  # fmt: skip
def test_what_these_drives_could_not_show_at_any_magnitude_is_no_verdict(names, verdict):
    """A cause that is hard to tell from another one is one: that there is a gap is shown."""
    limits = {
        "mass_error": DetectionLimit("-", None, "none"),
        "torque_lag": DetectionLimit("s", 0.1, "none"),
        "front_stiffness_error": DetectionLimit("-", None, "rear_stiffness_error"),
    }
    none, cause = SimpleNamespace(names=()), SimpleNamespace(names=names)
    said = DayRanked({"none": 0.3, "x": 0.7}, ["x"], "effect", cause, "cause", 0.4)
    removed = Reduction(0.5, 0.4, 0.6, {}, {}, [], [], [])
    found, left = unless_hidden(said, removed, limits, none)
    assert found.verdict == verdict
    assert found.probabilities == said.probabilities
    if verdict == "none":
        assert (found.leading, found.decision, found.something_else, left.estimate) == (none, "undecided", 0.0, 0.0)
    else:
        assert (found, left) == (said, removed)
