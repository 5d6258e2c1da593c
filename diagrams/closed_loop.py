"""The closed loop on a reference.

python -m diagrams.closed_loop            # drives the figure-8, writes numbers, pictures and the 3D replay
python -m diagrams.closed_loop --graph    # draws the diagram
"""

import sys

import tyro

from drift_drake.errors import DriftDrakeError
from drift_drake.simulation.drive_command import ClosedLoopConfig, main

if __name__ == "__main__":
    try:
        main(tyro.cli(ClosedLoopConfig))
    except DriftDrakeError as error:
        sys.exit(f"error: {error}")
