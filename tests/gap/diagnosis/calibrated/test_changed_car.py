"""Hypotheses judged at the changed car: magnitudes exact for what is put into a log, the right one ahead."""

import dataclasses

import numpy as np
import pytest
from scipy.special import logsumexp
from scipy.stats import multivariate_normal

from drift_drake.gap.diagnosis.calibrated.changed_car import At, changed_car, evidences, judged, stated
from drift_drake.gap.estimation.baseline import Scatter
from drift_drake.gap.estimation.prior import Range
from drift_drake.gap.evidence.hypotheses import Hypothesis

SINGLE = ("steering_offset",)


def change(name, magnitude, additional=None):
    return Hypothesis((name,), np.array([magnitude]), np.eye(1), 0.0, 0.0, additional=additional or {})


@pytest.fixture(scope="module")
def offset_by(other_car, searched):
    """A function: an offset [rad] put into a day's steering commands to the offset that is fitted."""
    day = other_car.day({}, 5)[:2]

    def fitted(q):
        search = searched([dataclasses.replace(run, delta_cmd=run.delta_cmd - q) for run in day], SINGLE)
        return judged(search, [change("steering_offset", 1.04 * q)])[0]

    return fitted


def test_what_is_put_into_the_commands_is_found_as_exactly_where_it_is_large(offset_by):
    # The logs as they are have an offset of their own, in addition to the one put in.
    up, down, small = (offset_by(q) for q in (0.05, -0.05, 0.015))
    own = 0.5 * (up.magnitudes[0] + down.magnitudes[0])
    assert up.magnitudes[0] - own == pytest.approx(0.05, rel=0.01)
    assert small.magnitudes[0] - own == pytest.approx(0.015, abs=5e-4)
    # A steering ratio that is not quite known makes a large offset of the commands less certain, on either side.
    assert up.covariance[0, 0] == pytest.approx(down.covariance[0, 0], rel=0.15)
    assert small.covariance[0, 0] < up.covariance[0, 0]


def test_the_most_likely_magnitude_is_a_fixed_point(late_day):
    at = late_day.ranked.leading
    again = stated(late_day.search, dataclasses.replace(at, magnitudes=0.9 * at.magnitudes))
    deviation = np.sqrt(at.covariance[0, 0])
    assert abs(again.magnitudes[0] - at.magnitudes[0]) < 0.2 * deviation
    assert np.sqrt(again.covariance[0, 0]) == pytest.approx(deviation, rel=0.1)


def test_what_is_additional_to_a_cause_is_fitted_too(late_day):
    (alone,) = judged(late_day.search, [change("steering_delay", 0.08)])
    (additional,) = judged(late_day.search, [change("steering_delay", 0.08, {"mass_error": 0.05})])
    assert set(additional.additional) == {"mass_error"}
    assert additional.additional["mass_error"] != 0.05
    assert additional.covariance.shape == (1, 1)
    assert additional.covariance[0, 0] == pytest.approx(alone.covariance[0, 0], rel=0.3)
    assert additional.magnitudes[0] == pytest.approx(alone.magnitudes[0], rel=0.1)


def test_what_the_right_change_leaves_is_normal_and_what_a_wrong_one_leaves_is_not(late_day):
    right, wrong = judged(late_day.search, [change("rear_stiffness_error", -0.3), change("steering_delay", 0.07)])
    assert right.names == ("steering_delay",)
    assert right.nats < 0.5 * len(late_day.search.normal.expected)  # half a chi-squared of as many scores, in the mean
    assert wrong.nats > right.nats + 10.0
    # How far behind a wrong one is shrinks where the shape of a change is not exactly known.
    main = late_day.search.scatter.main
    assert 0.0 < np.asarray(right.among)[main] - np.asarray(wrong.among)[()] < right.log_evidence - wrong.log_evidence


def test_evidence_at_a_factor_is_that_of_the_most_likely_magnitude_there():
    rng = np.random.default_rng(0)
    s, slopes = rng.normal(size=6), rng.normal(size=(6, 1))
    covariances = np.array([np.eye(6), 9.0 * np.eye(6)])
    scatter = Scatter(np.zeros(6), covariances, np.eye(6))
    r = Range(-10.0, 10.0, 0.0, (-10.0, 10.0))
    h, q = change("mass_error", 0.3), np.array([0.3])
    at = At(q, 0.0, np.eye(1), np.zeros(1), s, slopes, scatter)
    found = evidences(at, scatter, h, [r])
    # By integration over all magnitudes, of normal distributions.
    grid = np.linspace(-10.0, 10.0, 20001)
    x = s + (grid[:, None] - 0.3) * slopes[:, 0]
    expected = [
        logsumexp(multivariate_normal(np.zeros(6), c).logpdf(x)) + np.log(grid[1] - grid[0]) for c in covariances
    ]
    assert found[1] - found[0] == pytest.approx(expected[1] - expected[0], abs=1e-3)


def test_the_search_at_the_changed_car_starts_from_it(late_day):
    search, h = late_day.search, change("steering_delay", 0.08)
    there = changed_car(search, h)
    np.testing.assert_allclose(there.day.errors, search.day.errors_with({"steering_delay": 0.08}))
    np.testing.assert_allclose(there.day.errors_with({"steering_delay": -0.08}), search.day.errors, atol=1e-9)
    assert there.ranges.keys() == search.ranges.keys()


def test_a_car_near_a_judged_one_keeps_its_derivatives_with_errors_of_its_own(late_day):
    search = late_day.search.on(late_day.search.day)
    h = dataclasses.replace(change("steering_delay", 0.08), covariance=np.array([[0.01**2]]))
    first, near, far, anew = (
        changed_car(search, h, np.array([q]), anew).day for q, anew in
        ((0.08, False), (0.084, False), (0.087, False), (0.08, True))
    )  # fmt: skip
    assert near.jacobian is first.jacobian
    np.testing.assert_array_equal(near.errors, search.day.errors_with({"steering_delay": 0.084}))
    np.testing.assert_allclose(near.errors_with({"steering_delay": -0.084}), search.day.errors, atol=1e-9)
    assert far.jacobian is not first.jacobian
    assert anew.jacobian is not first.jacobian
    np.testing.assert_array_equal(anew.jacobian, first.jacobian)


def test_a_hypothesis_that_the_logs_do_not_show_is_left_out(other_car, searched):
    # A limit of the steering's rate that no command comes near does nothing to any prediction.
    search = searched(other_car.runs[1:], ("steering_rate_limit",))
    search.ranges["steering_rate_limit"] = dataclasses.replace(search.ranges["steering_rate_limit"], high=1e3)
    assert judged(search, [change("steering_rate_limit", 900.0)]) == []


def test_what_is_stated_trusts_contrasts_of_scores_less(late_day):
    (at,) = judged(late_day.search, [change("steering_delay", 0.08)])
    said = stated(late_day.search, at)
    assert said.covariance[0, 0] > at.covariance[0, 0]
    assert (said.nats, said.log_evidence) == (at.nats, at.log_evidence)
    assert abs(said.magnitudes[0] - 0.08) < 2.0 * np.sqrt(said.covariance[0, 0])


def test_what_contrasts_alone_show_is_stated_with_them(late_day, monkeypatch):
    """Were contrasts worth nothing, the interval would hold zero, and a worse cause would be named in its place."""
    at = late_day.ranked.leading
    monkeypatch.setattr("drift_drake.gap.diagnosis.calibrated.changed_car.APART", 1e6)
    assert stated(late_day.search, at) is at
