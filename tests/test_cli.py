"""The command line: exit codes, one-sentence errors, the corrected vehicle."""

import errno
import json
import os
import signal
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from drift_drake.car.log.table import write_run
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.vehicle_file import read_vehicle
from drift_drake.cli import apply
from drift_drake.cli.main import BAD_INPUT, COMMANDS, main
from drift_drake.common.interruption import NOT_READ
from experiments.benchmarks.compiled_cases import make_case
from experiments.benchmarks.truths import Truth

ROOT = Path(__file__).parents[1]
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


@pytest.mark.parametrize("command", ["init LONG", "check LONG", "fleet LONG --vehicle CAR", "effects --json LONG",
                                     "diagnose LONG --vehicle CAR", "import LONG --look"])  # fmt: skip
def test_a_path_that_the_system_refuses_is_one_sentence(command, vehicle_path, capsys):
    long = "x" * 3000
    assert main(command.replace("LONG", long).replace("CAR", str(vehicle_path)).split()) == BAD_INPUT
    said = capsys.readouterr().err
    assert "File name too long" in said
    assert said.count("\n") == 1


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
    assert main(["--help"]) == 0
    text = capsys.readouterr().out
    assert all(f"  {name} " in text and command.summary in text for name, command in COMMANDS.items())
    assert main([]) == BAD_INPUT
    assert capsys.readouterr().err == text


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_has_help(name, capsys):
    with pytest.raises(SystemExit) as caught:
        main([name, "--help"])
    assert caught.value.code == 0
    assert f"usage: drift-drake {name} " in capsys.readouterr().out


@pytest.mark.parametrize(("word", "says"), [("diagnos", "is it diagnose?"), ("xyzzy", "there are demo, app, init,")])
def test_an_unknown_command_is_one_sentence(word, says, capsys):
    assert main([word]) == BAD_INPUT
    assert capsys.readouterr().err.startswith(f"drift-drake: '{word}' is not a command; {says}")


def test_the_version_is_that_of_the_package(capsys):
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"drift-drake {version('drift_drake')}\n"


SLOW = ("pydrake.systems.framework", "pandas", "scipy.linalg", "matplotlib", "torch", "rich")
MISTYPED = [
    ["--help"],
    ["diagnose", "nowhere", "--vehicle", "VEHICLE"],
    ["diagnose", "nowhere", "--vehicle", "nothing.yaml"],
    ["identify", "nowhere", "--vehicle", "VEHICLE"],
    ["plan-next", "nothing.json", "--vehicle", "VEHICLE"],
    ["apply", "nothing.json", "--vehicle", "VEHICLE", "--out", "x.yaml"],
    ["simulate", "nowhere", "--vehicle", "VEHICLE", "--out", "x.csv"],
    ["replay", "nothing.csv", "--vehicle", "VEHICLE"],
    ["import", "nothing.csv"],
]
IMPORTED = """
import sys
from drift_drake.cli.main import main
for arguments in {mistyped}:
    main(arguments)
    print(arguments, *(name for name in {slow} if name in sys.modules), flush=True)
"""


def test_help_and_mistyped_paths_import_nothing_slow(vehicle_path):
    mistyped = [[str(vehicle_path) if word == "VEHICLE" else word for word in words] for words in MISTYPED]
    program = IMPORTED.format(mistyped=mistyped, slow=SLOW)
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True, cwd=ROOT)
    said = [line for line in done.stdout.splitlines() if line.startswith("[")]
    assert said == [str(words) for words in mistyped]
    assert done.stderr.count("\n") == len(MISTYPED) - 1


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
    run = make_case(truth, VehicleParameters(), np.random.default_rng(2), 6.0)[1]
    write_run(run, tmp_path / "run_0.csv")
    answer, plan = tmp_path / "answer.json", tmp_path / "plan.csv"
    given = ["--vehicle", str(vehicle_path)]
    assert main(["diagnose", str(tmp_path), *given, "--json", str(answer), "--quiet"]) == 0
    expected = tmp_path / "expected.json"
    assert main(["plan-next", str(answer), *given, "--out", str(plan), "--json", str(expected)]) == 0
    reported = json.loads(expected.read_text())
    assert len(reported["nats"]) == len(reported["hypotheses"]) >= 2
    assert reported["probability_after"] >= reported["probability_before"]
    assert "is expected to fall behind" in capsys.readouterr().out
    table = pd.read_csv(plan)
    assert len(table) == 451
    assert np.allclose(np.diff(table["t"]), 0.01)
    assert table["e"].abs().max() < 3.0


UNKNOWN = ANSWER | {
    "verdict": "unknown", "causes": [], "posterior": {"unknown": 1.0}, "ambiguity": ["unknown"], "magnitudes": {},
    "details": {"beliefs": {"noise": [0.1] * 9, "used": [True] * 9, "process": [0.1] * 9, "tempering": 1.0, "own": {},
                            "hypotheses": {}}},
}  # fmt: skip


def test_no_plan_follows_an_answer_of_unknown(tmp_path, vehicle_path, capsys):
    (tmp_path / "answer.json").write_text(json.dumps(UNKNOWN))
    assert main(["plan-next", str(tmp_path / "answer.json"), "--vehicle", str(vehicle_path)]) == BAD_INPUT
    *_, error = capsys.readouterr().err.splitlines()
    assert error.startswith("drift-drake: a: no catalogued hypothesis explains the gap")


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["diagnose", "CASE", "--workers", "0"], "--workers 0: give 1 or more"),
        (["diagnose", "CASE", "--noise-scale", "nan"], "--noise-scale and --process-scale are factors above 0"),
        (["diagnose", "CASE", "--tempering", "nan"], "above 0, up to 1"),
        (["diagnose", "CASE", "--json", "CASE"], "is a folder; give the name of a file"),
        (["diagnose", "CASE", "--json", "VEHICLE"], "is an input too; give another file"),
        (["diagnose", "CASE", "--report", "VEHICLE/x.html"], "cannot be written"),
        (["simulate", "slalom", "--out", "OUT", "--seed", "-1"], "--seed -1: give 0 or more"),
        (["simulate", "slalom", "--out", "OUT", "--noise", "nan"], "--noise nan: give 0 or more"),
        (["simulate", "slalom", "--out", "OUT", "--duration", "1e9"], "--duration 1e+09: give seconds"),
        (["simulate", "slalom", "--out", "OUT", "--steering", "nan"], "--steering nan: give an angle"),
        (["plan-next", "ANSWER", "--out", "OUT", "--v-start", "1000"], "v_start is 1000 m/s; give 1 to 60"),
        (["plan-next", "ANSWER", "--out", "OUT", "--half-width", "nan"], "half_width is nan m; give above 0.5"),
        (["replay", "CASE/run_0.csv", "--html", "VEHICLE/x.html"], "cannot be written"),
        (["identify", "CASE", "--out", "VEHICLE/x.yaml"], "cannot be written"),
        (["apply", "PIPE", "--out", "OUT"], "a pipe or device"),
    ],
)
def test_numbers_and_outputs_are_tried_before_the_work(tmp_path, vehicle_path, capsys, arguments, says):
    (tmp_path / "case").mkdir()
    (tmp_path / "case" / "run_0.csv").write_text("t\n0\n")
    (tmp_path / "answer.json").write_text(json.dumps(ANSWER))
    os.mkfifo(tmp_path / "pipe")
    places = {"CASE": "case", "VEHICLE": vehicle_path.name, "OUT": "out", "ANSWER": "answer.json", "PIPE": "pipe"}
    for name, place in places.items():
        arguments = [a.replace(name, str(tmp_path / place)) for a in arguments]
    before = vehicle_path.read_text()
    assert main([*arguments, "--vehicle", str(vehicle_path)]) == BAD_INPUT
    *_, error = capsys.readouterr().err.splitlines()
    assert error.startswith("drift-drake: ")
    assert says in error
    assert not (tmp_path / "out").exists()
    assert vehicle_path.read_text() == before


@pytest.mark.parametrize(
    ("end", "code", "says"),
    [
        (lambda _: os.kill(os.getpid(), signal.SIGTERM), 143, "terminated"),
        (lambda _: os.kill(os.getpid(), signal.SIGINT), 130, "interrupted"),
    ],
)
def test_signals_end_in_one_line(tmp_path, vehicle_path, capsys, monkeypatch, end, code, says):
    monkeypatch.setattr(apply, "run_apply", end)
    before = signal.getsignal(signal.SIGTERM)
    assert main(["apply", "a.json", "--vehicle", str(vehicle_path), "--out", str(tmp_path / "x.yaml")]) == code
    error = capsys.readouterr().err
    assert says in error
    assert error.count("\n") == 1
    assert signal.getsignal(signal.SIGTERM) == before


def test_a_reader_who_stops_reading_is_no_error():
    command = [sys.executable, "-m", "drift_drake", "effects"]
    process = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    process.stdout.close()
    assert process.stderr.read() == ""
    assert process.wait() == NOT_READ
    process.stderr.close()


def test_a_drive_replaces_no_files(tmp_path, capsys):
    (tmp_path / "numbers.json").write_text("{}")
    assert main(["drive", "figure_8", "--out", str(tmp_path)]) == BAD_INPUT
    assert "holds files already; give a new folder" in capsys.readouterr().err


def test_a_full_disk_keeps_the_vehicle_file(tmp_path, vehicle_path, capsys, monkeypatch):
    """In place, as a user would: every write fails."""
    (tmp_path / "answer.json").write_text(json.dumps(ANSWER))
    before = vehicle_path.read_text()

    def full(*_args, **_options):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(Path, "write_text", full)
    arguments = ["--vehicle", str(vehicle_path), "--out", str(vehicle_path)]
    assert main(["apply", str(tmp_path / "answer.json"), *arguments]) == BAD_INPUT
    assert "cannot be written (No space left on device)" in capsys.readouterr().err
    assert vehicle_path.read_text() == before
    assert sorted(path.name for path in tmp_path.iterdir()) == ["answer.json", vehicle_path.name]
