"""The still of an experiment's runs: which runs, and what is said of those that are not there."""

import subprocess
import sys

import pandas as pd
import pytest

from experiments.drifting.still import StillConfig, read_runs


def test_runs_are_read_under_their_models_names(tmp_path):
    table = pd.DataFrame({"t": [0.0, 0.1], "x": [0.0, 1.0], "y": 0.0, "psi": 0.0, "delta": 0.0})
    for model in ("twice_info", "nominal"):
        table.to_csv(tmp_path / f"{model}-003-1.csv", index=False)
    runs = read_runs(StillConfig(tmp_path, vehicle=3, attempt=1, models=("twice_info", "nominal")))
    assert list(runs) == ["Twice-Info", "nominal car"]
    pd.testing.assert_frame_equal(runs["nominal car"], table)


def test_a_run_that_is_not_there_is_named(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"oracle-000-0\.csv: no such run; give --models"):
        read_runs(StillConfig(tmp_path, models=("oracle",)))


def test_the_command_says_so_in_one_sentence(tmp_path):
    done = subprocess.run(
        [sys.executable, "-m", "experiments.drifting.still", str(tmp_path)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 2
    assert done.stderr.startswith("experiments.drifting.still: ")
    assert "twice_info-000-0.csv: no such run" in done.stderr
    assert done.stderr.count("\n") == 1
