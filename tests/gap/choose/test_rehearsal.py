"""Cars that can be drifted and cars that cannot, rehearsed in simulation."""

import dataclasses

import pytest

from drift_drake.car.double_track.parameters import CARS
from drift_drake.car.effects.magnitudes import Effects, make_effects
from drift_drake.car.parameters import CarParameters, VehicleParameters
from drift_drake.gap.choose.identified import IdentifiedCar
from drift_drake.gap.choose.rehearsal import Rehearsal, rehearse

COUPE = VehicleParameters()


@pytest.mark.parametrize("car", [pytest.param(COUPE, id="single-track"),
                                 pytest.param(CARS["coupe"], id="double-track", marks=pytest.mark.slow)])  # fmt: skip
def test_a_car_that_drifts(car: CarParameters) -> None:
    found = rehearse(IdentifiedCar(car, Effects()), COUPE)
    assert found.can
    assert found.sentence().startswith("rehearsed in simulation, the identified car drifts the figure-8 (RMS e 0.")


@pytest.mark.parametrize("effects", [{"torque_gain_error": -0.9}, {"steering_rate_limit": 0.2}], ids=str)
def test_a_car_without_the_torque_or_with_slow_steering(effects: dict[str, float]) -> None:
    found = rehearse(IdentifiedCar(COUPE, make_effects(effects)), COUPE)
    assert not found.can
    assert found.sentence().startswith("do not drift this car: ")


def test_a_figure_8_that_the_vehicle_files_car_has_not() -> None:
    weak = dataclasses.replace(COUPE, torque_max=40.0)
    found = rehearse(IdentifiedCar(COUPE, Effects()), weak)
    assert not found.can
    assert found.outcome in found.sentence()


def test_a_run_to_the_end_without_drifts_is_none() -> None:
    assert not Rehearsal("completed", 1.0, 0.2, 0.1).can
