"""`--json -` of every command: all of standard output is one JSON text, sentences are on standard error."""

import dataclasses
import json
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from drift_drake.app import server
from drift_drake.cli import demo
from drift_drake.cli import drive_run as drive_command
from drift_drake.cli.main import COMMANDS, load, main
from drift_drake.gap.diagnosis import diagnose as diagnosing
from drift_drake.gap.diagnosis.answers.answer import read_answer
from drift_drake.gap.next_drive import foresight
from drift_drake.gap.next_drive import plan as next_drive
from drift_drake.gap.next_drive.plan import NextDrive
from tests.car.foreign.bicycle import written

pytestmark = pytest.mark.usefixtures("undrawn")

WORDS = {  # of each command, and keys that its JSON has
    "demo": (["DIR/demo"], {"out", "commands", "pages"}),
    "init": (["DIR/new.yaml"], {"out", "vehicle"}),
    "import": (["DIR/lap.csv", "--look"], {"file", "topics", "mapping", "missing"}),
    "check": (["DIR/car/day"], {"case", "runs", "remarks"}),
    "diagnose": (["DIR/car/day", "--vehicle", "CAR", "--effects", "aero_drag", "--quiet"], {"verdict", "causes"}),
    "identify": (
        ["DIR/car/day", "--vehicle", "CAR", "--quiet", "--effects", "aero_drag", "--criterion", "likelihood"],
        {"parameters"},
    ),
    "plan-next": (["ANSWER", "--vehicle", "CAR", "--out", "DIR/plan.csv"], {"hypotheses", "nats"}),
    "app": (["DIR/app", "--no-open"], {"folder", "address"}),
    "apply": (["ANSWER", "--vehicle", "CAR", "--out", "DIR/corrected.yaml"], {"out", "effects"}),
    "choose": (["DIR/car/day", "--vehicle", "CAR", "--out", "DIR/identified.yaml"], {"believed", "limit", "doubts"}),
    "drive": (["figure_8", "--out", "DIR/drive"], {"out", "metrics", "events"}),
    "simulate": (["straight", "--vehicle", "CAR", "--out", "DIR/run.csv", "--duration", "1"], {"command", "ending"}),
    "replay": (["DIR/car/day/run_0.csv", "--vehicle", "CAR"], {"log", "restart"}),
    "watch": (["DIR/car/day/run_0.csv", "--vehicle", "CAR"], {"t", "event"}),
    "fleet": (["DIR", "--vehicle", "CAR", "--workers", "1"], {"cars", "days", "terms"}),
    "simulator": (["check", "DIR/simulator.yaml"], {"findings", "seconds_per_rollout", "lacking"}),
    "effects": ([], {"aero_drag", "gyro_bias"}),
    "export": (["CAR", "--format", "mujoco", "--out", "DIR/car.xml"], {"files", "left_out"}),
    "train": (["--data", "DIR/new.npz", "--output", "DIR/model.npz"], {"out", "record"}),
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A car with drag, its simulator, a log of its drive, and the answer to it."""
    folder = tmp_path_factory.mktemp("json")
    car, log = folder / "car.yaml", folder / "car" / "day" / "run_0.csv"
    assert main(["init", str(car)]) == 0
    (folder / "real.yaml").write_text(car.read_text() + "effects: {aero_drag: 2.0}\n")
    driven = ["--vehicle", str(folder / "real.yaml"), "--out", str(log), "--duration", "6"]
    assert main(["simulate", "slalom", *driven]) == 0
    assert main(with_places([*WORDS["diagnose"][0], "--json", "ANSWER"], folder, "diagnose")) == 0
    written(folder)
    pd.read_csv(log)[["t", "r", "v", "delta_cmd"]].to_csv(folder / "lap.csv", index=False)
    return folder


@pytest.fixture(autouse=True)
def short(monkeypatch):
    """A few metres of the figure-8, a demo of one command, a plan and a training that are there already."""
    figure_8 = drive_command.figure_8
    monkeypatch.setattr(drive_command, "figure_8", lambda car, **_: dataclasses.replace(figure_8(car), distance=8.0))
    monkeypatch.setattr(demo, "commands", lambda folder: [["init", str(folder / "car.yaml")]])
    plan = NextDrive(
        np.ones((3, 6)), np.zeros((3, 2)), 0.0, "straight", ("none", "aero_drag"), np.ones((2, 2)), 0.5, 0.9
    )
    monkeypatch.setattr(foresight, "beliefs_of", lambda _: None)
    monkeypatch.setattr(next_drive, "plan_from_answer", lambda *_: plan)
    monkeypatch.setattr(server, "serve", lambda _folder, _port, ready: ready("http://127.0.0.1:1/?token=x"))


def with_places(words, folder, name):
    places = {"DIR": str(folder), "CAR": str(folder / "car.yaml"), "ANSWER": str(folder / "answer.json")}
    for place, path in places.items():
        words = [word.replace(place, path) for word in words]
    return [name, *words]


def test_every_command_is_here():
    assert set(WORDS) == set(COMMANDS)


@pytest.mark.parametrize("name", COMMANDS)
def test_standard_output_is_one_json_text(name, folder, capsys, monkeypatch):
    if name == "train":
        pytest.importorskip("torch", reason="training needs the extra `train`")
        record = SimpleNamespace(record={"epochs": 1, "seconds": 1.0})
        monkeypatch.setattr("drift_drake.drive.learnt.meta_training.train", lambda _: record)
    words, keys = WORDS[name]
    capsys.readouterr()
    assert main([*with_places(words, folder, name), "--json", "-"]) == 0
    said = capsys.readouterr()
    found = json.loads(said.out)
    assert keys <= set(found)
    assert said.err


@pytest.mark.parametrize("name", COMMANDS)
def test_no_json_unless_it_is_asked_for(name):
    options, _ = load(name)
    (field,) = (field for field in dataclasses.fields(options) if field.name == "json")
    assert field.default is None


def test_answers_of_many_cases_are_a_list(folder, capsys, monkeypatch):
    for name in ("a", "b"):
        (folder / "cases" / name).mkdir(parents=True)
        (folder / "cases" / name / "run_0.csv").write_text("t\n")
    answer = read_answer(folder / "answer.json")
    monkeypatch.setattr(diagnosing, "diagnose_all", lambda *_, **__: [answer, answer])
    assert main(with_places(["DIR/cases", "--vehicle", "CAR", "--quiet", "--json", "-"], folder, "diagnose")) == 0
    assert [found["causes"] for found in json.loads(capsys.readouterr().out)] == [["aero_drag"]] * 2
