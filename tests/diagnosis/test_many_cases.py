"""A folder of cases: one that cannot be used loses no other."""

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace

import pytest

from drift_drake.diagnosis import folders
from drift_drake.logs.table import InvalidLogError
from drift_drake.vehicle.parameters import VehicleParameters


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    for name in ("a", "b", "c"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "run_0.csv").write_text("t\n")

    def answer(path: Path, _vehicle: VehicleParameters, _options: object) -> SimpleNamespace:
        if path.name == "b":
            raise InvalidLogError(f"{path.name}: spoilt")
        return SimpleNamespace(case=path.name)

    monkeypatch.setattr(folders, "_answer_folder", answer)
    return tmp_path


def test_the_other_cases_are_answered(folder: Path) -> None:
    refused: list[InvalidLogError] = []
    with ThreadPoolExecutor(2) as executor:
        answers = folders.diagnose_all(folder, VehicleParameters(), executor, refused=refused.append)
    assert [answer.case for answer in answers] == ["a", "c"]
    assert [str(error) for error in refused] == ["b: spoilt"]


def test_without_a_listener_the_error_is_raised(folder: Path) -> None:
    with ThreadPoolExecutor(2) as executor, pytest.raises(InvalidLogError, match="b: spoilt"):
        folders.diagnose_all(folder, VehicleParameters(), executor)
