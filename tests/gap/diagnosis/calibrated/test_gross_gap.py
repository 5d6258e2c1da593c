"""Gaps far beyond normal: what removes the errors themselves, and how much of them on blocks that were not fitted."""

import dataclasses

import numpy as np
import pytest

from drift_drake.gap.diagnosis.calibrated import gross_gap
from drift_drake.gap.diagnosis.calibrated.gross_gap import FAR, fewer_windows, judged_by_errors, mean_misfits, misfits
from drift_drake.gap.diagnosis.calibrated.posterior import interval
from drift_drake.gap.evidence.constants import PRIORS
from drift_drake.gap.evidence.hypotheses import Hypothesis
from drift_drake.gap.evidence.ranking import DayRanked


@pytest.fixture(scope="module")
def late(late_day):
    return judged_by_errors(late_day.search, PRIORS, lambda _: None)


def test_the_cause_is_named_with_its_magnitude(late):
    leading = late[0].leading
    assert "steering_delay" in leading.names
    m = interval(leading, leading.names.index("steering_delay"))
    assert m.low < 0.08 < m.high
    assert 0.3 < late[1].low <= late[1].estimate <= late[1].high <= 1.0


def test_what_it_leaves_on_held_out_blocks_is_unknowns(late):
    assert late[0].probabilities["unknown"] == pytest.approx(1.0 - late[1].estimate)
    assert sum(late[0].probabilities.values()) == pytest.approx(1.0)


def test_a_gap_that_no_effect_removes_is_unknown(strange_day):
    ranked, reduction = judged_by_errors(strange_day.search, PRIORS, lambda _: None)
    assert ranked.verdict == "unknown"
    assert reduction.estimate < 0.5


def test_a_cause_that_leaves_scores_far_from_normal_comes_with_something_else(late_day):
    search = late_day.search
    wrong = Hypothesis(("mass_error",), np.array([0.1]), np.array([[1e-6]]), 0.0, 0.0)
    right = dataclasses.replace(wrong, names=("steering_delay",), magnitudes=np.array([0.08]))
    ranked = DayRanked({}, [], "effect", wrong)
    found = gross_gap.with_something_else(search, ranked, PRIORS.temperature)
    assert found.something_else > 0.9
    assert found.leading.left_over is not None
    found = gross_gap.with_something_else(search, dataclasses.replace(ranked, leading=right), PRIORS.temperature)
    assert found.something_else == 0.0
    unknown = dataclasses.replace(ranked, verdict="unknown")
    assert gross_gap.with_something_else(search, unknown, PRIORS.temperature) is unknown


def test_no_error_counts_more_than_a_diverged_one(late_day):
    e = gross_gap.in_scales(late_day.search, late_day.search.day.errors)
    assert np.all(misfits(1e6 * e) <= FAR)
    small = misfits(1e-3 * e)
    np.testing.assert_allclose(misfits(2e-3 * e), 4.0 * small, rtol=1e-3)


def test_fewer_windows_are_those_of_the_day(late_day):
    day = fewer_windows(late_day.search.day, 30)
    assert 15 <= len(day.errors) <= 30 + len(day.runs)
    np.testing.assert_array_equal(day.errors_with({}), day.errors)
    assert len(day.block) == len(day.run) == len(day.weights) == len(day.jacobian) == len(day.errors)


def test_a_fit_stays_within_its_range_and_is_no_worse_than_its_start(late_day):
    search = late_day.search.on(fewer_windows(late_day.search.day, 40))
    names = ("mass_error", "steering_delay")
    q = gross_gap.fitted(search, names, (0.1, 0.05))
    assert all(search.ranges[n].low <= x <= search.ranges[n].high for n, x in zip(names, q, strict=True))
    fit, start, *around = mean_misfits(
        search, (names, q), (names, (0.1, 0.05)), *((names, q + x) for x in 0.02 * np.vstack([np.eye(2), -np.eye(2)]))
    )
    assert fit <= start
    assert fit <= min(around)


def test_a_fit_to_some_windows_is_theirs(late_day):
    search = late_day.search.on(fewer_windows(late_day.search.day, 40))
    kept = search.day.block % 2 == 0
    ours, whole = (gross_gap.fitted(search, ["steering_delay"], [0.03], part) for part in (kept, None))
    other = search.on(search.day.kept(kept))
    assert ours == pytest.approx(gross_gap.fitted(other, ["steering_delay"], [0.03]), abs=2e-3)
    assert whole == pytest.approx(0.08, abs=0.02)


def test_no_pair_is_tried_where_one_cause_explains_the_gap(late_day, monkeypatch):
    def never(*_):
        raise AssertionError

    monkeypatch.setattr(gross_gap, "grown_pairs", never)
    assert judged_by_errors(late_day.search, PRIORS, lambda _: None)[0].leading.names == ("steering_delay",)
    monkeypatch.setattr(gross_gap, "SECOND", 0.0)
    with pytest.raises(AssertionError):
        judged_by_errors(late_day.search, PRIORS, lambda _: None)


def test_the_covariance_is_the_inverse_of_the_second_derivatives(late_day, monkeypatch):
    """Of a quadratic, to the bit of what differences give."""
    search, hessian = late_day.search, np.array([[4000.0, 300.0], [300.0, 500.0]])
    middle = np.array([0.05, -0.1])

    def bowl(_search, *named):
        return [0.5 * (q - middle) @ hessian @ (q - middle) for _, q in named]

    monkeypatch.setattr(gross_gap, "mean_misfits", bowl)
    monkeypatch.setattr(gross_gap, "nats", lambda _s, value: value)
    ranges = search.ranges
    wide = {name: dataclasses.replace(ranges[name], low=-2.0, high=2.0) for name in ("gyro_bias", "mass_error")}
    monkeypatch.setattr(search, "ranges", {**ranges, **wide})
    h = gross_gap.hypothesis(search, ("gyro_bias", "mass_error"), middle)
    np.testing.assert_allclose(h.covariance, np.linalg.inv(hessian), rtol=1e-9)


@pytest.fixture
def narrow(late_day):
    """The search for what made the day late, where a delay is not looked for as far as it is."""
    search = late_day.search.on(late_day.search.day)
    search.ranges["steering_delay"] = dataclasses.replace(search.ranges["steering_delay"], high=0.05)
    return search


@pytest.mark.slow
def test_a_cause_beyond_its_range_is_followed_and_found(narrow):
    found = judged_by_errors(narrow, PRIORS, lambda _: None)[0].leading
    at = found.names.index("steering_delay")
    assert found.magnitudes[at] == pytest.approx(0.08, abs=0.02)
    assert narrow.ranges["steering_delay"].high == pytest.approx(0.1)  # so that 0.08 is not stated as "at least"


def test_only_ranges_with_a_cause_at_their_end_are_widened(narrow):
    names = ("mass_error", "steering_delay")
    before = dict(narrow.ranges)
    inside = gross_gap.hypothesis(narrow, names, np.array([0.1, 0.03]))
    assert not gross_gap.widened_at_ends(narrow, [inside])
    assert narrow.ranges == before
    assert gross_gap.widened_at_ends(narrow, [dataclasses.replace(inside, magnitudes=np.array([0.1, 0.05]))]) == {
        "steering_delay"
    }
    assert narrow.ranges["steering_delay"].high == pytest.approx(0.1)
    assert narrow.ranges["mass_error"] == before["mass_error"]


def test_the_best_pair_is_followed_beyond_its_range(narrow):
    names = ("mass_error", "steering_delay")
    pairs = [gross_gap.hypothesis(narrow, names, gross_gap.fitted(narrow, names, np.array([0.05, 0.05])))]
    assert pairs[0].magnitudes[1] == pytest.approx(0.05)
    found = gross_gap.followed(narrow, pairs)
    assert found[0].magnitudes[1] == pytest.approx(0.08, abs=0.02)
    assert found[0].nats < pairs[0].nats
    assert gross_gap.followed(narrow, []) == []


def test_a_range_that_is_as_wide_as_can_be_is_not_widened(narrow):
    h = gross_gap.hypothesis(narrow, ("steering_delay",), np.array([0.05]))
    for _ in range(8):
        end = np.array([narrow.ranges["steering_delay"].high])
        if not gross_gap.widened_at_ends(narrow, [dataclasses.replace(h, magnitudes=end)]):
            break
    else:
        pytest.fail("widened for ever")
