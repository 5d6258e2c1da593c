"""The command line: exit codes, one-sentence errors, the corrected vehicle."""

import json

import numpy as np
import pandas as pd
import pytest

from drift_drake.cli import BAD_INPUT, main
from drift_drake.logs.table import write_run
from drift_drake.vehicle.parameters import VehicleParameters
from drift_drake.vehicle.vehicle_file import read_vehicle
from experiments.gap_cases import Truth, make_case

ANSWER = {
    "case": "a",
    "verdict": "effect",
    "causes": ["steering_lag"],
    "posterior": {"steering_lag": 1.0},
    "ambiguity": ["steering_lag"],
    "magnitudes": {"steering_lag": {"estimate": 0.08, "low": 0.07, "high": 0.09}},
    "where": {"states": {}, "runs": {}, "regions": []},
    "reduction": {"estimate": 0.9, "low": 0.8, "high": 1.0},
    "seconds": 1.0,
}


@pytest.fixture
def vehicle_path(tmp_path):
    path = tmp_path / "vehicle.yaml"
    VehicleParameters().to_yaml(path)
    return path


def test_apply_writes_a_vehicle_with_the_effect(tmp_path, vehicle_path, capsys):
    (tmp_path / "answer.json").write_text(json.dumps(ANSWER))
    out = tmp_path / "corrected.yaml"
    code = main(["apply", str(tmp_path / "answer.json"), "--vehicle", str(vehicle_path), "--out", str(out)])
    assert code == 0
    assert read_vehicle(out)[1].steering_lag == 0.08
    assert "steering_lag 0.08 s" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["diagnose", "nowhere", "--vehicle", "VEHICLE"], "nowhere: no such folder"),
        (["diagnose", ".", "--vehicle", "nothing.yaml"], "nothing.yaml: cannot be read"),
        (["apply", "nothing.json", "--vehicle", "VEHICLE", "--out", "x.yaml"], "nothing.json: cannot be read"),
    ],
)
def test_bad_input_is_one_sentence_and_exit_code_2(vehicle_path, capsys, arguments, says):
    code = main([str(vehicle_path) if a == "VEHICLE" else a for a in arguments])
    error = capsys.readouterr().err
    assert code == BAD_INPUT
    assert says in error
    assert error.count("\n") == 1


def test_help_names_the_commands(capsys):
    with pytest.raises(SystemExit) as caught:
        main(["--help"])
    assert caught.value.code == 0
    text = capsys.readouterr().out
    assert all(name in text for name in ("import", "diagnose", "apply", "simulate", "replay", "train"))


@pytest.mark.slow
def test_diagnose_writes_an_answer(tmp_path, vehicle_path):
    truth = Truth({"aero_drag": 1.5}, {}, {"friction": 0.01})
    for run in make_case(truth, VehicleParameters(), np.random.default_rng(2)):
        write_run(run, tmp_path / f"{run.name}.csv")
    out = tmp_path / "answer.json"
    assert main(["diagnose", str(tmp_path), "--vehicle", str(vehicle_path), "--json", str(out), "--quiet"]) == 0
    assert json.loads(out.read_text())["causes"] == ["aero_drag"]


@pytest.mark.slow
def test_plan_next_follows_an_answer(tmp_path, vehicle_path, capsys):
    truth = Truth({"steering_lag": 0.06}, {}, {"friction": 0.01})
    run = make_case(truth, VehicleParameters(), np.random.default_rng(2), 3.0)[1]
    write_run(run, tmp_path / "run_0.csv")
    answer, plan = tmp_path / "answer.json", tmp_path / "plan.csv"
    given = ["--vehicle", str(vehicle_path)]
    assert main(["diagnose", str(tmp_path), *given, "--json", str(answer), "--quiet"]) == 0
    assert main(["plan-next", str(answer), *given, "--out", str(plan)]) == 0
    assert "is expected to fall behind" in capsys.readouterr().out
    table = pd.read_csv(plan)
    assert len(table) == 451
    assert np.allclose(np.diff(table["t"]), 0.01)
    assert table["e"].abs().max() < 3.0
