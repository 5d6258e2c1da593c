"""References that several tests drive."""

import pytest

from drift_drake.car.parameters import VehicleParameters
from drift_drake.drive.reference.trajectory import Reference, figure_8, loops, straight_line


@pytest.fixture(scope="session")
def references() -> dict[str, Reference]:
    parameters = VehicleParameters()
    return {"straight": straight_line(7.5, 20.0, 4.5), "figure_8": figure_8(parameters), "loops": loops(parameters)}
