"""Whether innovations are white: of the true car they are, of a wrong or another kind of car they are not."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import chi2

from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.parameters import VehicleParameters
from drift_drake.gap.identification.estimate import NEAR, Whiteness, whiteness
from experiments.benchmarks.compiled_cases import make_case
from experiments.benchmarks.truths import Truth


@pytest.fixture(scope="module")
def nominal_runs():
    return make_case(Truth({}), VehicleParameters(), np.random.default_rng(3), 2.0)


def test_of_the_true_car_they_are_white(nominal_runs):
    found = whiteness(nominal_runs, VehicleParameters(), Effects(), None)
    assert found.may_be_white
    assert found.correlation < 0.3
    assert found.mean_square == pytest.approx(1.0, abs=0.5)


def test_of_a_wrong_car_they_are_not(nominal_runs):
    wrong = VehicleParameters().replace(rear_stiffness=0.4 * VehicleParameters().rear_stiffness)
    found = whiteness(nominal_runs, wrong, Effects(), None)
    assert found.mean_square > 2.0
    assert found.correlation > 0.5
    assert "innovations are not white" in found.sentence()
    assert "inf" not in Whiteness(np.inf, 1.0).sentence()


def test_of_another_kind_of_car_they_are_not(other_car):
    found = whiteness(other_car.runs, other_car.found.vehicle, other_car.found.effects, None)
    assert found.mean_square > 2.0


def test_a_filter_that_diverges_is_not_white(nominal_runs, monkeypatch):
    from drift_drake.gap.identification import estimate as module

    def diverged(problem, *_args):
        gains = filter_case(problem, *_args)
        gains.innovations[0][:] = np.nan
        return gains

    filter_case = module.filter_case
    monkeypatch.setattr(module, "filter_case", diverged)
    found = whiteness(nominal_runs, VehicleParameters(), Effects(), None)
    assert found == Whiteness(float("inf"), 1.0)
    assert not found.may_be_white


def test_numbers_are_those_of_known_innovations(nominal_runs, monkeypatch):
    """White noise of variance 4, and a first-order recursion of correlation 0.6, in place of a filter's innovations."""
    from drift_drake.gap.identification import estimate as module

    rng = np.random.default_rng(2)

    def put_in(recursion):
        def filtered(problem, *_args):
            innovations = []
            for run in problem.runs:
                e = np.zeros((len(run.counted), len(run.used)))
                for row in range(1, len(e)):
                    noise = np.sqrt(1.0 - recursion**2) * rng.standard_normal(e.shape[1])
                    e[row] = recursion * e[row - 1] + 2.0 * noise
                innovations.append(e)
            return SimpleNamespace(innovations=innovations)

        return filtered

    for recursion in (0.0, 0.6):
        monkeypatch.setattr(module, "filter_case", put_in(recursion))
        found = whiteness(nominal_runs, VehicleParameters(), Effects(), None)
        assert found.mean_square == pytest.approx(4.0, rel=0.25)
        assert found.correlation == pytest.approx(recursion if recursion else 0.1, abs=0.12)


def test_a_median_of_squares_is_that_of_a_normal():
    assert chi2.median(1) == pytest.approx(0.4549, abs=1e-4)


def test_far_from_white_no_fit_by_likelihood_is_tried():
    assert Whiteness(0.9 * NEAR, 0.9).may_be_white
    assert not Whiteness(NEAR, 0.0).may_be_white
