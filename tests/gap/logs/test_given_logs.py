"""Logs as functions are given them."""

from pathlib import Path

import numpy as np
import pytest

from drift_drake.car.log.cases import logs_given
from drift_drake.car.log.table import InvalidLogError, Run, write_run


@pytest.fixture
def run() -> Run:
    t = 0.01 * np.arange(200)
    return Run(name="run_0", t=t, r=0.1 * np.sin(t), v=12.0 + 0.1 * np.cos(t), delta_cmd=0.01 * np.sin(t))


def test_paths_and_runs_are_the_same_logs(run: Run, tmp_path: Path) -> None:
    folder = tmp_path / "monday"
    folder.mkdir()
    write_run(run, folder / "run_0.csv")
    for logs in (folder, str(folder), folder / "run_0.csv"):
        given = logs_given(logs)
        np.testing.assert_allclose(given.runs[0].r, run.r, rtol=1e-6)
    assert logs_given(folder).case == "monday"
    assert logs_given(run).runs == logs_given([run]).runs == [run]
    assert logs_given([run], "mine").case == "mine"


@pytest.mark.parametrize("logs", [[], 3, None, ["a", 1]])
def test_what_is_no_log_is_said(logs: object) -> None:
    with pytest.raises(InvalidLogError, match="holds no runs; give a folder's or a file's path"):
        logs_given(logs)  # type: ignore[arg-type]
