"""Free-form forces: silent beside the right hypothesis, loud beside a wrong one."""

import numpy as np
import pytest

from drift_drake.benchmarks.compiled_cases import make_case
from drift_drake.benchmarks.truths import Truth
from drift_drake.estimation.fit import fit
from drift_drake.estimation.freeform import misfit
from drift_drake.estimation.problem import make_problem
from drift_drake.vehicle.parameters import VehicleParameters


@pytest.mark.parametrize("kind", ["pulses", "functions"])
def test_nothing_is_left_beside_the_right_hypothesis(stiffness_case, kind):
    problem = make_problem(stiffness_case[1], VehicleParameters())
    names = ("rear_stiffness_error",)
    right = fit(problem, names, np.append(np.zeros(problem.nuisances), stiffness_case[0].effects[names[0]]))
    assert misfit(problem, right, kind).gain < 5.0


def test_a_crosswind_is_left_beside_the_nominal_car():
    runs = make_case(Truth({}, {"crosswind": 500.0}), VehicleParameters(), np.random.default_rng(4), 2.0)
    problem = make_problem(runs, VehicleParameters())
    nothing = fit(problem, (), np.zeros(problem.nuisances))
    assert misfit(problem, nothing, "pulses").gain > 50.0
