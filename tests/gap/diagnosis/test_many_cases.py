"""A folder of cases: one that cannot be used loses no other."""

from collections.abc import Callable, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from drift_drake.car.log.table import InvalidLogError
from drift_drake.car.parameters import VehicleParameters
from drift_drake.common.errors import DriftDrakeError
from drift_drake.common.executors import ExecutorConfig
from drift_drake.common.worker_pool import WorkerLostError
from drift_drake.gap.diagnosis import diagnose as diagnosing


def here(
    _config: ExecutorConfig,
    function: Callable[[Path], Any],
    jobs: Sequence[Path],
    finish: Callable[[Path, Any], None],
    _unit: str,
    failed: Callable[[Path, BaseException], None],
    quiet: bool,
) -> None:
    """`run_jobs` in this process."""
    assert quiet
    for job in jobs:
        try:
            result = function(job)
        except DriftDrakeError as error:
            failed(job, error)
        else:
            finish(job, result)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    for name in ("a", "b", "c", "d"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "run_0.csv").write_text("t\n")

    def answer(path: Path, *_args: object, **_options: object) -> SimpleNamespace:
        if path.name == "b":
            raise InvalidLogError(f"{path.name}: spoilt")
        if path.name == "d":
            raise WorkerLostError("its process ended")
        return SimpleNamespace(answer=SimpleNamespace(case=path.name))

    monkeypatch.setattr(diagnosing, "answer_folder", answer)
    monkeypatch.setattr(diagnosing, "run_jobs", here)
    return tmp_path


def test_the_other_cases_are_answered(folder: Path) -> None:
    refused: list[DriftDrakeError] = []
    answers = diagnosing.diagnose_all(folder, VehicleParameters(), ExecutorConfig(), refused=refused.append)
    assert [answer.case for answer in answers] == ["a", "c"]
    rest = "run the command again, which goes on with what is not answered"
    assert [str(error) for error in refused] == ["b: spoilt", f"{folder / 'd'}: its process ended; {rest}"]


def test_without_a_listener_the_error_is_raised(folder: Path) -> None:
    with pytest.raises(InvalidLogError, match="b: spoilt"):
        diagnosing.diagnose_all(folder, VehicleParameters(), ExecutorConfig())
