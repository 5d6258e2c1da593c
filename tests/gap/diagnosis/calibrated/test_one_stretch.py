"""A few seconds that hold a gap: they are found, left out and reported, and the cause of the rest is named."""

import dataclasses
import re

import numpy as np
import pytest

from drift_drake.gap.diagnosis.calibrated.one_stretch import (
    MOST,
    odd_blocks,
    stretches_in_words,
    usual_blocks,
    without,
)
from drift_drake.gap.evidence.search import Search

FIRST, LAST = 2.0, 4.0  # [s] of a run


@pytest.fixture(scope="module")
def search(plain_day):
    return plain_day.search


@pytest.fixture(scope="module")
def odd_search(search):
    """Both speeds are off by far in two seconds of the first run."""
    day = search.day
    errors = day.errors.copy()
    run = day.runs[0]
    t = run.starts * run.period
    errors[: len(t)][(t >= FIRST) & (t < LAST), :, 1::2] += 3.0
    return search.on(dataclasses.replace(day, errors=errors))


def test_seconds_that_hold_a_gap_are_found(odd_search):
    odd = odd_blocks(odd_search, odd_search.none())
    assert 1 <= np.count_nonzero(odd) <= MOST * len(odd)
    assert set(odd_search.day.run[odd[odd_search.day.block]]) == {0}
    words = stretches_in_words(odd_search, odd)
    assert words.startswith(f"{odd_search.day.runs[0].name} between 2.")
    assert "," not in words


def test_stretches_are_said_one_by_one_or_how_much_of_a_run_they_are(search):
    """Each window of the first run is a block of its own; starts are two strides apart."""
    run = search.day.runs[0]
    finer = search.on(dataclasses.replace(search.day, block=np.arange(len(search.day.block))))
    at = run.starts * run.period

    def said(*which):
        return stretches_in_words(finer, np.isin(np.arange(finer.day.blocks), which))

    first = f"between {at[0]:.1f} and {at[1] + 0.5:.1f} s"
    assert said(0, 1) == f"{run.name} {first}"
    assert said(0, 1, 4) == f"{run.name} {first} and between {at[4]:.1f} and {at[4] + 0.5:.1f} s"
    assert said(0, 2, 6) == f"{run.name} for 1.5 s here and there"
    assert said() == ""


def test_what_acts_in_all_of_the_driving_is_not_of_a_few_seconds(late_day):
    assert not np.any(odd_blocks(late_day.search, late_day.search.none()))


def test_without_them_the_day_is_as_it_was(search, odd_search):
    odd = odd_blocks(odd_search, odd_search.none())
    rest = without(odd_search, odd)
    kept = ~odd[odd_search.day.block]
    np.testing.assert_allclose(rest.day.errors, search.day.errors[kept])
    assert rest.none().nats < odd_search.none().nats
    whole_run = odd_search.day.block[odd_search.day.run == 0]
    gone = without(odd_search, np.isin(np.arange(odd_search.day.blocks), whole_run))
    assert [run.name for run in gone.day.runs] == [run.name for run in odd_search.day.runs[1:]]


def test_seconds_that_no_prediction_follows_are_usual_where_the_baseline_has_as_many(odd_search):
    assert not np.any(usual_blocks(odd_search))  # the baseline has none
    day, normal = odd_search.day, dataclasses.replace(odd_search.normal, lost=np.array([[20, 2], [2, 0]]))
    usual = usual_blocks(Search(day, normal, odd_search.vehicle, list(odd_search.ranges)))
    t = day.runs[0].starts * day.runs[0].period
    far = np.unique(day.block[: len(t)][(t >= FIRST) & (t < LAST)])
    assert np.count_nonzero(usual) >= 1
    assert set(np.flatnonzero(usual)) <= set(far)


def lost_commands(other_car, effect):
    """Runs of a later day; the logger did not get the commands of the first one from 1 s on."""
    first, *others = (
        dataclasses.replace(run, name=f"run_{k}")
        for k, run in enumerate([*other_car.day(effect, 1), *other_car.day(effect, 2)])
    )
    lost = first.t - first.t[0] >= 1.0
    commands = {name: np.where(lost, 0.0, getattr(first, name)) for name in ("delta_cmd", "tau_cmd")}
    return [dataclasses.replace(first, **commands), *others]


def test_they_are_no_change_where_the_baseline_has_as_many(other_car, diagnosed):
    found = diagnosed(lost_commands(other_car, {}), "usual", lost=2)
    assert found.answer.verdict == "none"
    (said,) = [w for w in found.answer.warnings if "as in about as much of the baseline" in w]
    assert "in run_0 between" in said


@pytest.mark.parametrize(
    ("effect", "causes", "verdict", "ends"),
    [
        ({"torque_gain_error": -0.2}, ["torque_gain_error"], "effect", r"the cause is judged without them"),
        ({}, [], "unknown", r"without them these logs show no gap \(probability 0\.[89]\d of none\)"),
    ],
)
def test_what_the_rest_shows_is_said_and_the_seconds_are_reported(other_car, diagnosed, effect, causes, verdict, ends):
    found = diagnosed(lost_commands(other_car, effect), f"lost {verdict}")
    assert (found.answer.verdict, found.answer.causes) == (verdict, causes)
    (said,) = [w for w in found.answer.warnings if "in a few seconds" in w]
    assert "run_0 between" in said
    assert re.search(f"{ends}$", said)
    assert found.answer.details["left_over"]["probability"] > 0.5
