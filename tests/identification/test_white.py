"""Whether innovations are white: of the true car they are, of a wrong or another kind of car they are not."""

import numpy as np
import pytest

from drift_drake.benchmarks.compiled_cases import make_case
from drift_drake.benchmarks.truths import Truth
from drift_drake.identification.whiteness import NEAR, Whiteness, whiteness
from drift_drake.vehicle.effects import Effects
from drift_drake.vehicle.parameters import VehicleParameters


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
    from drift_drake.identification import whiteness as module

    def diverged(problem, *_args):
        gains = filter_case(problem, *_args)
        gains.innovations[0][:] = np.nan
        return gains

    filter_case = module.filter_case
    monkeypatch.setattr(module, "filter_case", diverged)
    found = whiteness(nominal_runs, VehicleParameters(), Effects(), None)
    assert found == Whiteness(float("inf"), 1.0)
    assert not found.may_be_white


def test_far_from_white_no_fit_by_likelihood_is_tried():
    assert Whiteness(0.9 * NEAR, 0.9).may_be_white
    assert not Whiteness(NEAR, 0.0).may_be_white
