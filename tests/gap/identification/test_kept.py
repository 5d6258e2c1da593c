"""Parameters that drives cannot show stay at the first guess, as uncertain as before, for a diagnosis too."""

import dataclasses

import numpy as np
import pytest

from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.parameters import VehicleParameters
from drift_drake.gap.estimation.unknowns import BROAD
from drift_drake.gap.identification import identify as identification
from drift_drake.gap.identification.identify import identify
from drift_drake.gap.identification.stated import kept_at_first_guess, widened_unknown


def test_a_parameter_that_was_fitted_is_stated_as_before(identified):
    found = kept_at_first_guess(identified, VehicleParameters(), Effects(), ("friction",), frozenset())
    p = found.calibration.parameters["friction"]
    assert (p.kind, p.estimate, p.deviation) == ("unseen", VehicleParameters().friction, BROAD.friction)
    assert found.vehicle.tolerance.friction == BROAD.friction
    assert "friction" in {name for direction in found.calibration.not_identified for name in direction.parts}
    assert "friction" not in found.calibration.identified


def test_a_parameter_that_was_held_is_added(other_car):
    found = kept_at_first_guess(other_car.found, other_car.guess, Effects(), ("steering_offset",), frozenset())
    c = found.calibration
    assert c.parameters["steering_offset"].deviation == BROAD.steering_offset
    assert len(c.correlation) == len(c.parameters)
    assert c.outlook["steering_offset"] == [None, None, None]
    assert kept_at_first_guess(other_car.found, other_car.guess, Effects(), (), frozenset()) is other_car.found


def test_a_diagnosis_knows_as_little_of_it(other_car):
    normal, i = other_car.normal, other_car.normal.names.index("steering_offset")
    wide = widened_unknown(normal, {"steering_offset": 0.02})
    assert np.sqrt(wide.unknown[i, i]) * normal.units[i] == pytest.approx(0.02)
    assert np.linalg.eigvalsh(wide.unknown)[0] > -1e-9
    j = (i + 1) % len(normal.names)
    assert wide.unknown[j, j] == normal.unknown[j, j]
    assert np.array_equal(widened_unknown(normal, {"steering_offset": 1e-9}).unknown, normal.unknown)


@pytest.mark.parametrize("criterion", ["prediction", "likelihood"])
def test_friction_stays_where_the_drives_do_not_show_it(strange_car_runs, monkeypatch, criterion):
    """What the drives show is stated otherwise here: the same runs, and friction called unseen."""
    monkeypatch.setattr(identification, "FURTHER", ())
    driving_of = identification.driving_of
    monkeypatch.setattr(identification, "driving_of", lambda *given: dataclasses.replace(driving_of(*given), used=0.3))
    first = VehicleParameters(friction=1.05)
    runs = [run.rows(0, 300) for run in strange_car_runs[:2]]
    found = identify(runs, first, effects=(), criterion=criterion, force=True, watching=False)
    assert found.vehicle.friction == pytest.approx(1.05, abs=1e-3)
    assert found.calibration.parameters["friction"].kind == "unseen"
    assert any("friction: kept at the first guess" in warning for warning in found.calibration.warnings)
