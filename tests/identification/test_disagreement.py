"""Whether recordings agree, and what is said where they do not."""

import dataclasses
import itertools

import numpy as np
import pytest

from drift_drake.estimation.prediction_constants import CALIBRATED
from drift_drake.identification.agreement import Agreement, agreement, pieces, sentences, with_differences
from drift_drake.identification.by_prediction import ALONE, differences
from drift_drake.identification.command import row
from drift_drake.identification.report import report_html


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


def test_the_recording_that_pulls_the_most_is_named() -> None:
    assert agreement(pulls_of([0.0, 0.1, 5.0, -0.1]), np.array([0.01])).furthest[0] == 2


def test_one_recording_disagrees_with_none() -> None:
    assert not agreement(np.zeros((1, 2)), np.ones(2)).disagreed.any()


def test_estimates_that_recordings_disagree_about_are_named_with_the_recording() -> None:
    first, second, odd = sentences({"friction": "laps", "drag": "ramp", "mass": "laps"}, {"ramp": 7.2, "circles": 11.0})
    assert first.startswith("the recordings ask for different values of friction, mass, laps the most: not identified")
    assert second.startswith("the recordings ask for different values of drag, ramp the most: not identified")
    assert odd.startswith("ramp, circles: far from the rest of the baseline, 11 times as much")
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


def test_long_runs_are_looked_at_in_pieces(other_car) -> None:
    from drift_drake.estimation.windows import windowed

    runs = [windowed(run) for run in other_car.runs]
    long = dataclasses.replace(runs[0], starts=np.arange(0, round(32.0 / runs[0].period), 20))

    class Short:
        def __init__(self, of):
            self.runs = of
            self.run = np.repeat(np.arange(len(of)), [len(run.starts) for run in of])

    names, piece = pieces(Short([runs[1], long]))
    assert names[0] == runs[1].name
    assert [name.split(" from ")[1] for name in names[1:]] == ["0 to 11 s", "11 to 21 s", "21 to 32 s"]
    assert all(a <= b for a, b in itertools.pairwise(piece))
