"""What an answer was found from: applied once, to the car that was diagnosed, and not diagnosed twice."""

import dataclasses
import json
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.log.cases import case_name
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.vehicle_file import read_vehicle, vehicle_hash, write_vehicle
from drift_drake.cli.main import BAD_INPUT, main
from drift_drake.gap.diagnosis import diagnose as diagnosing
from drift_drake.gap.diagnosis.answers.answer import Answer, InvalidAnswerError, read_answer
from drift_drake.gap.diagnosis.answers.provenance import all_answered, answered, provenance

VEHICLE = VehicleParameters()


def answer_of(folder: Path, options: dict[str, Any] | None = None) -> dict[str, Any]:
    return {
        "case": folder.name, "verdict": "effect", "causes": ["steering_lag"], "posterior": {"steering_lag": 1.0},
        "ambiguity": ["steering_lag"], "magnitudes": {"steering_lag": {"estimate": 0.08, "low": 0.07, "high": 0.09}},
        "where": {}, "reduction": {"estimate": 0.9, "low": 0.8, "high": 1.0}, "seconds": 1.0,
        "details": {"provenance": provenance(folder, VEHICLE, options or {})},
    }  # fmt: skip


@dataclasses.dataclass
class Found:
    """What a diagnosis returns, as far as it matters here."""

    answer: Answer


@pytest.fixture
def case(tmp_path: Path) -> Path:
    folder = tmp_path / "days" / "monday"
    folder.mkdir(parents=True)
    (folder / "run_0.csv").write_text("t\n0\n")
    return folder


@pytest.fixture
def files(tmp_path: Path, case: Path) -> Path:
    VEHICLE.to_yaml(tmp_path / "car.yaml")
    (tmp_path / "answer.json").write_text(json.dumps(answer_of(case)))
    return tmp_path


def test_an_answer_is_applied_once(files: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["apply", str(files / "answer.json"), "--vehicle", str(files / "car.yaml"), "--out"]
    assert main([*arguments, str(files / "car.yaml")]) == 0
    assert "exists and will be replaced" in capsys.readouterr().err
    assert read_vehicle(files / "car.yaml")[1].steering_lag == 0.08
    assert main([*arguments, str(files / "car.yaml")]) == BAD_INPUT
    error = capsys.readouterr().err
    assert "car.yaml: is not the vehicle file that monday was diagnosed with" in error
    assert error.count("\n") == 1
    assert read_vehicle(files / "car.yaml")[1].steering_lag == 0.08
    assert main([*arguments, str(files / "again.yaml"), "--force"]) == 0
    assert read_vehicle(files / "again.yaml")[1].steering_lag == 0.16


def test_plans_are_for_the_car_that_was_diagnosed(files: Path, capsys: pytest.CaptureFixture[str]) -> None:
    VEHICLE.replace(mass=1500.0).to_yaml(files / "other.yaml")
    assert main(["plan-next", str(files / "answer.json"), "--vehicle", str(files / "other.yaml")]) == BAD_INPUT
    assert "other.yaml: is not the vehicle file" in capsys.readouterr().err


def test_the_hash_is_of_the_numbers(tmp_path: Path) -> None:
    path = tmp_path / "car.yaml"
    write_vehicle(path, VEHICLE, Effects(aero_drag=1.0))
    path.write_text("# a comment\n" + path.read_text().replace("mass: 1650.0", "mass: 1650  # kg"))
    assert vehicle_hash(*read_vehicle(path)) == vehicle_hash(VEHICLE, Effects(aero_drag=1.0))
    assert vehicle_hash(VEHICLE, Effects()) != vehicle_hash(VEHICLE, Effects(aero_drag=1.0))
    assert vehicle_hash(VEHICLE, Effects()) != vehicle_hash(VEHICLE.replace(friction=0.99), Effects())


def test_only_the_same_logs_vehicle_and_options_are_answered(case: Path, tmp_path: Path) -> None:
    path = tmp_path / "monday.json"
    path.write_text(json.dumps(answer_of(case)))
    assert answered(path, provenance(case, VEHICLE, {})) is not None
    assert answered(path, provenance(case, VEHICLE, {"tempering": 0.5})) is None
    assert answered(path, provenance(case, VEHICLE.replace(mass=1500.0), {})) is None
    (case / "run_0.csv").write_text("t\n1\n")
    assert answered(path, provenance(case, VEHICLE, {})) is None
    for spoilt in ("", path.read_text()[:100]):
        path.write_text(spoilt)
        assert answered(path, provenance(case, VEHICLE, {})) is None
    assert all_answered({case: path, case.parent: tmp_path / "none.json"}, VEHICLE, {}) == {}


def test_another_case_of_the_same_name_is_not_overwritten(case: Path, tmp_path: Path) -> None:
    path = tmp_path / "monday.json"
    path.write_text(json.dumps(answer_of(case)))
    other = tmp_path / "weeks" / "monday"
    other.mkdir(parents=True)
    (other / "run_0.csv").write_text("t\n2\n")
    with pytest.raises(InvalidAnswerError, match=r"monday\.json: is the answer to the case in .*days/monday"):
        all_answered({other: path}, VEHICLE, {})


def test_links_to_folders_of_one_name_keep_their_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for parent in ("a", "b"):
        (tmp_path / parent / "monday").mkdir(parents=True)
        (tmp_path / f"link_{parent}").symlink_to(tmp_path / parent / "monday")
    assert [case_name(tmp_path / f"link_{parent}") for parent in "ab"] == ["link_a", "link_b"]
    monkeypatch.chdir(tmp_path / "a" / "monday")
    assert [case_name(Path(name)) for name in (".", "..")] == ["monday", "a"]


def test_a_folder_of_answered_cases_is_not_diagnosed_again(
    files: Path, case: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    tuesday = case.parent / "tuesday"
    tuesday.mkdir()
    (tuesday / "run_0.csv").write_text("t\n5\n")
    asked: list[list[Path]] = []
    given: dict[str, Any] = {}

    def diagnosed(_folder: Path, _vehicle: Any, _run_on: Any, **options: Any) -> list[Any]:
        asked.append(list(options.pop("only")))
        given.update(options)
        return []

    monkeypatch.setattr(diagnosing, "diagnose_all", diagnosed)
    answers = files / "answers"
    answers.mkdir()
    arguments = ["diagnose", str(case.parent), "--vehicle", str(files / "car.yaml"), "--json", str(answers), "--quiet"]
    assert main(arguments) == 0
    del given["progress"], given["refused"], given["quiet"]
    monkeypatch.setattr(diagnosing, "read_case", lambda _: [])
    monkeypatch.setattr(diagnosing.likelihood, "diagnose", lambda *_, **__: Found(read_answer(files / "answer.json")))
    diagnosing.answer_folder(case, VEHICLE, **given).answer.write(answers / "monday.json")
    assert main(arguments) == 0
    assert main([*arguments, "--again"]) == 0
    assert asked == [[case, tuesday], [tuesday], [case, tuesday]]
    said = capsys.readouterr()
    assert "1 of 2 cases are answered" in said.err
    assert "monday: steering_lag" in said.out
    (table,) = answers.glob("results.*")
    rows = pd.read_parquet(table) if table.suffix == ".parquet" else pd.read_csv(table)
    assert list(rows["case"]) == ["monday"]
    assert list(rows["causes"]) == ["steering_lag"]


def test_an_answer_without_provenance_is_applied_with_a_warning(
    files: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    answer = read_answer(files / "answer.json")
    answer.details.clear()
    answer.write(files / "answer.json")
    arguments = ["--vehicle", str(files / "car.yaml"), "--out", str(files / "x.yaml")]
    assert main(["apply", str(files / "answer.json"), *arguments]) == 0
    assert "warning: the answer does not say which vehicle file" in capsys.readouterr().err
