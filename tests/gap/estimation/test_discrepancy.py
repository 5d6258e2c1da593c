"""Forces that a car's model lacks, taken out of the innovations."""

import dataclasses

import numpy as np
import pytest

from drift_drake.car.parameters import VehicleParameters
from drift_drake.gap.estimation.filtered import filter_case
from drift_drake.gap.estimation.freeform import FORCE_CHANNELS, FORCE_UNIT, applied, traced, with_more_process_noise
from drift_drake.gap.estimation.make_problem import make_problem
from drift_drake.gap.estimation.problem import ModelDiscrepancy, flat
from experiments.benchmarks.compiled_cases import make_case
from experiments.benchmarks.truths import Truth

RESISTANCE = 0.03
FUNCTIONS = 20  # of the state, the first of them constant
BIAS = 0.01  # [rad]


@pytest.fixture(scope="module")
def problem():
    truth = Truth({"rolling_resistance": RESISTANCE, "sideslip_bias": BIAS})
    return make_problem(make_case(truth, VehicleParameters(), np.random.default_rng(3), 3.0)[:2], VehicleParameters())


@pytest.fixture(scope="module")
def discrepancy(problem):
    """What that car lacks: a force backwards, and an offset of the sideslip (readings are moved back by it)."""
    vehicle = problem.vehicle
    forces = {channel: [0.0] * FUNCTIONS for channel in FORCE_CHANNELS}
    forces["body longitudinal force"][0] = -RESISTANCE * vehicle.mass * vehicle.gravity / FORCE_UNIT
    return ModelDiscrepancy(forces, {"beta": -BIAS / problem.noise[2]}, 1.0)


def mean_square(problem):
    e = flat(problem, filter_case(problem, np.zeros(problem.nuisances), ()).innovations)
    return float(np.mean(e**2))


def test_a_car_with_its_forces_of_the_discrepancy_is_followed(problem, discrepancy):
    taken_out = traced(problem.replace(discrepancy=discrepancy))
    assert mean_square(problem) > 2.0
    assert mean_square(taken_out) == pytest.approx(1.0, abs=0.1)


def test_forces_that_do_not_carry_over_are_left_out(problem, discrepancy):
    kept, warnings = applied(problem, discrepancy)
    assert (kept.discrepancy, warnings) == (discrepancy, [])
    wrong = dataclasses.replace(discrepancy, forces={c: [-10.0 * q for q in w] for c, w in discrepancy.forces.items()})
    kept, (warning,) = applied(problem, wrong)
    assert kept is problem
    assert "do not carry over" in warning


def test_the_trace_follows_the_filter(problem, discrepancy):
    rough = with_more_process_noise(traced(problem.replace(discrepancy=discrepancy)))
    assert mean_square(rough) < mean_square(with_more_process_noise(problem))
    assert mean_square(rough) < 1.0


def test_without_forces_of_the_discrepancy_nothing_changes(problem):
    assert traced(problem) is problem
