"""Wrong units, signs and clocks are named with the remedy, and strong catalogued effects are not taken for them."""

import dataclasses

import numpy as np
import pytest

from drift_drake.car.log.table import InvalidLogError
from drift_drake.car.parameters import VehicleParameters
from drift_drake.gap.logs.screening.relations import Windows, relations
from drift_drake.gap.logs.screening.suspicions import suspicions
from experiments.benchmarks.compiled_cases import make_case
from experiments.benchmarks.log_mutations import DEGREES, unit_mistakes, with_factors
from experiments.benchmarks.truths import Truth

VEHICLE = VehicleParameters()
MISTAKES = unit_mistakes(VEHICLE)
STEERING_RATIO = 14.0


def refusal(runs, factors):
    """The sentence with which runs are refused at once, None where they are believed."""
    try:
        with_factors(runs, factors)
    except InvalidLogError as error:
        return str(error)
    return None


@pytest.mark.parametrize("name", MISTAKES)
def test_each_mistake_is_named(case, name):
    factors = MISTAKES[name]
    refused = refusal(case, factors)
    if refused is not None:
        assert "looks like" in refused
        assert any(f"column {column} " in refused for column in factors)
        return
    reported = suspicions(with_factors(case, factors), VEHICLE)
    assert sorted(s.column for s in reported) == sorted(factors)
    for suspicion in reported:
        assert suspicion.factor == pytest.approx(factors[suspicion.column], rel=0.4)
        assert "looks " in suspicion.sentence
        assert suspicion.evidence


def test_sentences_say_how_much_and_what_to_do(good_cases):
    case = good_cases["nominal"]

    def only(factors, runs=case):
        (suspicion,) = suspicions(with_factors(runs, factors), VEHICLE)
        return suspicion.sentence

    axle = only({"tau_cmd": VEHICLE.gear_ratio})
    assert axle.startswith("column tau_cmd looks like torque at the axle, not at the engine (")
    assert axle.endswith(" times what an engine behind gear_ratio gives): divide it by gear_ratio in the mapping")
    assert only({"v": 3.6}).startswith("column v looks like km/h (3.")
    assert "column psi looks like degrees (5" in only({"psi": DEGREES}, case[:3])
    assert "column y (or x) looks mirrored" in only({"y": -1.0})
    assert "the clock t looks like half of the time that passed" in only({"t": 0.5})
    assert "column delta_cmd looks like the steering wheel's angle" in only({"delta_cmd": STEERING_RATIO}, case[1:2])


def test_two_mistakes_at_once_are_both_named(case):
    reported = suspicions(with_factors(case, {"v": 3.6, "ay": -1.0 / 9.81}), VEHICLE)
    assert {s.column for s in reported} == {"v", "ay"}
    assert {np.sign(s.factor) for s in reported if s.column == "ay"} == {1.0, -1.0}


def test_good_cases_raise_nothing(good_cases):
    for name, runs in good_cases.items():
        assert suspicions(runs, VEHICLE) == [], name


@pytest.mark.parametrize("lacking", [("beta",), ("x", "y", "psi"), ("ax", "ay"), ("tau_cmd", "omega_r"),
                                     ("x", "y", "psi", "ax", "ay", "beta")])  # fmt: skip
@pytest.mark.parametrize("names", [("nominal", "weak", "slippery"), pytest.param(None, marks=pytest.mark.slow)])
def test_columns_that_lack_make_no_suspicion(good_cases, names, lacking):
    for name in names or good_cases:
        runs = good_cases[name]
        less = [run.without(*lacking) for run in runs]
        assert suspicions(less, VEHICLE) == [], name
        assert suspicions(less[-1:], VEHICLE) == [], name  # a drift alone


@pytest.mark.parametrize("lacking", [("x", "y", "psi"), ("ax", "ay"), ("beta",)])
@pytest.mark.parametrize("factors", [{"v": 3.6}, {"t": 0.5}, {"r": 1.0 / DEGREES}])
def test_fewer_witnesses_are_enough(case, lacking, factors):
    reported = suspicions(with_factors([run.without(*lacking) for run in case], factors), VEHICLE)
    assert [s.column for s in reported] == list(factors)


def test_two_explanations_are_both_reported(case):
    """Steering against yaw rate, and nothing else."""
    less = [run.without("x", "y", "psi", "ax", "ay", "beta", "omega_r", "tau_cmd") for run in case[:2]]
    (reported,) = suspicions(with_factors(less, {"delta_cmd": -1.0}), VEHICLE)
    assert reported.factor == -1.0
    assert "column r looks mirrored, against the other columns; or delta_cmd instead" in reported.sentence


def test_spikes_make_no_suspicion(case):
    runs = []
    for run in case:
        v, r = run.v.copy(), run.r.copy()
        v[100::200], r[50::200] = 900.0, -40.0
        runs.append(dataclasses.replace(run, v=v, r=r))
    assert [s.column for s in suspicions(with_factors(runs, {"tau_cmd": VEHICLE.gear_ratio}), VEHICLE)] == ["tau_cmd"]


def test_a_run_in_another_unit_is_named(case):
    odd = with_factors([case[1]], {"v": 3.6})[0]
    reported = suspicions([case[0], odd, *case[2:]], VEHICLE)
    assert [s.sentence.split(" disagrees")[0] for s in reported] == ["run_1"]
    assert "is it the same car" in reported[0].sentence
    assert reported[0].column is None


def test_a_run_of_a_much_heavier_car_is_named(good_cases):
    case = good_cases["nominal"]
    heavy = make_case(Truth({}, {}, {"mass": 2.5}), VEHICLE, np.random.default_rng(0))
    reported = suspicions([case[0], heavy[1], *case[2:]], VEHICLE)
    assert [s.sentence.split(" disagrees")[0] for s in reported] == ["run_1"]
    assert "gear_ratio tau_cmd / wheel_radius over mass times the rate of v" in reported[0].evidence


def test_short_logs_say_nothing(case):
    assert suspicions([case[0].rows(0, 100)], VEHICLE) == []


@pytest.mark.parametrize(("along_its_course", "judged"), [(1.0, True), (0.2, False)])
def test_a_car_that_swings_about_its_course_is_not_held_against_its_lateral_acceleration(along_its_course, judged):
    """As in a lively slalom of few seconds, in which the sideslip takes up most of the yaw rate."""
    r, missing = np.sin(0.9 * np.arange(14)), np.full(14, np.nan)
    course, v = along_its_course * r, np.full(14, 12.0)
    columns = {field.name: missing for field in dataclasses.fields(Windows)}
    windows = Windows(**columns | {"r": r, "turning": r, "course": course, "v": v, "moved": v, "ay": v * course})
    found = {relation.name: relation for relation in relations(windows, VEHICLE)}
    assert found["course"].size == pytest.approx(along_its_course)
    assert ("across" in found) == judged
    if judged:
        assert found["across"].holds
