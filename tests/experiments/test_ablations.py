"""The ablations: what each row changes, and that a run of them is as a user makes it."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from drift_drake.car.parameters import VehicleParameters
from drift_drake.common.executors import ExecutorConfig
from drift_drake.drive.gathering.config import GatheringConfig
from drift_drake.drive.loop.closed_loop import ControlConfig
from drift_drake.drive.reference.trajectory import figure_8
from experiments.drifting import ablations, errors
from experiments.drifting import runs as drift_runs
from experiments.drifting.ablations import AblationsConfig, main, variants


def test_each_row_changes_one_thing() -> None:
    base = ControlConfig()
    rows = variants(base)
    assert len({row.name for row in rows}) == len(rows)
    for row in rows:
        changed = [field.name for field in dataclasses.fields(base)
                   if getattr(row.control, field.name) != getattr(base, field.name)]  # fmt: skip
        assert len(changed) == (0 if row.part in ("belief", "path step") else 1)
        assert (row.path_step == "euler") == (row.part == "path step")


def test_the_chain_of_beliefs(
    here: ExecutorConfig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    course = dataclasses.replace(figure_8(VehicleParameters()), distance=13.0)  # 1 s, and predictions of 0.8 s
    monkeypatch.setattr(drift_runs, "reference", lambda _: course)
    for module in (ablations, errors):
        monkeypatch.setattr(module, "ROLLOUT_STEPS", 8)
    monkeypatch.setattr(ablations, "run_jobs", drift_runs.run_jobs)
    config = AblationsConfig(
        vehicles=1,
        population="train",
        parts=("belief",),
        control=ControlConfig(horizon=6),
        gathering=GatheringConfig(steps=10, v_end=9.0, starts=1),
        run_on=here,
        out=tmp_path,
    )
    main(config)
    lines = [line for line in capsys.readouterr().out.splitlines() if line.startswith("| belief")]
    names = [line.split(" | ")[1] for line in lines]
    assert names == [row.name for row in variants(config.control) if row.part == "belief"]
    # Errors in drifts are of learnt beliefs that stay as they are.
    with_errors = {name for name, line in zip(names, lines, strict=True) if not line.endswith("|  |  |")}
    assert with_errors == set(names) - {"nominal", "online", "oracle"}
    assert np.load(tmp_path / "own-000-0.npz")["x"].shape[1] == 8
    # Samples that count in full leave less unknown of all states together.
    left = []
    for folder in (tmp_path / "full_weight", tmp_path):
        with np.load(folder / "beliefs-000-0.npz") as stored:
            left.append(np.linalg.slogdet(stored["once_info.covariance"])[1])
    assert left[0] < left[1] - 1.0
