"""The learnt model from nothing: the order of its stages, what each is given, and resumption."""

import json
from pathlib import Path
from typing import Any

import pytest

from experiments.model import build


@pytest.fixture
def calls(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, Any]]:
    """What each stage was called with, in order, instead of hours of work."""
    made: list[tuple[str, Any]] = []
    monkeypatch.setattr(build.drives, "main", lambda config: made.append(("drives", config)))
    monkeypatch.setattr(build.lane_drives, "main", lambda config: made.append(("lane", config)))
    monkeypatch.setattr(build, "run_train", lambda command: made.append(("train", command)))
    compared = {"ratio": {"r": 1.1, "v": 1.0}}
    monkeypatch.setattr(build, "compared", lambda _config, model: made.append(("quality", model)) or compared)
    return made


def test_each_round_is_planned_by_the_model_before_and_trained_from_it(
    calls: list[tuple[str, Any]], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    build.main(build.BuildConfig(output=tmp_path, seed=3, rounds=3))
    assert [name for name, _ in calls] == [
        "drives",
        "train",
        "lane",
        "train",
        "lane",
        "train",
        "lane",
        "train",
        "quality",
    ]
    lanes = [config for name, config in calls if name == "lane"]
    trained = [command for name, command in calls if name == "train"]
    outputs = [command.config.output for command in trained]
    assert outputs == [tmp_path / name for name in ("plain.npz", "model_0.npz", "model_1.npz", "model_2.npz")]
    assert [lane.checkpoint for lane in lanes] == outputs[:3]
    assert [lane.round for lane in lanes] == [0, 1, 2]
    # The plain model is of another objective: the first round's training begins anew.
    assert [command.config.start for command in trained] == [None, None, outputs[1], outputs[2]]
    assert [command.recipe for command in trained] == ["windows", "transfer", "transfer", "transfer"]
    assert {config.seed for _, config in calls[:1]} | {command.config.seed for command in trained} == {3}
    assert calls[-1] == ("quality", outputs[-1])
    assert "over the shipped model's: r 1.10, v 1.00" in capsys.readouterr().out


def test_stages_that_are_done_are_not_done_again(
    calls: list[tuple[str, Any]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken_off(_config: Any) -> None:
        raise KeyboardInterrupt

    config = build.BuildConfig(output=tmp_path)
    monkeypatch.setattr(build.lane_drives, "main", broken_off)
    with pytest.raises(KeyboardInterrupt):
        build.main(config)
    assert [name for name, _ in calls] == ["drives", "train"]
    calls.clear()
    monkeypatch.setattr(build.lane_drives, "main", lambda config: calls.append(("lane", config)))
    build.main(config)
    assert [name for name, _ in calls] == ["lane", "train", "lane", "train", "quality"]
    assert list(json.loads((tmp_path / "build.json").read_text())["seconds"])[:3] == ["drives", "plain", "lane_0"]


@pytest.mark.usefixtures("calls")
def test_another_build_in_the_folder_is_refused(tmp_path: Path) -> None:
    build.main(build.BuildConfig(output=tmp_path))
    with pytest.raises(build.OtherBuildError, match="another seed, train; give another --output"):
        build.main(build.BuildConfig(output=tmp_path, seed=1, train=10))
