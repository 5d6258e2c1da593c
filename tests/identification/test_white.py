"""Whether innovations are white: of the true car they are, of a wrong or another kind of car they are not."""

import numpy as np
import pytest

from drift_drake.identification.white import LARGEST, TIED, Whiteness, whiteness
from drift_drake.vehicle.effects import Effects
from drift_drake.vehicle.parameters import VehicleParameters
from experiments.gap_cases import Truth, make_case


@pytest.fixture(scope="module")
def nominal_runs():
    return make_case(Truth({}), VehicleParameters(), np.random.default_rng(3), 2.0)


def test_of_the_true_car_they_are_white(nominal_runs):
    found = whiteness(nominal_runs, VehicleParameters(), Effects(), None)
    assert found.is_white
    assert found.mean_square == pytest.approx(1.0, abs=0.5)


def test_of_a_wrong_car_they_are_not(nominal_runs):
    wrong = VehicleParameters().replace(rear_stiffness=0.4 * VehicleParameters().rear_stiffness)
    found = whiteness(nominal_runs, wrong, Effects(), None)
    assert not found.is_white
    assert "innovations are not white" in found.sentence()


def test_of_another_kind_of_car_they_are_not(other_car):
    assert not whiteness(other_car.runs, other_car.found.vehicle, other_car.found.effects, None).is_white


def test_a_filter_that_diverges_is_not_white(nominal_runs, monkeypatch):
    from drift_drake.identification import white

    def diverged(problem, *_args):
        gains = filter_case(problem, *_args)
        gains.innovations[0][:] = np.nan
        return gains

    filter_case = white.filter_case
    monkeypatch.setattr(white, "filter_case", diverged)
    found = whiteness(nominal_runs, VehicleParameters(), Effects(), None)
    assert found == Whiteness(float("inf"), 1.0)
    assert not found.is_white


@pytest.mark.parametrize(("square", "tied"), [(LARGEST, 0.0), (1.0, TIED)])
def test_either_is_enough_to_be_coloured(square, tied):
    assert not Whiteness(square, tied).is_white
