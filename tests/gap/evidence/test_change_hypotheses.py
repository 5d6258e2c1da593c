"""Hypotheses of a change: ranges, curves of scores, evidence, and their probabilities."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.vehicle_file import effect_range
from drift_drake.gap.diagnosis.calibrated.posterior import (
    at_bound,
    deviation,
    interval,
    tells_from_zero,
)
from drift_drake.gap.estimation.prior import REACH, Range, at_end, clipped, farther, range_of
from drift_drake.gap.evidence.constants import ELSE, OF_SCATTER, PRIORS, STANDS_FOR
from drift_drake.gap.evidence.hypotheses import Hypothesis, as_change, concluded, effects_of
from drift_drake.gap.evidence.left_over import LeftOver
from drift_drake.gap.evidence.ranking import halfway, prior, ranked, shared_out

CAR = VehicleParameters()
NONE = Hypothesis((), np.zeros(0), np.zeros((0, 0)), 50.0, -50.0, scores=20)


def single(name, magnitude, sigma, nats=1.0, gain=None):
    """gain: log evidence of something else being there too."""
    left = None if gain is None else LeftOver(gain, None)
    return Hypothesis((name,), np.array([magnitude]), np.array([[sigma**2]]), nats, -nats, left_over=left)


@pytest.mark.parametrize("name", CATALOGUE)
def test_a_range_holds_the_practical_one_and_leaves_out_what_is_no_gap(name):
    low, high = CATALOGUE[name].range_for(CAR)
    r = range_of(name, CAR)
    assert r.high == pytest.approx(REACH * high)
    assert 0.0 < r.least < max(abs(low), high)
    assert r.low == pytest.approx(REACH * low if low < 0.0 else r.least)


def test_clipping_keeps_within_bounds_and_away_from_no_gap():
    r = Range(-0.5, 0.3, 0.1, (-0.5, 0.3))
    assert [clipped(q, r) for q in (-0.9, 0.9, 0.2, 0.02, -0.02, 0.0)] == [-0.5, 0.3, 0.2, 0.1, -0.1, 0.1]


def test_what_loads_bring_along_adds_to_a_magnitude_of_the_pair():
    day = SimpleNamespace(constants=CAR.constants())
    names, q = ("mass_error", "rear_stiffness_error"), np.array([0.1, -0.3])
    assert effects_of(names, q, False, day) == {"mass_error": 0.1, "rear_stiffness_error": -0.3}
    together = effects_of(names, q, True, day)
    assert together == pytest.approx({"mass_error": 0.1, "front_stiffness_error": 0.1, "rear_stiffness_error": -0.2})


def test_a_range_grows_as_far_as_any_vehicles_effect_goes():
    r = range_of("friction_level", CAR)
    wider = farther("friction_level", r, CAR)
    assert wider.low == effect_range("friction_level", CAR)[0] == -0.95
    assert wider.high == pytest.approx(2.0 * r.high)
    assert (wider.least, wider.usual) == (r.least, r.usual)
    lag = range_of("steering_lag", CAR)
    assert farther("steering_lag", lag, CAR).low == lag.low
    assert at_end(r.high, r)
    assert at_end(0.999 * r.low, r)
    assert not at_end(0.9 * r.low, r)
    assert not at_end(lag.low, lag)


def test_evidence_fades_slowly_beyond_the_practical_range():
    r = Range(-1.0, 1.0, 0.02, (-0.2, 0.2))
    usual, beyond, far = (concluded(("mass_error",), np.array([q]), np.array([[1e-4]]), 0.0, [r], 0.0).log_evidence
                          for q in (0.2, 0.3, 0.6))  # fmt: skip
    assert usual > beyond > far > usual - 10.0


def test_evidence_pays_for_width_and_is_never_above_the_fit():
    r = Range(-0.2, 0.3, 0.02, (-0.2, 0.3))
    sharp, blunt = (concluded(("mass_error",), np.array([0.1]), np.array([[s**2]]), 2.0, [r], False)
                    for s in (0.001, 0.01))  # fmt: skip
    width = 0.5 - 2.0 * 0.02
    assert sharp.log_evidence == pytest.approx(-2.0 + np.log(np.sqrt(2.0 * np.pi) * 0.001 / width))
    assert blunt.log_evidence - sharp.log_evidence == pytest.approx(np.log(10.0))
    flat = concluded(("mass_error",), np.array([0.1]), np.array([[9.0]]), 2.0, [r], False)
    assert flat.log_evidence == -2.0


def test_probabilities_sum_to_one_and_name_what_fits():
    found = ranked([NONE, single("mass_error", 0.1, 0.01), single("aero_drag", 1.0, 0.1, nats=30.0)], 28, PRIORS)
    assert sum(found.probabilities.values()) == pytest.approx(1.0)
    assert found.verdict == "effect"
    assert found.leading.names == ("mass_error",)
    assert found.ambiguity == ["mass_error"]
    assert list(found.probabilities.values()) == sorted(found.probabilities.values(), reverse=True)


def test_a_temperature_makes_evidence_less_certain_and_leaves_priors():
    hypotheses = [NONE, single("mass_error", 0.1, 0.01, nats=40.0), single("gyro_bias", 0.02, 0.001, nats=43.0)]
    found = [ranked(hypotheses, 28, dataclasses.replace(PRIORS, temperature=t)).probabilities for t in (1.0, 1.5)]
    odds = [np.log(p["mass_error"] / p["gyro_bias"]) for p in found]
    priors = np.log(CATALOGUE["mass_error"].daily / CATALOGUE["gyro_bias"].daily)
    assert odds[0] == pytest.approx(3.0 + priors)
    assert odds[1] == pytest.approx(3.0 / 1.5 + priors)


def test_nothing_is_named_where_none_fits_as_well():
    calm = dataclasses.replace(NONE, nats=3.0, log_evidence=-3.0)
    found = ranked([calm, single("mass_error", 0.1, 0.01, nats=2.5)], 28, PRIORS)
    assert found.verdict == "none"
    assert found.leading.names == ()


def test_a_gap_that_the_best_hypothesis_leaves_is_unknown():
    gap = dataclasses.replace(NONE, nats=3000.0, log_evidence=-3000.0, left_over=LeftOver(2900.0, None))
    found = ranked([gap, single("mass_error", 0.1, 0.01, nats=1700.0, gain=1600.0)], 28, PRIORS)
    assert found.verdict == "unknown"
    assert found.leading.names == ("mass_error",)  # the nearest known
    assert sum(found.probabilities.values()) == pytest.approx(1.0)


def test_a_cause_that_explains_half_of_a_gap_is_a_cause_and_something_else():
    gap = dataclasses.replace(NONE, nats=300.0, log_evidence=-300.0, left_over=LeftOver(150.0, None))
    found = ranked([gap, single("mass_error", 0.1, 0.01, nats=60.0, gain=20.0)], 28, PRIORS)
    assert (found.verdict, found.decision) == ("effect", "cause")
    assert found.something_else > 0.99
    assert found.probabilities["mass_error"] > 0.99  # with something else or not
    assert "mass_error+unknown" not in found.probabilities
    # The same cause is alone where what is left over is worth nothing.
    found = ranked([gap, single("mass_error", 0.1, 0.01, nats=60.0, gain=-3.0)], 28, PRIORS)
    assert found.something_else == 0.0
    odds = found.probabilities["mass_error+unknown"] / found.probabilities["mass_error"]
    assert np.log(odds) == pytest.approx(np.log(ELSE) - 3.0 / PRIORS.temperature)


def test_a_cause_that_explains_less_than_half_of_a_gap_is_unknown():
    gap = dataclasses.replace(NONE, nats=300.0, log_evidence=-300.0, left_over=LeftOver(140.0, None))
    found = ranked([gap, single("mass_error", 0.1, 0.01, nats=250.0, gain=150.0)], 28, PRIORS)
    assert found.verdict == "unknown"
    assert found.leading.names == ("mass_error",)
    assert found.something_else == 0.0


def test_rivals_that_each_leave_something_over_say_so_together():
    gap = dataclasses.replace(NONE, nats=300.0, log_evidence=-300.0, left_over=LeftOver(0.0, None))
    ratio = single("steering_ratio_error", 0.1, 0.01, nats=60.0, gain=-10.0)
    stiffness = single("front_stiffness_error", 0.2, 0.02, nats=60.0, gain=-0.5)
    found = ranked([gap, ratio, stiffness], 28, PRIORS)
    weight = [CATALOGUE[h.names[0]].daily for h in (ratio, stiffness)]
    more = [w * ELSE * np.exp(gain / PRIORS.temperature) for w, gain in zip(weight, (-10.0, -0.5), strict=True)]
    assert (found.verdict, found.leading.names) == ("effect", ("front_stiffness_error",))
    assert found.something_else == pytest.approx(sum(more) / (sum(more) + sum(weight)), rel=0.01)
    assert "front_stiffness_error+unknown" not in found.probabilities
    # What explains less than half of the gap is no cause with something else: what each leaves over is unknown.
    far = [dataclasses.replace(h, nats=220.0, log_evidence=h.log_evidence - 160.0) for h in (ratio, stiffness)]
    assert ranked([gap, *far], 28, PRIORS).probabilities["unknown"] > 0.3
    # Where there is no gap nothing is said of it.
    calm = dataclasses.replace(NONE, nats=3.0, log_evidence=-3.0, left_over=LeftOver(0.0, None))
    found = ranked([calm, single("mass_error", 0.1, 0.01, nats=2.5, gain=0.0)], 28, PRIORS)
    assert (found.verdict, found.something_else) == ("none", 0.0)
    assert "mass_error+unknown" in found.probabilities


def test_rivals_leave_the_cause_open():
    two = [single("mass_error", 0.1, 0.01, nats=1.0), single("torque_gain_error", 0.1, 0.01, nats=1.4)]
    assert ranked([NONE, *two], 28, PRIORS).decision == "cause_open"
    assert ranked([NONE, two[0]], 28, PRIORS).decision == "cause"


def test_which_cause_it_is_is_less_certain_than_that_there_is_one():
    two = [single("mass_error", 0.1, 0.01, nats=31.0, gain=-3.0), single("torque_gain_error", 0.1, 0.01, nats=36.0)]
    alike = [dataclasses.replace(h, among=-12.0 - i) for i, h in enumerate(two)]
    sure, unsure = (ranked([NONE, *some], 28, PRIORS) for some in (two, alike))
    assert (sure.decision, unsure.decision) == ("cause", "cause_open")
    for name in ("none", "mass_error+unknown"):
        assert unsure.probabilities[name] == pytest.approx(sure.probabilities[name])
    odds = unsure.probabilities["mass_error"] / unsure.probabilities["torque_gain_error"]
    priors = np.log(CATALOGUE["mass_error"].daily / CATALOGUE["torque_gain_error"].daily)
    assert np.log(odds) == pytest.approx(1.0 / PRIORS.temperature + priors)


def test_a_cause_with_an_effect_of_the_build_shares_too():
    gap = dataclasses.replace(NONE, nats=133.0, log_evidence=-133.0)
    torque = single("torque_gain_error", -0.13, 0.01, nats=54.0)
    mass = single("mass_error", 0.15, 0.01, nats=65.0)
    joint = as_change(pair(("mass_error", "tyre_thermal_fade"), [0.18, 0.1], -44.0))
    apart = ranked([gap, torque, mass, joint], 28, PRIORS)
    assert apart.leading is torque
    assert apart.decision == "cause"
    judged = [dataclasses.replace(h, among=q) for h, q in ((torque, -22.3), (mass, -21.6), (joint, -17.0))]
    shared = ranked([gap, *judged], 28, PRIORS)
    assert shared.leading is judged[2]
    assert shared.decision == "cause_open"


def test_what_causes_hold_together_stays_theirs():
    values = {"none": -9.0, "a": -2.0, "b": -7.0, "c": -5.0}
    shared = values | shared_out(values, {"a": 1.0, "b": 0.0})
    assert np.logaddexp(shared["a"], shared["b"]) == pytest.approx(np.logaddexp(-2.0, -7.0))
    assert shared["a"] - shared["b"] == pytest.approx(1.0)
    assert (shared["none"], shared["c"]) == (-9.0, -5.0)
    assert shared_out(values, {}) == {}


def test_fewer_false_alarms_are_more_often_undecided():
    calm = dataclasses.replace(NONE, nats=6.0, log_evidence=-6.0)
    said = [ranked([calm, single("mass_error", 0.1, 0.01, nats=1.0)], 28, PRIORS, false_alarms=rate)
            for rate in (0.001, 0.2)]  # fmt: skip
    assert said[0].probabilities == said[1].probabilities
    assert 0.03 < said[0].probabilities["none"] < 0.7
    assert (said[0].verdict, said[0].decision) == ("none", "undecided")
    assert said[1].verdict == "effect"


def test_an_interval_holds_what_the_magnitude_stands_for():
    h = single("mass_error", 0.1, 0.001)
    assert deviation(h, 0) == pytest.approx(np.hypot(OF_SCATTER * 0.001, STANDS_FOR["motion"] * 0.1))
    m = interval(h, 0)
    assert m.high - m.estimate == pytest.approx(m.estimate - m.low) == pytest.approx(1.96 * deviation(h, 0))
    assert interval(single("aero_drag", 0.5, 0.6), 0).low == 0.0  # an unsigned one


@pytest.mark.parametrize(("sigma", "tells"), [(0.04, True), (0.06, False)])
def test_an_interval_that_holds_zero_is_no_cause(sigma, tells):
    assert tells_from_zero(single("mass_error", 0.1, sigma)) == tells


@pytest.mark.parametrize(("magnitude", "bound"), [(0.3, True), (-0.18, True), (0.2, False)])
def test_a_magnitude_at_an_end_of_its_range_is_a_bound(magnitude, bound):
    r = range_of("mass_error", CAR)
    assert at_bound(single("mass_error", magnitude, 0.01), {"mass_error": r}) == (["mass_error"] if bound else [])


def test_a_tolerance_wider_than_one_side_of_a_range_leaves_the_other():
    r = Range(-0.525, 0.3, 0.42, (-0.35, 0.2))
    assert r.width == pytest.approx(0.105)
    assert clipped(0.1, r) == pytest.approx(-0.42)
    assert clipped(0.9, r) == pytest.approx(-0.42)
    h = concluded(("friction_level",), np.array([-0.45]), np.array([[0.01]]), 3.0, [r], False)
    assert np.isfinite(h.log_evidence)
    assert r.width == pytest.approx(dataclasses.replace(r, low=-0.3, high=0.525).width)


def test_a_gap_that_a_cars_own_equations_may_lack_is_no_gap_where_its_baseline_shows_as_much():
    gap = dataclasses.replace(NONE, nats=12.0, log_evidence=-12.0, by_factor=np.array([0.0, 9.0]),
                              left_over=LeftOver(np.array([9.0, 1.0]), None))  # fmt: skip
    cause = dataclasses.replace(single("mass_error", 0.1, 0.01, nats=3.0), by_factor=np.array([0.0, 1.0]))
    exact, lacking = (ranked([gap, cause], 28, PRIORS, factors=np.log([p, 1.0 - p])) for p in (0.999, 0.1))
    assert exact.verdict != "none"
    assert lacking.verdict == "none"
    # By hand: the evidence is the mean of both factors', each to the power of one over the temperature.
    value = np.log(0.1 * np.exp(-12.0 / PRIORS.temperature) + 0.9 * np.exp(-3.0 / PRIORS.temperature))
    other = np.log(0.1 * np.exp(cause.log_evidence / PRIORS.temperature)
                   + 0.9 * np.exp((cause.log_evidence + 1.0) / PRIORS.temperature))  # fmt: skip
    log_odds = np.log(lacking.probabilities["none"] / lacking.probabilities["mass_error"])
    assert log_odds == pytest.approx(value + prior(gap, 28, PRIORS) - other - prior(cause, 28, PRIORS), abs=1e-9)


def pair(names, magnitudes, log_evidence):
    return Hypothesis(names, np.array(magnitudes), np.diag([1e-4, 4e-4]), -log_evidence, log_evidence)


def test_what_belongs_to_a_cars_build_does_not_change_by_the_day():
    h = as_change(pair(("steering_offset", "tyre_relaxation"), [0.02, 0.3], -5.0))
    assert h.names == ("steering_offset",)
    assert h.additional == {"tyre_relaxation": 0.3}
    np.testing.assert_array_equal(h.covariance, [[1e-4]])
    day = SimpleNamespace(constants=CAR.constants())
    assert h.effects(day) == {"steering_offset": 0.02, "tyre_relaxation": 0.3}
    assert h.effects(day, np.array([0.03])) == {"steering_offset": 0.03, "tyre_relaxation": 0.3}
    for names in (("friction_level", "steering_offset"), ("lateral_load_transfer", "tyre_relaxation")):
        both = pair(names, [-0.2, 0.02], -5.0)
        assert as_change(both) is both


def test_the_better_of_two_of_a_name_is_believed_and_pays_for_the_additional_one():
    alone = single("steering_offset", 0.02, 0.001, nats=35.0)
    joint = as_change(pair(("steering_offset", "tyre_relaxation"), [0.018, 0.3], -5.0))
    found = ranked([NONE, alone, joint], 28, PRIORS)
    assert found.leading is joint
    assert found.verdict == "effect"
    near = as_change(pair(("steering_offset", "tyre_relaxation"), [0.018, 0.3], -34.0))
    assert ranked([NONE, alone, near], 28, PRIORS).leading is alone


def test_what_few_held_out_blocks_rule_out_keeps_half_of_its_probability():
    lag, delay = single("steering_lag", 0.1, 0.01, nats=1.0), single("steering_delay", 0.08, 0.01, nats=1.4)
    every, kept = (ranked(some, 30, PRIORS) for some in ([NONE, lag, delay], [NONE, delay]))
    assert kept.decision == "cause"
    found = halfway(kept, every)
    assert found.leading is delay
    assert found.decision == "cause_open"
    assert sum(found.probabilities.values()) == pytest.approx(1.0)
    assert found.probabilities["steering_lag"] == pytest.approx(0.5 * every.probabilities["steering_lag"])
    assert next(iter(found.probabilities)) == "steering_delay"
    assert found.ambiguity == ["steering_delay", "steering_lag"]
    far = single("gyro_bias", 0.1, 0.01, nats=40.0)
    assert halfway(kept, ranked([NONE, far, delay], 30, PRIORS)).decision == "cause"
