"""Whether recordings agree, and what is said where they do not."""

import dataclasses

import numpy as np
import pytest
from scipy.stats import chi2

from drift_drake.cli.identify import row
from drift_drake.gap.estimation.learn_normal import learn_normal
from drift_drake.gap.estimation.prediction_constants import CALIBRATED
from drift_drake.gap.estimation.robust_fit import robust_scales
from drift_drake.gap.estimation.scores import make_day
from drift_drake.gap.estimation.windows import windowed
from drift_drake.gap.evidence.left_out import asked_in_turn
from drift_drake.gap.identification.agreement import (
    Agreement,
    agreement,
    odd_parts,
    sentences,
    stretch_names,
    with_differences,
)
from drift_drake.gap.identification.by_prediction import ALONE, differences
from drift_drake.gap.identification.calibration import Parameter
from drift_drake.gap.identification.report import report_html


def pulls_of(asked):
    """Pulls [K, 1] of an estimate that is the mean of what K recordings ask for."""
    asked = np.array(asked, dtype=float)
    return ((asked - asked.mean()) / len(asked))[:, None]


def test_recordings_that_differ_by_chance_agree() -> None:
    asked = np.random.default_rng(0).normal(size=(200, 6))
    left = np.array([CALIBRATED / 6.0])  # of their mean, as it is stated
    called = [bool(agreement(pulls_of(one), left).disagreed[0]) for one in asked]
    assert np.mean(called) < 0.04


def test_recordings_that_differ_by_more_disagree_however_many_there_are() -> None:
    for count in (4, 12):
        found = agreement(pulls_of([1.0, -1.0] * (count // 2)), np.array([0.01]))
        assert found.disagreed[0]
        assert np.sqrt(found.apart[0]) == pytest.approx(1.0, rel=0.2)  # as one differs from another, not as their mean


@pytest.mark.parametrize("count", [3, 8])
def test_recordings_differ_by_more_than_chance_as_a_test_of_variances_says(count) -> None:
    """At one in a hundred: the sample variance over that of one recording is chi-squared over its degrees."""
    asked = np.random.default_rng(count).normal(size=count)
    variance = np.var(asked, ddof=1)
    limit = chi2.isf(0.01, count - 1) / (count - 1)
    for factor, disagreed in ((0.98, True), (1.02, False)):
        of_one = factor * variance / limit
        left = CALIBRATED * of_one / count  # of the mean
        assert left < variance
        found = agreement(pulls_of(asked), np.array([left]))
        # Leaving one out of K moves the mean by a little less than what it asks for beyond it.
        scale = found.apart[0] / variance
        found = agreement(pulls_of(asked), np.array([left * scale]))
        assert bool(found.disagreed[0]) is disagreed


def test_an_interval_of_what_cannot_be_negative_stays_so_and_others_may_cross_zero() -> None:
    size = Parameter("-", 0.0, 0.3, 0.0, 0.6, 0.15, 5.0, 1.0, "effect")
    signed = dataclasses.replace(size, estimate=0.1, low=-0.2, high=0.4)
    found = Agreement(np.full(2, 0.2**2), np.array([True, True]), np.array([0, 0]))
    wider, _ = with_differences({"one": size, "other": signed}, found, ["monday"], np.ones(2))
    more = 1.96 * (0.25 - 0.15)  # a deviation of 0.15 and one of 0.2 are 0.25 together
    assert wider["one"].deviation == pytest.approx(0.25)
    assert (wider["one"].low, wider["one"].high) == pytest.approx((0.0, 0.6 + more))
    assert (wider["other"].low, wider["other"].high) == pytest.approx((-0.2 - more, 0.4 + more))
    capped = dataclasses.replace(signed, prior=0.2)
    wider, _ = with_differences({"one": size, "other": capped}, found, ["monday"], np.ones(2))
    assert wider["other"].deviation == 0.2  # no more than was unknown before


def test_the_recording_that_pulls_the_most_is_named() -> None:
    assert agreement(pulls_of([0.0, 0.1, 5.0, -0.1]), np.array([0.01])).furthest[0] == 2


def test_one_recording_disagrees_with_none() -> None:
    assert not agreement(np.zeros((1, 2)), np.ones(2)).disagreed.any()


def test_estimates_that_recordings_disagree_about_are_named_with_the_recording() -> None:
    apart = {"friction": "laps", "drag": "ramp", "mass": "laps"}
    first, second, odd = sentences(apart, {"circles": "steering_offset"})
    assert first.startswith("the recordings ask for different values of friction, mass, laps the most: not identified")
    assert second.startswith("the recordings ask for different values of drag, ramp the most: not identified")
    assert odd.startswith("circles has a gap relative to the rest of the baseline, most like steering_offset")
    assert "leave it out" in odd


def test_one_recording_is_said_to_be_one() -> None:
    assert differences(1, {}, {}) == [ALONE]
    assert differences(2, {}, {}) == []


def test_an_interval_is_as_wide_as_recordings_differ_and_the_parameter_not_identified(identified) -> None:
    c = identified.calibration
    parameters = {name: c.parameters[name] for name in ("mass", "friction", "steering_lag")}
    sure = parameters["friction"]
    found = Agreement(np.full(3, (5.0 * sure.deviation) ** 2), np.array([True, True, False]), np.array([0, 1, 0]))
    wider, disagreed = with_differences(parameters, found, ["monday", "tuesday"], np.ones(3))
    assert disagreed == {"friction": "tuesday"}  # the mass is known
    assert wider["friction"].deviation == pytest.approx(np.sqrt(26.0) * sure.deviation)
    assert wider["friction"].low < sure.low < sure.high < wider["friction"].high
    assert wider["steering_lag"] == parameters["steering_lag"]
    assert "friction" in c.identified
    apart = dataclasses.replace(c, disagreed=disagreed)
    assert "friction" not in apart.identified
    assert "recordings disagree about 1" in apart.sentence()
    assert "recordings disagree" in row(wider["friction"], True)
    html = report_html(dataclasses.replace(identified, calibration=apart))
    assert "the recordings ask for different values, tuesday the most" in html


def asked_of(other_car, effect: str = "", size: float = 0.0, runs: int = 4):
    """The day of calibration and what each recording says, left out; an effect [units] in the third of them."""
    n, car = other_car.normal, other_car.found
    windows = [windowed(run) for run in other_car.runs[:runs]]
    day = make_day(windows, car.vehicle.constants(), car.effects, n.names, n.units)
    if effect:
        column = day.jacobian[..., n.names.index(effect)].reshape(day.errors.shape)
        off = size * column * robust_scales(day.errors) * (day.run == 2)[:, None, None]
        day = dataclasses.replace(day, errors=day.errors - off)
    prior = np.ones(len(n.names))
    learnt = learn_normal(day, n.names, n.units, prior, n.least_deviations, 0.5 * prior)
    return day, asked_in_turn(learnt, car.vehicle)


def test_a_recording_with_a_gap_is_odd_and_named_and_none_is_where_nothing_changed(other_car) -> None:
    assert odd_parts(*asked_of(other_car)) == {}
    day, asked = asked_of(other_car, "steering_offset", 4.0)
    assert odd_parts(day, asked) == {day.runs[2].recording: "steering_offset"}


def test_stretches_of_the_only_recording_are_compared(other_car) -> None:
    day, asked = asked_of(other_car, runs=1)
    assert len(stretch_names(day)) == max(len(asked), 1)
    assert odd_parts(day, asked) == {}


def test_stretches_are_named_by_their_run_and_time(other_car) -> None:
    runs = [windowed(run) for run in other_car.runs[:2]]
    long = dataclasses.replace(runs[0], starts=np.arange(0, round(36.0 / runs[0].period), 20))
    n, car = other_car.normal, other_car.found
    day = make_day(runs, car.vehicle.constants(), car.effects, n.names, n.units)
    counts = [len(long.starts), len(runs[1].starts)]
    day = dataclasses.replace(day, runs=[long, runs[1]], run=np.repeat([0, 1], counts))
    names = stretch_names(day)
    assert [name.split(" from ")[-1] for name in names] == ["0 to 12 s", "12 to 24 s", "24 to 36 s", runs[1].name]
