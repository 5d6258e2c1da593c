"""A search for causes with a simulator whose predictions take long: what it is asked for, and that nothing is lost."""

import dataclasses

import numpy as np
import pytest

from drift_drake.gap.diagnosis.calibrated.one_stretch import without
from drift_drake.gap.estimation import scores
from drift_drake.gap.estimation.prior import FEW_SIGNED, SIGNED_GRID
from drift_drake.gap.estimation.scores import Predictions, to_first_order
from drift_drake.gap.estimation.unknowns import added
from drift_drake.gap.estimation.windows import errors
from drift_drake.gap.evidence import search as searching
from drift_drake.gap.evidence.hypotheses import effects_of


@pytest.fixture
def asked_of(monkeypatch):
    """Effects of all cars that predictions are asked of, once they take long."""
    asked, errors_of_all = [], scores.errors_of_all

    def noted(runs, cars, threads=2):
        asked.extend(effects for _, effects in cars)
        return errors_of_all(runs, cars, threads)

    monkeypatch.setattr(scores, "errors_of_all", noted)
    monkeypatch.setattr(scores, "is_slow", lambda _: True)
    monkeypatch.setattr(searching, "is_slow", lambda _: True)
    return asked


def test_it_is_asked_for_no_car_twice_and_for_few_without_some_seconds(late_day, asked_of):
    day = dataclasses.replace(late_day.search.day, predictions=Predictions())
    search = late_day.search.on(day)
    best = search.singles(lambda _: None)[0]
    assert best.names == ("steering_delay",)
    assert len(asked_of) == len(set(asked_of))
    before = len(asked_of)
    rest = without(search, np.arange(day.blocks) == 1)
    assert rest.singles(lambda _: None)[0].names == ("steering_delay",)
    assert len(asked_of) - before < 0.5 * before  # magnitudes that are refined, but for those
    assert len(asked_of) == len(set(asked_of))


def test_what_is_known_of_all_windows_is_known_of_some(late_day, asked_of):
    day = dataclasses.replace(late_day.search.day, predictions=Predictions())
    effects = {"mass_error": 0.1}
    whole = day.errors_with(effects)
    some = day.kept(np.arange(len(day.errors)) % 3 == 0)
    fewer = some.kept(np.arange(len(some.errors)) % 2 == 0)
    for part in (some, fewer):
        np.testing.assert_array_equal(part.errors_with(effects),
                                      errors(part.runs, day.constants, added(day.own, effects)))  # fmt: skip
    np.testing.assert_array_equal(day.errors_with(effects), whole)
    assert len(asked_of) == 1


@pytest.mark.usefixtures("asked_of")
@pytest.mark.parametrize("bias", [0.04, -0.04])
def test_it_is_asked_first_for_magnitudes_of_the_likelier_sign(other_car, searched, bias):
    search = searched(other_car.day({"gyro_bias": bias}, 3), ["gyro_bias", "steering_delay"])
    asked, by_derivatives = search._first("gyro_bias")
    assert asked == pytest.approx(sorted(q * search.ranges["gyro_bias"].high for q in FEW_SIGNED if q * bias > 0.0))
    assert by_derivatives == {}
    assert all(q > 0.0 for q in search._first("steering_delay")[0])
    best = search.singles(lambda _: None)[0]
    assert best.magnitudes == pytest.approx(bias, rel=0.2)


@pytest.mark.usefixtures("asked_of")
def test_it_is_asked_for_both_signs_where_scores_and_errors_ask_for_different_ones(other_car, searched, monkeypatch):
    """Scores of errors that are clipped may look more normal with the wrong sign."""
    search = searched(other_car.day({"gyro_bias": 0.04}, 3), ["gyro_bias"])
    nats = search.nats
    monkeypatch.setattr(search, "nats", lambda found: -nats(found))
    signs = np.sign(search._first("gyro_bias")[0])
    assert set(signs) == {-1.0, 1.0}


@pytest.mark.parametrize("bias", [0.04, -0.04])
def test_of_two_signs_the_unlikelier_has_scores_by_derivatives_near_the_predicted_ones(other_car, searched, bias):
    search = searched(other_car.day({"gyro_bias": bias}, 3), ["gyro_bias", "steering_delay"])
    asked, by_derivatives = search._first("gyro_bias")
    reach = search.ranges["gyro_bias"].high
    assert sorted([*asked, *by_derivatives]) == pytest.approx([q * reach for q in SIGNED_GRID])
    assert all(q * bias > 0.0 for q in asked)
    at_zero = search.scores({})
    for q, found in by_derivatives.items():
        predicted = search.scores({"gyro_bias": q})
        assert np.linalg.norm(found - predicted) < 0.05 * np.linalg.norm(predicted - at_zero)
    assert search.singles(lambda _: None)[0].magnitudes == pytest.approx(bias, rel=0.2)


def test_derivatives_of_a_change_of_loads_are_those_of_the_stiffnesses_that_follow_it_too(late_day):
    search, day = late_day.search, late_day.search.day
    alone, together = (effects_of(("mass_error",), np.ones(1), follows, day) for follows in (0.0, 1.0))
    assert set(together) > set(alone) == {"mass_error"}
    small = effects_of(("mass_error",), np.array([0.01]), 1.0, day)
    moved = day.errors_with(small) - day.errors
    off, without = (float(np.linalg.norm(0.01 * to_first_order(day, search.normal, unit) - moved))
                    for unit in (together, alone))  # fmt: skip
    assert off < 0.1 * np.linalg.norm(moved)
    assert without > 0.2 * np.linalg.norm(moved)


def test_limits_of_a_none_rest_on_predicted_scores_of_both_signs(plain_day):
    assert plain_day.answer.verdict == "none"
    for curve in plain_day.search.curves:
        assert set(curve.magnitudes) - {0.0} == set(curve.misfits)
