"""`drift-drake identify`: files, standard output, exit codes."""

import json

import pytest

from drift_drake.car.log.table import write_run
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.vehicle_file import read_vehicle
from drift_drake.cli.main import BAD_INPUT, main


@pytest.fixture
def files(tmp_path, strange_car_runs):
    (tmp_path / "logs").mkdir()
    for run in strange_car_runs[:2]:
        write_run(run.rows(0, 300), tmp_path / "logs" / f"{run.name}.csv")
    VehicleParameters().to_yaml(tmp_path / "start.yaml")
    return tmp_path


def test_a_calibrated_file_and_json_on_standard_output(files, capsys):
    logs, start = str(files / "logs"), str(files / "start.yaml")
    code = main(["identify", logs, "--vehicle", start, "--out", str(files / "car.yaml"), "--json", "-", "--quiet",
                 "--effects", "steering_lag"])  # fmt: skip
    out, error = capsys.readouterr()
    assert code == 0
    data = json.loads(out)
    names = list(data["parameters"])
    assert len(data["correlation"]) == len(names)
    vehicle, effects = read_vehicle(files / "car.yaml")
    assert vehicle.friction == pytest.approx(data["parameters"]["friction"]["estimate"], rel=1e-3)
    assert effects.steering_lag > 0.0
    assert "parameters identified" in error
    assert "--process-scale" in error


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["nowhere", "--vehicle", "start.yaml"], "nowhere: no such folder"),
        (["logs", "--vehicle", "nothing.yaml"], "nothing.yaml: cannot be read"),
        (["logs", "--vehicle", "start.yaml", "--known", "wind"], "wind is no parameter"),
    ],
)
def test_bad_input_is_one_sentence(files, capsys, arguments, says, monkeypatch):
    monkeypatch.chdir(files)
    assert main(["identify", *arguments, "--quiet"]) == BAD_INPUT
    error = capsys.readouterr().err
    assert says in error
    assert error.count("\n") == 1
