"""No command's output replaces one of its inputs: it is refused before anything is begun."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from drift_drake.car.parameters import VehicleParameters
from drift_drake.cli.main import main

LOG, CAR, ANSWER = "logs/a/run_0.csv", "car.yaml", "answer.json"
VEHICLE = ["--vehicle", CAR]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    t = 0.01 * np.arange(100)
    log = pd.DataFrame({"t": t, "r": np.sin(t), "v": 12.0 + t, "delta_cmd": 0.05 * np.cos(t), "tau_cmd": 100.0})
    (tmp_path / LOG).parent.mkdir(parents=True)
    log.to_csv(tmp_path / LOG, index=False)
    VehicleParameters().to_yaml(tmp_path / CAR)
    (tmp_path / ANSWER).write_text(
        '{"case": "a", "verdict": "none", "causes": [], "posterior": {"none": 1.0}, "ambiguity": ["none"], '
        '"magnitudes": {}, "where": {}, "reduction": {"estimate": null, "low": null, "high": null}, "seconds": 1.0}'
    )
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize(
    ("arguments", "taken"),
    [
        (["check", "logs/a", "--json", LOG], LOG),
        (["check", "logs/a", *VEHICLE, "--json", CAR], CAR),
        (["diagnose", "logs/a", *VEHICLE, "--json", LOG], LOG),
        (["diagnose", "logs/a", *VEHICLE, "--report", CAR], CAR),
        (["identify", "logs/a", *VEHICLE, "--out", "new.yaml", "--json", LOG], LOG),
        (["fleet", "logs", *VEHICLE, "--json", LOG], LOG),
        (["fleet", "logs", *VEHICLE, "--page", CAR], CAR),
        (["watch", LOG, *VEHICLE, "--json", LOG], LOG),
        (["replay", LOG, *VEHICLE, "--html", CAR], CAR),
        (["simulate", LOG, *VEHICLE, "--out", LOG], LOG),
        (["export", LOG, "--format", "mcap", "--out", LOG], LOG),
        (["export", CAR, "--format", "mujoco", "--out", CAR], CAR),
        (["import", LOG, "--mapping", "dart", "--out", "new", "--json", LOG], LOG),
        (["apply", ANSWER, *VEHICLE, "--out", ANSWER], ANSWER),
        (["plan-next", ANSWER, *VEHICLE, "--out", CAR], CAR),
        (["effects", *VEHICLE, "--json", CAR], CAR),
        (["init", CAR], CAR),
    ],
)
def test_an_output_that_is_an_input_is_refused(
    folder: Path, arguments: list[str], taken: str, capsys: pytest.CaptureFixture[str]
) -> None:
    before = (folder / taken).read_bytes()
    assert main(arguments) == 2
    said = capsys.readouterr().err
    assert "is an input too; give another file" in said or "is there already; give another name" in said
    assert (folder / taken).read_bytes() == before


def test_a_folder_of_runs_is_not_exported_onto_itself(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("pyarrow", reason="Parquet is an extra: pip install 'drift_drake[parquet]'")
    assert main(["export", "logs/a", "--format", "parquet", "--out", "exported"]) == 0
    before = (folder / "exported/run_0.parquet").read_bytes()
    assert main(["export", "exported", "--format", "parquet", "--out", "exported"]) == 2
    assert "is an input too" in capsys.readouterr().err
    assert (folder / "exported/run_0.parquet").read_bytes() == before
