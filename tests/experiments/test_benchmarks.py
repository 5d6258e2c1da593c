"""The benchmarks of simulation and of training, at a size that says nothing of times."""

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from drift_drake.drive.gathering.config import GatheringConfig
from experiments.drifting import benchmark_simulation
from experiments.gap import benchmark_memory, benchmark_rollouts
from experiments.gathering import benchmark_planning


def test_the_car_alone_is_driven_and_its_derivatives_counted() -> None:
    found = benchmark_simulation.car_alone(0.5, 0)
    assert found["ended early"] == 0.0
    assert found["derivatives a second"] > 300.0  # three at each step of 10 ms at most
    assert 0.0 < found["share of the plant's derivatives"] < 1.0
    assert found["of these alone"] > found["seconds for one of CPU"]


def test_a_method_that_was_counted_is_itself_again() -> None:
    owner = type("Owner", (), {"twice": lambda _, x: 2 * x})()
    with benchmark_simulation.Counted(owner, "twice") as counted:
        assert [owner.twice(k) for k in (1, 2)] == [2, 4]
    assert counted.calls == 2
    assert "twice" not in vars(owner)


def test_simulation_s_numbers_are_a_table() -> None:
    text = benchmark_simulation.table({"machine": "a machine", "memory": {"MB a loop built": 1.2345}})
    assert text.splitlines()[-1] == "| memory | MB a loop built | 1.23 |"


def test_plans_are_timed_by_the_iteration(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    small = GatheringConfig(steps=12, v_end=9.0, starts=2)
    monkeypatch.setattr(benchmark_planning, "GatheringConfig", lambda: small)
    benchmark_planning.main(benchmark_planning.BenchmarkConfig(vehicles=1, out=tmp_path / "out"))
    rows = (tmp_path / "out" / "report.md").read_text().splitlines()
    plans = ["| Info-OCP, first", "| Info-OCP, later"]
    assert [row.split(" | ")[0] for row in rows if "Info-OCP" in row] == plans


def test_rollouts_are_counted_with_drakes(tmp_path: Path) -> None:
    config = benchmark_rollouts.BenchmarkConfig(repeats=1, out=tmp_path / "out")
    benchmark_rollouts.main(config)
    found = json.loads((tmp_path / "out" / "numbers.json").read_text())
    assert all(len(kind["rates"]) == 1 and kind["rates"][0] > 0.0 for kind in found.values())
    assert found["filter over a run"]["seconds"] == found["the car alone in Drake"]["seconds"]
    report = (tmp_path / "out" / "report.md").read_text()
    assert "| prediction from a window | 0.5 |" in report


def test_a_command_s_memory_and_time_are_its_own() -> None:
    found = benchmark_memory.measured(["--version"])
    assert 5.0 < found["memory"] < 2000.0
    assert found["cpu"] > 0.0
    with pytest.raises(RuntimeError, match="nonsense"):
        benchmark_memory.measured(["nonsense"])


def test_logs_of_each_size_are_made_once_and_given_to_the_commands(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    given: list[list[str]] = []

    def fake(words: list[str]) -> dict[str, float]:
        given.append(words)
        if "--json" in words:
            magnitudes = {"aero_drag": {"estimate": 1.2, "low": 1.1, "high": 1.3}}
            answer = {"verdict": "none", "magnitudes": magnitudes if words[1].endswith("effect") else {}}
            Path(words[words.index("--json") + 1]).write_text(json.dumps(answer))
        return {"memory": 512.0, "cpu": 7.0}

    monkeypatch.setattr(benchmark_memory, "measured", fake)
    out = tmp_path / "out"
    benchmark_memory.main(benchmark_memory.BenchmarkConfig(runs=(1, 2), duration=1.5, out=out))
    assert len(list((out / "2_none").iterdir())) == 2
    assert all(Path(words[1]).is_dir() for words in given)
    rows = [row for row in (out / "report.md").read_text().splitlines() if "512" not in row and "0.51" in row]
    assert rows[0] == "| diagnose | 1 | 2 | yes | 0.51 | 7 | aero_drag 1.2 (1.1 to 1.3) |"
    assert rows[2] == "| diagnose | 2 | 3 | no | 0.51 | 7 | none |"
    assert [row.split(" | ")[0] for row in rows[3:]] == [
        "| check", "| identify", "| identify --criterion prediction", "| diagnose --calibration",
    ]  # fmt: skip


def test_training_is_timed_on_each_device(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("torch", reason='training needs the extra "train"')
    from experiments.model import benchmark_training

    asked: list[Any] = []

    def trained(config: Any) -> SimpleNamespace:
        asked.append(config)
        last = {"seconds": 5.0, "validation": -60.0 if config.device == "cpu" else -50.0}
        seconds = 8.0 if config.device == "cpu" else 4.0
        return SimpleNamespace(record={"device": config.device, "history": [last], "seconds": seconds, "epochs": 4})

    monkeypatch.setattr(benchmark_training, "train", trained)
    monkeypatch.setattr(benchmark_training.torch.cuda, "is_available", lambda: True)
    benchmark_training.main(benchmark_training.BenchmarkConfig(drives=tmp_path, target=-58.0, out=tmp_path / "out"))
    assert [config.stop_at for config in asked] == [-58.0, -58.0]
    report = (tmp_path / "out" / "report.md").read_text()
    assert "| cpu | 5 | 4 | 2.00 | -60.00 |" in report
    assert "| cuda | not reached | 4 | 1.00 | -50.00 |" in report
    assert "1/2.0 of the CPU's time" in report
