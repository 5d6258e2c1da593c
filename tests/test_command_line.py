"""The command line that a report states is the one that gives the same command again."""

from pathlib import Path

import tyro

from drift_drake.cli.diagnose import Diagnose
from drift_drake.common.standard_output import command_line


def test_a_stated_command_is_the_command():
    command = Diagnose(Path("logs/a day"), Path("car.yaml"), every=2, exclude=("mass_error", "aero_drag"), quiet=True)
    stated = command_line("diagnose", command, "case")
    assert stated == (
        "drift-drake diagnose 'logs/a day' --vehicle car.yaml --exclude mass_error aero_drag --every 2 --quiet"
    )
    words = ["logs/a day", *stated.split("'")[2].split()]
    assert tyro.cli(Diagnose, args=words) == command
