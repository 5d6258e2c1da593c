"""The figure-8 experiment as a user calls it."""

import json
from pathlib import Path

import pandas as pd
import pytest

from diagrams.closed_loop import ControlConfig
from experiments.figure_8 import Figure8Config, main, summarise, table


def runs() -> pd.DataFrame:
    return pd.DataFrame({
        "model": ["prior"] * 3 + ["oracle"] * 3,
        "completed": [False, True, True, True, True, True],
        "completion": [0.4, 1.0, 1.0, 1.0, 1.0, 1.0],
        "rms_e": [2.0, 0.5, 1.0, 0.1, 0.2, 0.3],
        "rms_sideslip_error": [0.3, 0.1, 0.2, 0.04, 0.05, 0.06],
        "solve_ms_median": [1.0] * 6,
        "solver_failures": [3, 0, 1, 0, 0, 0],
    })  # fmt: skip


def test_summary_counts_failures_too() -> None:
    prior = summarise(runs())["prior"]
    assert prior["runs"] == 3
    assert prior["completed"] == pytest.approx(2.0 / 3.0)
    assert (prior["rms_e_best"], prior["rms_e_median"], prior["rms_e_worst"]) == (0.5, 1.0, 2.0)
    assert prior["solver_failures"] == 4


def test_table_is_markdown() -> None:
    lines = table(summarise(runs())).splitlines()
    assert lines[2] == "| prior | 3 | 67% | 0.50 / 1.00 / 2.00 | 0.100 / 0.200 / 0.300 |"
    assert len(lines) == 4


def test_runs_and_resumes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    config = Figure8Config(
        vehicles=1,
        population="train",
        models=("nominal", "online"),
        control=ControlConfig(horizon=12, period=0.05, delay=0.05),
        workers=1,
        out=tmp_path,
    )
    main(config)
    assert "| online | 1 |" in capsys.readouterr().out
    numbers = json.loads((tmp_path / "numbers.json").read_text())
    assert set(numbers) == {"nominal", "online"}
    assert numbers["nominal"]["runs"] == 1
    assert {"overhead.png", "time_series.png", "runs.csv", "config.json", "versions.json"} <= {
        path.name for path in tmp_path.iterdir()
    }
    before = (tmp_path / "online-000-0.csv").stat().st_mtime_ns
    main(config)
    assert (tmp_path / "online-000-0.csv").stat().st_mtime_ns == before
