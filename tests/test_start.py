"""`drift-drake init` and `drift-drake drive`: a first vehicle file, and what is refused before the work."""

import dataclasses
import resource
from pathlib import Path

import pytest

from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.vehicle_file import read_vehicle
from drift_drake.cli import drive_run as drive_command
from drift_drake.cli.drive_run import ClosedLoopConfig
from drift_drake.cli.main import BAD_INPUT, main


def test_the_starter_vehicle_is_the_default_one_commented(tmp_path: Path) -> None:
    path = tmp_path / "car.yaml"
    assert main(["init", str(path)]) == 0
    assert read_vehicle(path) == (VehicleParameters(), Effects())
    lines = path.read_text().splitlines()
    for field in dataclasses.fields(VehicleParameters):
        if field.name == "tyre":
            continue
        (line,) = (line for line in lines if line.startswith(f"{field.name}:"))
        assert field.name == "tolerance" or (f"# [{field.metadata['unit']}] " in line and len(line) <= 120)


def test_a_file_that_is_there_is_kept(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "car.yaml"
    path.write_text("mine\n")
    assert main(["init", str(path)]) == BAD_INPUT
    assert "is there already" in capsys.readouterr().err
    assert path.read_text() == "mine\n"


def test_drive_asks_for_what_it_was_given(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[ClosedLoopConfig] = []
    monkeypatch.setattr(drive_command, "main", lambda config, _: asked.append(config))
    path = tmp_path / "car.yaml"
    assert main(["init", str(path)]) == 0
    out = tmp_path / "out"
    words = ["drive", "loops", "--vehicle", str(path), "--model", "online", "--seed", "3", "--out", str(out)]
    assert main(words) == 0
    assert asked == [ClosedLoopConfig(vehicle=path, reference="loops", model="online", seed=3, out=out)]


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["drive", "figure_8", "--vehicle", "nothing.yaml"], "nothing.yaml: cannot be read"),
        (["drive", "figure_8", "--out", "FILE/x"], "cannot be written"),
        (["drive", "figure_8", "--seed", "-1"], "--seed -1: give 0 or more"),
        (["demo", "."], ".: is there already"),
        (["effects", "--vehicle", "nothing.yaml"], "nothing.yaml: cannot be read"),
    ],
)
def test_bad_input_is_one_sentence(
    words: list[str], says: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").write_text("")
    assert main([word.replace("FILE", str(tmp_path / "file")) for word in words]) == BAD_INPUT
    error = capsys.readouterr().err
    assert says in error
    assert error.count("\n") == 1


def test_too_little_address_space_is_said_before_the_libraries_try_for_ever(monkeypatch, capsys):
    monkeypatch.setattr("resource.getrlimit", lambda _: (700 << 20, resource.RLIM_INFINITY))
    assert main(["effects"]) == 2
    assert "700 MB of address space (ulimit -v) are too few" in capsys.readouterr().err
