"""The models between the paper's recipe and the shipped one: what each is given, and what is said of them."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from drift_drake.drive.learnt.samples import Samples, save_samples
from drift_drake.drive.learnt.training_config import TrainingConfig, with_recipe
from experiments.model import ladder


def test_each_model_changes_one_thing_of_the_one_before(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[tuple[str, Any]] = []
    monkeypatch.setattr(ladder.drives, "main", lambda config: calls.append(("drives", config)))
    monkeypatch.setattr(ladder.lane_drives, "main", lambda config: calls.append(("lane", config)))
    monkeypatch.setattr(ladder, "run_train", lambda command: calls.append((command.config.output.stem, command.config)))
    monkeypatch.setattr(ladder, "judged", lambda _config: made_up())
    ladder.main(ladder.LadderConfig(output=tmp_path, seed=3, epochs=500))
    assert [name for name, _ in calls] == ["drives", "plain", "actuators", "tyres", "coupled", "lane", "tasks"]
    found = dict(calls)
    paper = with_recipe(TrainingConfig(), "paper")
    same = {"horizons", "shuffled_share", "learning_rate", "batch", "weight_decay", "gradient_clip", "temper", "lane"}
    for name in ("plain", "actuators", "tyres", "coupled"):
        assert all(getattr(found[name], field) == getattr(paper, field) for field in same)
        assert (found[name].epochs, found[name].seed) == (500, 3)
        assert found[name].decay ** 500 == pytest.approx(paper.decay**1000)
    inputs = [(found[name].physical_inputs, found[name].physical_inputs and found[name].tyres, found[name].coupled)
              for name in ("plain", "actuators", "tyres", "coupled")]  # fmt: skip
    assert inputs == [(False, False, False), (True, False, False), (True, True, False), (True, True, True)]
    assert found["lane"].checkpoint == found["coupled"].output
    assert found["tasks"].lane == tmp_path / "drives" / "train_lane_phases.npz"
    assert (found["tasks"].epochs, found["tasks"].epoch_batches) == (500, 12)
    calls.clear()
    ladder.main(ladder.LadderConfig(output=tmp_path, seed=3, epochs=500))
    assert not calls
    assert "the paper's recipe" in (tmp_path / "report.md").read_text()


def made_up() -> dict[str, Any]:
    """Errors of two vehicles, halved by each model."""

    def entry(error: float) -> dict[str, Any]:
        return {"one_step": [[error] * 4] * 2, "two_seconds": [[3.0 * error] * 4] * 2, "within": [0.9, 1.0]}

    models = {name: {"0": entry(0.6 * 0.5**k), "100": entry(0.5 * 0.5**k)} for k, name in enumerate(ladder.WHAT)}
    return {"nominal": entry(1.0), **models}


def test_errors_are_shares_of_the_nominal_cars_and_of_those_before() -> None:
    rows = ladder.markdown(made_up()).splitlines()[2:]
    assert len(rows) == len(ladder.WHAT)
    assert rows[1].startswith(
        "| the paper's recipe | 0.30 (0.30 to 0.30) | 0.25 (0.25 to 0.25) | 0.30 (0.30 to 0.30) |"
    )
    assert rows[1].endswith("| 95.0 % | 95.0 % | 0.50 (0.50 to 0.50) | 0.50 (0.50 to 0.50) |")


def test_all_models_are_judged_on_the_same_vehicles(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    generator = np.random.default_rng(0)
    count, drives = 480, 4  # two vehicles of eight drives
    x = np.array([0.4, 11.0, -0.5, 16.0, 0.0, 0.0, -0.1, 150.0]) + 0.01 * generator.normal(size=(count, 8))
    u = x[:, 6:].copy()
    drive = np.repeat(np.arange(2 * 2 * drives), count // (4 * drives))
    table = Samples(x, u, u, x + 0.01, np.zeros(count), drive // (2 * drives), drive)
    (tmp_path / "drives").mkdir()
    save_samples(table, tmp_path / "drives" / "held_out.npz")
    monkeypatch.setattr(ladder, "WHAT", {"paper": "one", "shipped": "other"})
    result = ladder.judged(ladder.LadderConfig(output=tmp_path))
    assert list(result) == ["nominal", "paper", "shipped"]
    assert np.shape(result["shipped"]["100"]["two_seconds"]) == (2, 4)
    assert np.isfinite(result["paper"]["0"]["one_step"]).all()
    assert np.shape(result["paper"]["100"]["within"]) == (2,)
