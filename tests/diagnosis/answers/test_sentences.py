"""The sentence of an answer: rivals of a verdict that is not even as probable as not."""

import dataclasses

from drift_drake.diagnosis.answers.answer import Answer
from drift_drake.estimation.prior import Interval

NOTHING = Interval(0.0, 0.0, 0.0)
CLOSE = {"none": 0.4, "torque_gain_error": 0.3, "aero_drag+mass_error": 0.2, "unknown": 0.1}
ANSWER = Answer("monday", "none", [], CLOSE, ["none", "torque_gain_error", "aero_drag+mass_error"], {}, {}, NOTHING,
                1.0, {}, {"criterion": "prediction"}, [])  # fmt: skip


def test_rivals_of_an_improbable_verdict_are_named_with_the_next_command():
    said = ANSWER.sentence()
    assert "It may be torque_gain_error (0.30), or aero_drag and mass_error (0.20) instead" in said
    assert "drift-drake plan-next" in said


def test_a_cause_has_rivals_too():
    found = dataclasses.replace(
        ANSWER, verdict="effect", causes=["torque_gain_error"], posterior=CLOSE | {"none": 0.2},
        magnitudes={"torque_gain_error": Interval(-0.2, -0.3, -0.1)}, reduction=Interval(0.6, 0.5, 0.7),
    )  # fmt: skip
    assert "It may be none (0.20), or aero_drag and mass_error (0.20) instead" in found.sentence()


def test_a_probable_verdict_has_none():
    assert "It may be" not in dataclasses.replace(ANSWER, posterior=CLOSE | {"none": 0.5}).sentence()
    assert "It may be" not in dataclasses.replace(ANSWER, ambiguity=["none"]).sentence()


def test_many_rivals_are_counted():
    names = ["mass_error", "cg_shift", "aero_drag", "road_grade", "torque_lag"]
    posterior = {"none": 0.4} | dict.fromkeys(names, 0.12)
    found = dataclasses.replace(ANSWER, posterior=posterior, ambiguity=["none", *names])
    assert "or aero_drag (0.12), or one of 2 others instead" in found.sentence()
