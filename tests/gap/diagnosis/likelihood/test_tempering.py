"""The likelihood raised to a power: two copies of a log, half a row each, say what the log says once."""

import dataclasses

import numpy as np
import pytest

from drift_drake.car.parameters import VehicleParameters
from drift_drake.gap.estimation.freeform import misfit
from drift_drake.gap.estimation.make_problem import make_problem
from tests.gap.fits import fit

NAMES = ("rear_stiffness_error",)


@pytest.fixture(scope="module")
def once(stiffness_case):
    return make_problem(stiffness_case[1][:1], VehicleParameters())


@pytest.fixture(scope="module")
def twice(once):
    return once.replace(runs=[*once.runs, dataclasses.replace(once.runs[0], name="again")], tempering=0.5)


def fitted(problem, names=NAMES):
    return fit(problem, names, np.append(np.zeros(problem.nuisances), [-0.2] * len(names)))


def test_fits_evidence_and_intervals_are_those_of_one_log(once, twice):
    one, two = fitted(once), fitted(twice)
    assert two.magnitudes[NAMES[0]] == pytest.approx(one.magnitudes[NAMES[0]], rel=1e-6)
    assert two.deviations[NAMES[0]] == pytest.approx(one.deviations[NAMES[0]], rel=1e-6)
    assert two.log_evidence == pytest.approx(one.log_evidence, abs=1e-4)
    assert two.mean_square == pytest.approx(one.mean_square, rel=1e-9)


def test_so_is_what_free_forces_gain(once, twice):
    one, two = (misfit(problem, fitted(problem, ()), "functions") for problem in (once, twice))
    assert two.gain == pytest.approx(one.gain, abs=1e-3)
    assert two.removed == pytest.approx(one.removed, rel=1e-4)


def test_a_smaller_weight_widens_intervals_and_leaves_priors_in_full(once):
    exact = once.replace(exactness=1e-3)
    light = fitted(exact.replace(tempering=0.01))
    assert light.deviations[NAMES[0]] == pytest.approx(10.0 * fitted(exact).deviations[NAMES[0]], rel=0.2)
    tolerance = fitted(once.replace(tempering=1e-9), ()).covariance[0, 0]
    assert tolerance == pytest.approx(1.0, rel=1e-3)
