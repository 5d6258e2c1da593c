"""The closed loop on a reference.

python -m diagrams.closed_loop            # drives the figure-8, writes numbers, pictures and the 3D replay
python -m diagrams.closed_loop --graph    # draws the diagram
"""

from diagrams.command import run_command
from drift_drake.cli.drive_run import ClosedLoopConfig, main

if __name__ == "__main__":
    run_command(main, ClosedLoopConfig)
