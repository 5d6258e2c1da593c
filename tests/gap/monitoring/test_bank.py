"""The bank's filters: white innovations of the right car, agreement with the estimator's filter and its commands."""

import numpy as np
import pytest

from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.parameters import VehicleParameters
from drift_drake.gap.estimation.filter_state import CHANNELS
from drift_drake.gap.estimation.filtered import filter_case
from drift_drake.gap.estimation.make_problem import make_problem
from drift_drake.gap.estimation.problem import PROCESS_NOISE, car
from drift_drake.gap.monitoring import bank as filters
from drift_drake.gap.monitoring.bank import Node, make_nodes

VEHICLE = VehicleParameters()


def innovations_of(bank: filters.Bank, y: np.ndarray, used: np.ndarray, commands: np.ndarray) -> np.ndarray:
    state = filters.make_state(bank)
    filters.start_bank(y[0], used, commands[0], bank, state)
    return np.array([filters.advance_bank(y[k], used, commands[k], bank, state) for k in range(1, len(y))])


def test_the_first_car_is_the_estimators_filter(changed_run, commands):
    problem = make_problem([changed_run], VEHICLE)
    run = problem.runs[0]
    bank = filters.make_bank([], VEHICLE, Effects(), run.period, problem.noise**2, PROCESS_NOISE**2)
    found = innovations_of(bank, run.y, run.used, commands)[:, 0]
    expected = filter_case(problem, np.zeros(problem.nuisances), ()).innovations[0][1:]
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("name", ["steering_delay", "steering_lag", "steering_rate_limit", "torque_lag",
                                  "sensor_latency", "command_clock_error", "steering_ratio_error",
                                  "road_bank"])  # fmt: skip
def test_commands_pass_actuators_row_by_row_as_all_at_once(changed_run, commands, name):
    """A car of the bank alone is the estimator's filter of that effect."""
    problem = make_problem([changed_run], VEHICLE)
    run, magnitude = problem.runs[0], CATALOGUE[name].low
    theta = np.zeros(problem.nuisances + 1)
    theta[-1] = magnitude
    own = car(problem, theta, (name,))[1]
    bank = filters.make_bank([], VEHICLE, own, run.period, problem.noise**2, PROCESS_NOISE**2)
    first = 20 if name in ("sensor_latency", "command_clock_error") else 0  # the estimator waits for late sensors
    state = filters.make_state(bank)
    filters.start_bank(run.y[first], run.used, commands[first], bank, state)
    state.commands[:] = commands[np.maximum(np.arange(first + 1 - len(state.commands), first + 1), 0)]
    found = np.array(
        [filters.advance_bank(run.y[k], run.used, commands[k], bank, state)[0] for k in range(first + 1, len(run.y))]
    )
    expected = filter_case(problem, theta, (name,)).innovations[0][first + 1 :]
    np.testing.assert_allclose(found[100:], expected[100:], atol=0.02)


def test_the_car_that_changed_is_white_under_its_own_node(changed_run, commands):
    node = Node("rear_stiffness_error", -0.25, 0.0, 1.0)
    problem = make_problem([changed_run], VEHICLE)
    run = problem.runs[0]
    bank = filters.make_bank([node], VEHICLE, Effects(), run.period, problem.noise**2, PROCESS_NOISE**2)
    e = innovations_of(bank, run.y, run.used, commands)[:, :, run.used]
    before, after = slice(40, 240), slice(400, None)
    assert np.mean(e[before, 0] ** 2) == pytest.approx(1.0, abs=0.15)
    assert np.mean(e[after, 1] ** 2) < 1.5  # it had another past
    assert np.mean(e[after, 0] ** 2) > 2.0


def test_a_missing_reading_corrects_nothing(changed_run, commands):
    problem = make_problem([changed_run], VEHICLE)
    run = problem.runs[0]
    bank = filters.make_bank([], VEHICLE, Effects(), run.period, problem.noise**2, PROCESS_NOISE**2)
    state = filters.make_state(bank)
    filters.start_bank(run.y[0], run.used, commands[0], bank, state)
    e = filters.advance_bank(run.y[1], np.zeros(len(CHANNELS), dtype=bool), commands[1], bank, state)
    assert np.all(e == 0.0)
    assert np.isfinite(state.z).all()


def test_every_effect_has_a_node_and_scales_with_the_car():
    nodes = make_nodes(list(CATALOGUE), VEHICLE)
    assert {node.name for node in nodes} >= set(CATALOGUE)
    small = VEHICLE.replace(mass=1.6)
    drag, small_drag = (next(node.magnitude for node in make_nodes(["aero_drag"], v)) for v in (VEHICLE, small))
    assert small_drag == pytest.approx(drag * 1.6 / VEHICLE.mass)
