"""The still of an experiment's runs: which runs, and what is said of those that are not there."""

import sys

import pandas as pd
import pytest

from diagrams import command
from experiments.drifting import still
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


def test_the_command_says_so_in_one_sentence(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["still", str(tmp_path)])
    monkeypatch.setattr(command, "leave_ends_to_the_system", lambda: None)
    monkeypatch.setattr(command, "NAME", "experiments.drifting.still")
    with pytest.raises(SystemExit, match="2"):
        command.run_command(still.main, StillConfig)
    said = capsys.readouterr().err
    assert said.startswith("experiments.drifting.still: ")
    assert "twice_info-000-0.csv: no such run" in said
    assert said.count("\n") == 1
