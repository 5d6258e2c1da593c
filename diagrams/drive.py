"""Draws the diagram of a drive (`drift_drake.drive.loop.drive`), here that of an LQR hold.

python -m diagrams.drive
"""

from pathlib import Path

import numpy as np

from diagrams.command import run_command
from drift_drake.car.parameters import VehicleParameters
from drift_drake.common.run_folder import make_run_folder
from drift_drake.drive.loop.drive import Drive
from drift_drake.drive.manoeuvres.drivers import ROW_PERIOD
from drift_drake.drive.reference.equilibrium import drift_equilibrium
from drift_drake.view.pictures.graph import draw_graph
from experiments.benchmarks.drifters import HoldDriver


def main(out: Path | None = None) -> None:
    """Draws the diagram of a drive (an LQR hold)."""
    parameters = VehicleParameters()
    drift = drift_equilibrium(parameters, 18.0, -0.6)
    driver = HoldDriver(parameters, drift, np.zeros((2, 2)))
    drive = Drive(parameters, driver, 1, ROW_PERIOD, None, driver.initial_command())
    for path in draw_graph(drive.diagram, make_run_folder("drive", out) / "drive"):
        print(path)


if __name__ == "__main__":
    run_command(main)
