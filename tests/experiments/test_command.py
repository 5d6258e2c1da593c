"""What all experiments refuse before they begin."""

import dataclasses
import subprocess
import sys

import pytest

from diagrams.command import check_whole_numbers
from drift_drake.common.errors import InvalidOptionError
from experiments.drifting.figure_8 import ModelsConfig
from experiments.made import ROOT


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"vehicles": 0}, "--vehicles 0: give 1 or more"),
        ({"noise_seeds": -1}, "--noise-seeds -1: give 1 or more"),
        ({"vehicle_seed": -3}, "--vehicle-seed -3: give 0 or more"),
        ({"first": -1}, "--first -1: give 0 or more"),
    ],
)
def test_a_count_of_nothing_and_a_negative_number_are_refused(changes: dict[str, int], says: str) -> None:
    check_whole_numbers(ModelsConfig())
    with pytest.raises(InvalidOptionError, match=says):
        check_whole_numbers(dataclasses.replace(ModelsConfig(), **changes))


def test_an_experiment_says_so_in_one_sentence() -> None:
    words = [sys.executable, "-m", "experiments.robustness.interruptions", "--seed", "-1"]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 2
    assert done.stderr == "experiments.robustness.interruptions: --seed -1: give 0 or more\n"
