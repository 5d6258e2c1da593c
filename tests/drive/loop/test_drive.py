"""A short drive by each kind of driver: it runs, replays, and is logged as the log format says."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from drift_drake.car.log.table import COLUMNS, read_case
from drift_drake.car.parameters import VehicleParameters
from drift_drake.drive.learnt.samples import DECIMATION, load_samples, samples_from_log
from drift_drake.drive.loop.drive import Drive, DriveLimits
from drift_drake.drive.manoeuvres.drivers import ROW_PERIOD
from drift_drake.drive.reference.equilibrium import drift_equilibrium
from experiments.benchmarks.drifters import HoldDriver, dither
from experiments.benchmarks.vehicles import draw_effects
from experiments.model import drives

CAR = VehicleParameters()


@pytest.fixture(scope="module")
def hold() -> tuple[Drive, np.ndarray]:
    drift = drift_equilibrium(CAR, 18.0, -0.6)
    driver = HoldDriver(CAR, drift, np.zeros((2, 2)))
    knots = dither(2.0, np.random.default_rng(0))
    drive = Drive(CAR, driver, 1, ROW_PERIOD, knots, driver.initial_command(), draw_effects("train", 1, 0))
    return drive, np.array([drift.r, drift.v, drift.beta, drift.omega_r, 0.0, 0.0])


def test_a_held_drift_goes_on_and_replays(hold: tuple[Drive, np.ndarray]) -> None:
    drive, state = hold
    table, ending = drive.run(state, 0.0, 1.5, seed=3)
    assert ending == "time"
    np.testing.assert_allclose(table["t"], 0.01 * np.arange(151), atol=1e-9)
    assert np.abs(table["beta"] + 0.6).max() < 0.3
    again, _ = drive.run(state, 0.0, 1.5, seed=3)
    pd.testing.assert_frame_equal(table, again, check_exact=True)
    other, _ = drive.run(state, 0.0, 1.5, seed=4)
    assert np.abs(other["r"] - table["r"]).max() > 1e-4
    assert len(samples_from_log(table, None, 0, 0).x) == 15


def test_a_drive_ends_at_its_limits(hold: tuple[Drive, np.ndarray]) -> None:
    drive, state = hold
    table, ending = drive.run(state, 0.0, 1.5, seed=3, limits=DriveLimits(max_speed=1.0))
    assert ending == "speed"
    assert len(table) < 3


@pytest.mark.slow
def test_a_vehicle_is_driven_in_every_way_until_enough_samples_are_there(tmp_path: Path) -> None:
    drives.drive_vehicle(tmp_path, "train", 0, seed=5, wanted=250)
    folder = tmp_path / "train" / "vehicle_00"
    samples, phases = load_samples(folder / "samples.npz"), load_samples(folder / "phases.npz")
    about = json.loads((folder / "drives.json").read_text())
    kept = 250 - len(about["drives"])  # the first sample of each is left out
    assert len(samples.x) == kept
    np.testing.assert_array_equal(phases.x[:kept], samples.x)
    assert {drive["kind"] for drive in about["drives"]} >= {"mpc_figure_8", "hold", "manual", "mpc_loops"}
    runs = read_case(folder)
    assert len(runs) == len(about["drives"])
    for run in runs:
        assert [name for name in COLUMNS if run.column(name) is None] == ["bank"]  # of the road, which is level
        np.testing.assert_allclose(np.diff(run.t), 0.01, atol=1e-8)
    for run, drive in zip(runs, samples.drives(), strict=True):
        np.testing.assert_allclose(drive.x[0, 1], run.column("v")[DECIMATION], rtol=1e-6)
