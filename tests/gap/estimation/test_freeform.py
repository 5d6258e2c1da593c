"""Free-form forces: silent under the right hypothesis, loud under a wrong one."""

from types import SimpleNamespace

import numpy as np
import pytest

from drift_drake.car.parameters import VehicleParameters
from drift_drake.gap.estimation.filtered import filter_case
from drift_drake.gap.estimation.freeform import force_units, forced, misfit, pulses
from drift_drake.gap.estimation.make_problem import make_problem
from drift_drake.gap.estimation.observed import filtered_states, observe_each
from drift_drake.gap.estimation.problem import counted
from drift_drake.gap.estimation.variants import Variant
from experiments.benchmarks.compiled_cases import make_case
from experiments.benchmarks.truths import Truth
from tests.gap.fits import fit


@pytest.mark.parametrize("kind", ["pulses", "functions"])
def test_nothing_is_left_over_with_the_right_hypothesis(stiffness_case, kind):
    problem = make_problem(stiffness_case[1], VehicleParameters())
    names = ("rear_stiffness_error",)
    right = fit(problem, names, np.append(np.zeros(problem.nuisances), stiffness_case[0].effects[names[0]]))
    assert misfit(problem, right, kind).gain < 5.0


def test_a_crosswind_is_left_over_with_the_nominal_car():
    runs = make_case(Truth({}, {"crosswind": 500.0}), VehicleParameters(), np.random.default_rng(4), 2.0)
    problem = make_problem(runs, VehicleParameters())
    nothing = fit(problem, (), np.zeros(problem.nuisances))
    assert misfit(problem, nothing, "pulses").gain > 50.0


def test_a_force_is_rolled_out_from_where_it_begins_as_from_the_first_row(stiffness_case):
    problem = make_problem(stiffness_case[1], VehicleParameters())
    theta = np.zeros(problem.nuisances)
    nominal, gains = SimpleNamespace(names=(), theta=theta), filter_case(problem, theta, ())
    shapes = pulses(len(problem.runs[0].y), problem.runs[0].period)[:, [0, 4]]
    found = forced(problem, gains, nominal, 0, filtered_states(problem, gains, theta, (), 0), shapes)
    for column, shape in enumerate(shapes.T):
        wrench = np.zeros((len(shape), 3))
        wrench[:, 0] = force_units(problem)[0] * shape
        change = observe_each(problem, gains, 0, [Variant(theta, (), wrench)])[0] - gains.innovations[0]
        np.testing.assert_array_equal(found[:, column], counted(problem, problem.runs[0], change).ravel())
