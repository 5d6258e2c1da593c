"""`drift_drake.diagnose`: paths and objects, with a calibration or the factors, come to the same options."""

import dataclasses
import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import drift_drake
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.log.table import Run, write_run
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.vehicle_file import write_vehicle
from drift_drake.common.errors import DriftDrakeError, InvalidOptionError
from drift_drake.gap.diagnosis import diagnose as module
from drift_drake.gap.identification.calibration import Calibration, Identification
from drift_drake.gap.identification.estimate import Trust

CAR, LAG = VehicleParameters(), Effects(steering_lag=0.05)


@pytest.fixture
def run() -> Run:
    t = 0.01 * np.arange(200)
    return Run(name="run_0", t=t, r=0.1 * np.sin(t), v=12.0 + 0.1 * np.cos(t), delta_cmd=0.01 * np.sin(t), beta=0.0 * t)


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """What the work behind is asked, in place of the work."""
    seen: dict[str, Any] = {}

    def work(first: Any, vehicle: Any, *more: Any, **options: Any) -> SimpleNamespace:
        seen.update(logs=first, vehicle=vehicle, more=more, **options)
        return SimpleNamespace(answer=None)

    for name in ("answer_folder", "answer_runs"):
        monkeypatch.setattr(module, name, work)
    return seen


def calibrated() -> Identification:
    """A car calibrated by likelihood, of which nothing but its trust matters here."""
    nothing: dict[str, Any] = {field.name: None for field in dataclasses.fields(Calibration)}
    return Identification(Calibration(**nothing | {"trust": Trust(1.5, 2.0), "tempering": 0.25}), CAR, LAG, 100)


def test_paths_and_objects_ask_the_same(run: Run, asked: dict[str, Any], tmp_path: Path) -> None:
    write_run(run, tmp_path / "monday" / "run_0.csv")
    write_vehicle(tmp_path / "car.yaml", CAR, LAG)
    drift_drake.diagnose(tmp_path / "monday", tmp_path / "car.yaml", workers=1, every=2)
    by_path = dict(asked)
    asked.clear()
    drift_drake.diagnose([run], (CAR, LAG), case="monday", workers=1, every=2)
    assert by_path["logs"] == tmp_path / "monday"
    assert len(asked["logs"][0]) == 100
    assert asked["more"][0] == "monday"
    for name in ("vehicle", "own", "catalogue", "most_seconds", "normal", "tempering"):
        assert asked[name] == by_path[name]


def test_a_calibration_is_a_path_or_what_was_found(run: Run, asked: dict[str, Any], tmp_path: Path) -> None:
    found = calibrated()
    (tmp_path / "car.json").write_text(
        json.dumps({"trust": {"noise": 1.5, "process": 2.0}, "tempering": 0.25, "discrepancy": None})
    )
    for calibration in (found, found.calibration, tmp_path / "car.json", str(tmp_path / "car.json")):
        asked.clear()
        drift_drake.diagnose(run, CAR, calibration=calibration)
        assert (asked["noise_scale"], asked["process_scale"], asked["tempering"]) == (1.5, 2.0, 0.25)


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"calibration": "nothing.json"}, "nothing.json"),
        ({"calibration": 3}, "int is none; give what 'identify' found, or its JSON's path"),
        ({"calibration": "x.json", "tempering": 0.5}, "has the scales and the likelihood tempering exponent"),
        ({"tempering": 2.0}, "give a number above 0, up to 1"),
        ({"catalogue": ["wind"]}, "unknown effect wind"),
        ({"catalogue": []}, "no effect to consider"),
        ({"every": 0}, "give 1 or more"),
        ({"workers": 0}, "give 1 or more"),
    ],
)
def test_what_cannot_be_used_is_said(run: Run, options: dict[str, Any], says: str) -> None:
    with pytest.raises(DriftDrakeError, match=says):
        drift_drake.diagnose(run, CAR, **options)


def test_there_is_a_report_of_a_diagnosis_or_a_calibration_alone() -> None:
    with pytest.raises(InvalidOptionError, match="no report of str; give what 'diagnose' or 'identify' returned"):
        drift_drake.report("answer.json")  # type: ignore[arg-type]
