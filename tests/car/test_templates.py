"""Vehicles to begin with can be some vehicle's, and are written and read back."""

import pytest

from drift_drake.car.templates import TEMPLATES
from drift_drake.car.vehicle_file import check_plausible, read_vehicle, write_vehicle


@pytest.mark.parametrize("name", TEMPLATES)
def test_a_template_is_a_vehicle(name, tmp_path):
    check_plausible(TEMPLATES[name], name)
    write_vehicle(tmp_path / "car.yaml", TEMPLATES[name])
    assert read_vehicle(tmp_path / "car.yaml")[0] == TEMPLATES[name]
