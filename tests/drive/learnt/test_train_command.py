"""`drift-drake train`."""

from pathlib import Path

import numpy as np
import pytest

from drift_drake.cli.main import main
from drift_drake.drive.learnt.checkpoint import load_model
from drift_drake.drive.learnt.command_lag import lagged_commands
from drift_drake.drive.learnt.samples import Samples, save_samples


def test_it_names_a_table_that_is_not_there(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("torch", reason="training needs the extra `train`")
    assert main(["train", "--data", str(tmp_path / "train.npz"), "--output", str(tmp_path / "model.npz")]) == 2
    assert "train.npz: no such file" in capsys.readouterr().err


def test_it_writes_a_checkpoint(tmp_path: Path) -> None:
    pytest.importorskip("torch", reason="training needs the extra `train`")
    generator = np.random.default_rng(0)
    x = np.array([0.4, 11.0, -0.5, 16.0, 0.0, 0.0]) + 0.1 * generator.normal(size=(41, 6))
    u = np.array([-0.1, 150.0]) + 0.05 * generator.normal(size=(41, 2))
    x = np.hstack([x, lagged_commands(0.1 * np.arange(41), u)])
    number = np.zeros(40, dtype=int)
    save_samples(Samples(x[:-1], u[:-1], u[1:], x[1:], np.zeros(40), number, number), tmp_path / "train.npz")
    arguments = ["--data", str(tmp_path / "train.npz"), "--output", str(tmp_path / "model.npz"), "--validation", "None",
                 "--epochs", "2", "--threads", "1"]  # fmt: skip
    assert main(["train", *arguments, "--recipe", "windows"]) == 0
    model = load_model(tmp_path / "model.npz")
    assert model.record["epochs"] == 2
    assert model.record["config"]["data"] == "train.npz"
    np.testing.assert_array_equal(model.sample_weight, np.ones(4))
