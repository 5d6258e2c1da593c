"""The order of candidates and the evidence over exactnesses."""

import numpy as np
import pytest

from drift_drake.car.parameters import VehicleParameters
from drift_drake.gap.diagnosis.likelihood.search import Candidate, best_of, canonical, handed_over, hypotheses_of
from drift_drake.gap.estimation.fit import Fit
from drift_drake.gap.estimation.make_problem import make_problem
from drift_drake.gap.estimation.problem import NUISANCES


def test_the_best_candidate_of_each_set_of_effects_survives():
    theta = np.zeros(3)
    kept = best_of(
        [
            Candidate(("a", "b"), theta, 5.0),
            Candidate(("b", "a"), theta, 4.0),
            Candidate(("c",), theta, 4.5),
        ]
    )
    assert [c.names for c in kept] == [("b", "a"), ("c",)]


def test_canonical_order_takes_the_magnitudes_along():
    names, theta = canonical(("torque_lag", "aero_drag"), np.array([9.0, 8.0, 0.2, 1.5]))
    assert names == ("aero_drag", "torque_lag")
    np.testing.assert_array_equal(theta, [9.0, 8.0, 1.5, 0.2])


def test_evidence_is_the_mean_over_exactnesses():
    def fitted(evidence, exactness):
        return Fit(("a",), np.zeros(3), 0.0, np.eye(3), evidence, 1.0, 1, exactness)

    ((best, evidence),) = hypotheses_of({(("a",), 1.0): fitted(2.0, 1.0), (("a",), 0.05): fitted(3.0, 0.05)})
    assert best.exactness == 0.05
    assert evidence == pytest.approx(np.log(0.5 * (np.exp(2.0) + np.exp(3.0))))


def test_a_stretched_deviation_is_handed_over_to_its_effect(stiffness_case):
    problem = make_problem(stiffness_case[1], VehicleParameters())
    theta = np.zeros(problem.nuisances + 1)
    at = NUISANCES.index("friction")
    theta[at], theta[-1] = -20.0, 0.05
    seed = Fit(("steering_lag",), theta, 0.0, np.eye(len(theta)), 0.0, 1.0, 1)
    (candidate,) = handed_over(problem, seed, ["friction_level", "mass_error"])
    assert candidate.names == ("steering_lag", "friction_level")
    assert candidate.theta[at] == 0.0
    np.testing.assert_allclose(candidate.theta[-2:], [0.05, -0.2])
    assert handed_over(problem, seed, ["mass_error"]) == []
