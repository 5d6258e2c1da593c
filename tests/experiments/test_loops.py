"""The loops experiment: when a drift is established, and a run as a user makes it."""

import dataclasses
import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from drift_drake.car.parameters import VehicleParameters
from drift_drake.common.executors import ExecutorConfig
from drift_drake.drive.loop.closed_loop import ControlConfig
from drift_drake.drive.reference.trajectory import Reference, loops
from experiments.drifting import runs as drift_runs
from experiments.drifting.loops import (
    LoopsConfig,
    established_after,
    initiation,
    initiation_table,
    main,
    summarise_loops,
)


@pytest.fixture(scope="module")
def course() -> Reference:
    return loops(VehicleParameters())


def on_the_reference(course: Reference) -> pd.DataFrame:
    s = np.arange(0.0, course.distance, 0.2)
    return pd.DataFrame({"s": s, "beta": course.state(s)[:, 2], "e": 0.0})


def test_the_initiation_is_the_transition_from_grip_to_drift(course: Reference) -> None:
    begin, end = initiation(course)
    assert (begin, end) == pytest.approx((70.0, 100.0), abs=1.0)
    beta = course.state(np.array([begin, end]))[:, 2]
    assert beta == pytest.approx([0.0, -0.6], abs=0.02)


def test_a_drift_on_the_reference_is_established_at_the_initiations_end(course: Reference) -> None:
    assert established_after(on_the_reference(course), course) == pytest.approx(30.0, abs=1.0)


def test_a_late_drift_counts_from_where_it_is_held(course: Reference) -> None:
    table = on_the_reference(course)
    table.loc[table["s"].between(80.0, 150.0), "beta"] += 0.3
    table.loc[table["s"].between(155.0, 170.0), "e"] = 1.5
    begin, _ = initiation(course)
    assert established_after(table, course) == pytest.approx(170.0 - begin, abs=1.0)


def test_a_drift_that_never_comes(course: Reference) -> None:
    table = on_the_reference(course)
    assert established_after(table.assign(e=2.0), course) == np.inf
    assert established_after(table[table["s"] < 110.0], course) == np.inf
    assert established_after(table[table["s"] < 50.0], course) == np.inf


def test_runs_without_a_drift_stay_in_the_quantiles() -> None:
    runs = pd.DataFrame({
        "model": ["online"] * 3, "vehicle": [0, 1, 2], "completed": [True, True, False], "drifting": [1.0, 1.0, 0.0],
        "completion": [1.0, 1.0, 0.2], "outcome": ["completed", "completed", "spin"], "rms_e": [0.1, 0.2, 1.0],
        "rms_sideslip_error": [0.1, 0.1, 0.3], "solve_ms_median": [1.0] * 3, "solver_failures": [0] * 3,
        "established_after": [35.0, 60.0, np.inf]})  # fmt: skip
    lines = initiation_table(summarise_loops(runs)).splitlines()
    assert lines[2] == "| prior, adapting | 35 / 60 / never / never | 1 of 3 |"


@pytest.mark.usefixtures("undrawn")
def test_the_experiment(
    course: Reference, here: ExecutorConfig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    short = dataclasses.replace(course, distance=130.0)
    monkeypatch.setattr(drift_runs, "reference", lambda _: short)
    control = ControlConfig(horizon=12, period=0.05, delay=0.05)
    config = LoopsConfig(vehicles=1, population="train", noise_seeds=1, models=("nominal",), control=control,
                         run_on=here, out=tmp_path)  # fmt: skip
    main(config)
    assert "established_after" in json.loads((tmp_path / "numbers.json").read_text())["nominal"]
    assert {"overhead.png", "time_series.png", "report.md"} <= {path.name for path in tmp_path.iterdir()}
