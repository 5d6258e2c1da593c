"""A car with two effects, its vehicle files, and logs of it."""

from pathlib import Path

import pytest

from drift_drake.car.effects.magnitudes import make_effects
from drift_drake.car.log.table import Run, write_run
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.vehicle_file import write_vehicle
from drift_drake.drive.manoeuvres.options import Simulate
from drift_drake.drive.manoeuvres.simulate import simulate_drive
from drift_drake.view.playback.side_by_side import CarModel

NOMINAL = CarModel(VehicleParameters())
TRUE = CarModel(VehicleParameters(), make_effects({"steering_lag": 0.12, "gyro_bias": 0.03, "sensor_latency": 0.04}))


@pytest.fixture(scope="session")
def cars() -> dict[str, CarModel]:
    return {"nominal": NOMINAL, "corrected": TRUE}


@pytest.fixture(scope="session")
def slalom() -> Run:
    command = Simulate("slalom", Path("car.yaml"), Path("run_0.csv"), duration=4.0, steering=0.4)
    return simulate_drive(command, *TRUE)[0]


@pytest.fixture
def files(tmp_path: Path, slalom: Run) -> Path:
    """A folder with car.yaml, true.yaml and run_0.csv."""
    write_vehicle(tmp_path / "car.yaml", *NOMINAL)
    write_vehicle(tmp_path / "true.yaml", *TRUE)
    write_run(slalom, tmp_path / "run_0.csv")
    return tmp_path
