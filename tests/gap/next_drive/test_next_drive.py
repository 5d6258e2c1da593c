"""What to drive next: beliefs survive the answer's file, foresight knows likeness, plans keep their limits."""

import dataclasses
import json

import numpy as np
import pytest

from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.parameters import VehicleParameters
from drift_drake.drive.mpc.plan import interpolate_plan
from drift_drake.gap.diagnosis.answers.answer import Answer, UnplannableError
from drift_drake.gap.diagnosis.likelihood.beliefs import (
    Belief,
    Sensing,
    belief_of,
    beliefs_as_data,
    beliefs_from_data,
    unseen,
)
from drift_drake.gap.estimation.filter_state import CHANNELS
from drift_drake.gap.estimation.fit import Fit
from drift_drake.gap.estimation.make_problem import make_problem
from drift_drake.gap.estimation.prior import Interval, scale
from drift_drake.gap.estimation.problem import NUISANCES, PROCESS_NOISE, Problem
from drift_drake.gap.evidence.posterior import PosteriorConstants
from drift_drake.gap.next_drive.foresight import Commands, foresee, probability_of_truth, readings
from drift_drake.gap.next_drive.plan import NextDriveConfig, as_rival, plan_from_answer, plan_next, stand_ins
from experiments.benchmarks.compiled_cases import NOISE

VEHICLE = VehicleParameters()
SENSING = Sensing(np.array([NOISE[name] for name in CHANNELS]), np.ones(9, dtype=np.bool_), PROCESS_NOISE**2)
SHORT = NextDriveConfig(steps=15, v_end=11.0, starts=1, max_iterations=15)
T = np.arange(201) * 0.01
WEAVING = Commands(0.08 * np.sin(4.0 * T), np.full(201, 80.0), 9.0)


def belief(probability: float, **effects: float) -> Belief:
    sigma = np.concatenate([np.full(len(NUISANCES), 0.3), [0.3 * scale(name) for name in effects]])
    theta = np.concatenate([np.zeros(len(NUISANCES)), list(effects.values())])
    return Belief(tuple(effects), probability, theta, np.diag(sigma))


LAG, DELAY = belief(0.5, steering_lag=0.08), belief(0.5, steering_delay=0.07)


@pytest.fixture(scope="module")
def problem(stiffness_case):
    return make_problem(stiffness_case[1], VEHICLE)


def test_beliefs_survive_their_plain_data(problem):
    size = problem.nuisances + 2
    root = np.tril(np.random.default_rng(0).normal(size=(size, size)))
    names = ("aero_drag", "mass_error")
    fit = Fit(names, np.full(size, 0.1), 0.0, root @ root.T, 0.0, 1.0, 1)
    known = problem.replace(own=Effects(road_grade=0.02))
    data = beliefs_as_data(known, [(fit, 0.0)], {"aero_drag+mass_error": 0.8}, list(CATALOGUE), PosteriorConstants())
    sensing, beliefs = beliefs_from_data(json.loads(json.dumps(data)))
    assert sensing.own == known.own
    kept = [*range(len(NUISANCES)), size - 2, size - 1]
    assert (beliefs[0].names, beliefs[0].probability) == (names, 0.8)
    np.testing.assert_allclose(beliefs[0].theta, fit.theta[kept])
    np.testing.assert_allclose(beliefs[0].root @ beliefs[0].root.T, fit.covariance[np.ix_(kept, kept)], rtol=1e-6)
    np.testing.assert_array_equal(sensing.noise, problem.noise)


def test_where_all_hypotheses_are_improbable_there_are_no_beliefs(problem):
    size = problem.nuisances + 2
    names = ("aero_drag", "mass_error")
    fit = Fit(names, np.full(size, 0.1), 0.0, np.eye(size), 0.0, 1.0, 1)
    data = beliefs_as_data(problem, [(fit, 0.0)], {"aero_drag+mass_error": 1e-9}, list(CATALOGUE), PosteriorConstants())
    assert beliefs_from_data(data)[1] == []


def test_what_a_log_cannot_show_is_a_rival_too(problem):
    size = problem.nuisances
    nothing = Fit((), np.zeros(size), 0.0, 0.01 * np.eye(size), 0.0, 1.0, 1)
    slow = [dataclasses.replace(run, delta=0.01 * run.delta) for run in problem.runs]
    found = unseen(
        problem.replace(runs=slow),
        nothing,
        belief_of(nothing, 0.9),
        ["steering_rate_limit", "aero_drag"],
        PosteriorConstants(),
    )
    # The wheel never had to be fast; drag is plain in any drive.
    assert [b.name for b in found] == ["steering_rate_limit"]
    assert found[0].theta[-1] > CATALOGUE["steering_rate_limit"].low
    assert found[0].probability < 0.9


def test_foresight_sees_steering_dynamics_only_where_there_is_steering():
    straight = Commands(np.zeros(201), np.full(201, 80.0), 9.0)
    assert foresee(VEHICLE, SENSING, [LAG, DELAY], straight).max() < 0.1
    nats = foresee(VEHICLE, SENSING, [LAG, DELAY], WEAVING)
    assert min(nats[0, 1], nats[1, 0]) > 50.0
    same = foresee(VEHICLE, SENSING, [LAG, LAG], WEAVING)
    assert np.max(same) < 0.05


def test_the_probability_of_the_truth_rises_with_the_nats():
    p = np.array([0.6, 0.4])
    before, some, much = (probability_of_truth(p, n * (1.0 - np.eye(2))) for n in (0.0, 2.0, 50.0))
    assert before == pytest.approx(0.6**2 + 0.4**2)
    assert before < some < much
    assert much == pytest.approx(1.0, abs=1e-3)


def test_a_plan_keeps_lane_and_limits_and_beats_the_straight():
    plan = plan_next(VEHICLE, SENSING, [LAG, DELAY], SHORT)
    table = plan.table()
    assert len(table) == 151
    assert np.abs(table["delta_cmd"]).max() <= VEHICLE.steering_limit
    assert table["tau_cmd"].between(VEHICLE.torque_min, VEHICLE.torque_max).all()
    assert np.abs(plan.x[:, 4]).max() < SHORT.half_width
    straight = Commands(np.zeros(151), table["tau_cmd"].to_numpy(), 7.5)
    assert plan.nats.max() > 10.0 * foresee(VEHICLE, SENSING, [LAG, DELAY], straight).max()
    assert plan.after > plan.before
    assert "steering_lag from steering_delay" in plan.sentence()
    # As the actuator interpolates the plan's points.
    vector = np.concatenate([[0.0], plan.u.ravel()])
    np.testing.assert_allclose(
        table.loc[33, ["delta_cmd", "tau_cmd"]], interpolate_plan(vector, 0.33, 0.1)[:2], atol=1e-6
    )


def test_an_answer_without_rivals_is_refused():
    answer = Answer("a", "none", [], {"none": 1.0}, ["none"], {}, {}, Interval(0, 0, 0), 1.0, {}, {}, [])
    with pytest.raises(UnplannableError, match="holds no rival hypotheses"):
        plan_from_answer(answer, VEHICLE)


def test_effects_of_the_vehicle_file_are_driven_with() -> None:
    """As a hypothesis has them, in what is foreseen and in the plan's car."""
    known, drag = dataclasses.replace(SENSING, own=Effects(aero_drag=1.2)), belief(0.5, aero_drag=1.2)
    nothing = belief(0.5)
    read = [readings(VEHICLE, s, b, WEAVING) for s, b in ((known, nothing), (SENSING, drag), (SENSING, nothing))]
    np.testing.assert_allclose(read[0], read[1], rtol=1e-12)
    assert np.abs(read[0] - read[2]).max() > 0.01
    cars = [as_rival(VEHICLE, own, b) for own, b in ((known.own, nothing), (Effects(), drag))]
    assert cars[0].car(cars[0].theta).effects.aero_drag == cars[1].car(cars[1].theta).effects.aero_drag == 1.2


def test_a_vehicle_file_with_other_effects_than_the_answers_is_refused(problem: Problem) -> None:
    size = problem.nuisances + 1
    pair = [
        (Fit((name,), np.full(size, 0.1), 0.0, np.eye(size), 0.0, 1.0, 1), 0.0) for name in ("aero_drag", "mass_error")
    ]
    known = problem.replace(own=Effects(road_grade=0.02))
    data = beliefs_as_data(known, pair, {"aero_drag": 0.5, "mass_error": 0.5}, list(CATALOGUE), PosteriorConstants())
    answer = Answer("a", "none", [], {}, ["none"], {}, {}, Interval(0, 0, 0), 1.0, {}, {"beliefs": data}, [])
    message = r"a: the answer .* \(road_grade 0\.02\) that are not this file's \(none\); give the file"
    with pytest.raises(UnplannableError, match=message):
        plan_from_answer(answer, VEHICLE, SHORT, Effects())


def test_stand_ins_are_what_a_step_can_have():
    q = stand_ins(Effects(steering_delay=0.05, sensor_latency=0.03, road_grade=0.02, gyro_bias=0.01))
    assert q.steering_lag == pytest.approx(0.08)
    assert q.torque_lag == pytest.approx(0.03)
    assert q.steering_delay == q.sensor_latency == q.road_grade == q.gyro_bias == 0.0
