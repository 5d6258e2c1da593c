"""The sentence of an answer: rivals of a verdict that is not even as probable as not."""

import dataclasses

import pytest

from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.gap.diagnosis.answers.answer import Answer
from drift_drake.gap.diagnosis.answers.rivals import of_rivals, tells_apart
from drift_drake.gap.estimation.prior import Interval

NOTHING = Interval(0.0, 0.0, 0.0)
CLOSE = {"none": 0.4, "torque_gain_error": 0.3, "aero_drag+mass_error": 0.2, "unknown": 0.09}
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


@pytest.mark.parametrize(
    ("cause", "rivals", "drives"),
    [
        ("steering_lag", ["steering_delay"], ["steps and fast sine sweeps"]),
        ("mass_error", ["torque_gain_error"], ["until the driven wheels spin"]),
        ("rolling_resistance", ["drivetrain_friction", "aero_drag"], ["until the driven wheels spin", "coasting"]),
        ("drivetrain_friction", ["rolling_resistance+unknown", "rolling_resistance"], ["until the driven wheels spin"]),
        ("mass_error", ["gyro_bias"], []),
    ],
)
def test_effects_that_act_alike_have_the_drive_that_tells(cause, rivals, drives):
    said = tells_apart(cause, rivals)
    assert all(drive in said for drive in drives)
    assert said.count("to distinguish") == len(drives)
    posterior = {cause: 0.5} | dict.fromkeys(rivals, 0.25)
    found = dataclasses.replace(
        ANSWER, verdict="effect", causes=[cause], posterior=posterior, magnitudes={cause: Interval(0.2, 0.1, 0.3)},
        reduction=Interval(0.6, 0.5, 0.7),
    )  # fmt: skip
    assert found.sentence().endswith(said)


def test_effects_with_a_drive_that_tells_are_the_catalogues():
    assert {name for effect in CATALOGUE.values() for name in effect.distinguished_from} <= set(CATALOGUE)


def test_a_probable_verdict_has_none():
    sure = {"none": 0.91, "torque_gain_error": 0.09}
    assert "It may be" not in dataclasses.replace(ANSWER, posterior=sure).sentence()


def test_a_rival_of_none_has_its_detection_limit():
    details = ANSWER.details | {"detection": {"torque_gain_error": {"unit": "-", "least": 0.12, "taken_for": "none"}}}
    said = dataclasses.replace(ANSWER, details=details).sentence()
    assert "torque_gain_error (0.30, which these logs would show from 0.12 on)" in said


def test_a_cause_with_something_else_is_said_in_words():
    posterior = {"none": 0.4, "mass_error+unknown": 0.6}
    assert "mass_error with an additional fault (0.60" in dataclasses.replace(ANSWER, posterior=posterior).sentence()


def test_the_four_decisions_are_said():
    rate = {"false_alarm_rate": {"asked": 0.05}}
    none = dataclasses.replace(ANSWER, details=ANSWER.details | rate | {"decision": "none"})
    assert "no gap beyond the car's calibrated baseline" in none.sentence()
    undecided = dataclasses.replace(ANSWER, details=ANSWER.details | rate | {"decision": "undecided"})
    assert "undecided: these logs neither show nor exclude a gap" in undecided.sentence()
    cause = dataclasses.replace(
        ANSWER, verdict="effect", causes=["mass_error"], posterior={"mass_error": 0.7, "torque_gain_error": 0.3},
        magnitudes={"mass_error": Interval(0.1, 0.08, 0.12)}, reduction=Interval(0.6, 0.5, 0.7),
        details={"decision": "cause_open"},
    )  # fmt: skip
    assert "a gap whose cause these logs leave open: most likely mass_error" in cause.sentence()
    left = dataclasses.replace(cause, details={"decision": "cause", "left_over": {"share": 0.4}})
    assert "mass_error 0.1 (95 %: 0.08 to 0.12) and an additional fault that the catalogue lacks" in left.sentence()
    may = dataclasses.replace(cause, details={"decision": "cause", "left_over": {"share": 0.4, "probability": 0.35}})
    assert "and an additional fault" not in may.sentence()
    assert "An additional fault that the catalogue lacks may be there too (0.35)." in may.sentence()


def test_a_cause_with_something_else_too_is_no_rival_of_itself():
    posterior = {"steering_delay": 0.75, "steering_delay+unknown": 0.2, "none": 0.05}
    found = dataclasses.replace(
        ANSWER, verdict="effect", causes=["steering_delay"], posterior=posterior,
        magnitudes={"steering_delay": Interval(0.08, 0.07, 0.09)}, reduction=Interval(0.6, 0.5, 0.7),
    )  # fmt: skip
    said = found.sentence()
    assert "instead" not in said
    assert "probability 0.95" in said
    assert said.endswith("An additional fault may be there too (0.20 of it).")


def test_a_rival_has_the_probability_of_itself_with_something_else_or_without():
    found = dataclasses.replace(ANSWER, posterior={"none": 0.8, "mass_error": 0.09, "mass_error+unknown": 0.04})
    assert "It may be mass_error (0.13) instead" in found.sentence()
    assert of_rivals({"aero_drag": 0.5, "mass_error+unknown": 0.3, "mass_error": 0.1, "aero_drag+unknown": 0.1},
                     "aero_drag") == {"mass_error+unknown": pytest.approx(0.4)}  # fmt: skip


def test_many_rivals_are_counted():
    names = ["mass_error", "cg_shift", "aero_drag", "road_grade", "torque_lag"]
    posterior = {"none": 0.4} | dict.fromkeys(names, 0.12)
    found = dataclasses.replace(ANSWER, posterior=posterior, ambiguity=["none", *names])
    assert "or aero_drag (0.12), or one of 2 others instead" in found.sentence()
