"""Stretches that a user keeps for validation: nothing of them reaches the fit, and the car is judged by them."""

import dataclasses

import numpy as np
import pytest

from drift_drake.car.log.table import InvalidLogError, Run
from drift_drake.car.parameters import VehicleParameters
from drift_drake.gap.identification import identify as identification
from drift_drake.gap.identification.identify import identify
from drift_drake.gap.identification.validation import split

T = 0.01 * np.arange(1001)


def run(name):
    return Run(name, t=T, r=0.0 * T, v=10.0 + T, delta_cmd=0.0 * T)


def test_runs_and_stretches_of_runs_are_kept_apart():
    fitted, judged = split([run("a"), run("b: 2"), run("c")], ["a:2-4", "a:3-5", "b: 2"])
    assert [(one.name, one.recording, one.t[0], one.t[-1]) for one in fitted] == [
        ("a_0", "a", 0.0, 1.99), ("a_1", "a", 5.01, 10.0), ("c", "", 0.0, 10.0),
    ]  # fmt: skip
    assert [(one.name, one.recording, one.t[0], one.t[-1]) for one in judged] == [
        ("a", "a", 2.0, 5.0), ("b: 2", "", 0.0, 10.0),
    ]  # fmt: skip


def test_what_is_too_short_to_be_fitted_is_left_out():
    fitted, judged = split([run("a")], ["a:0.2-9"])
    assert [(one.t[0], one.t[-1]) for one in fitted] == [(9.01, 10.0)]
    assert len(judged) == 1


@pytest.mark.parametrize(
    ("stretches", "said"),
    [
        (["d"], "validation stretch d: is no run; give NAME or NAME:START-END, of a, b"),
        (["a:x-3"], "validation stretch a:x-3: is no run"),
        (["a:3-3.2"], "validation stretch a:3-3.2: has 21 rows, 50 are the least; the run goes from 0 to 10 s"),
        (["a", "b"], "validation: all runs are kept for it"),
    ],
)
def test_what_cannot_be_kept_is_refused(stretches, said):
    with pytest.raises(InvalidLogError, match=said):
        split([run("a"), run("b")], stretches)


@pytest.mark.parametrize("criterion", ["likelihood", "prediction"])
def test_the_fit_knows_nothing_of_them_and_is_judged_by_them(strange_car_runs, monkeypatch, criterion):
    monkeypatch.setattr(identification, "FURTHER", ())
    *others, last = strange_car_runs
    other = dataclasses.replace(last, r=last.r + 0.05 * np.sin(9.0 * last.t))
    two = [
        identify([*others, kept, dataclasses.replace(kept, name="again", v=kept.v + 0.2)], VehicleParameters(),
                 effects=(), criterion=criterion, car="single-track", watching=False, force=True,
                 validation=[last.name, "again"]).calibration
        for kept in (last, other)
    ]  # fmt: skip
    first, second = ({name: p.estimate for name, p in one.parameters.items()} for one in two)
    assert first == pytest.approx(second, rel=1e-3, abs=1e-5)
    assert two[0].validation == (last.name, "again")
    after = [np.array(one.held_out.after[-1]) for one in two]
    assert np.max(after[1] / after[0]) > 1.2
    everything = identify(strange_car_runs, VehicleParameters(), effects=(), criterion=criterion, car="single-track",
                          watching=False, force=True).calibration  # fmt: skip
    assert abs(everything.parameters["friction"].estimate / first["friction"] - 1.0) > 1e-3


def test_too_little_to_judge_by_is_refused(strange_car_runs):
    with pytest.raises(InvalidLogError, match=r"^validation: no run has enough to be used"):
        identify(strange_car_runs, VehicleParameters(), validation=[strange_car_runs[0].name + ":0-1"])
