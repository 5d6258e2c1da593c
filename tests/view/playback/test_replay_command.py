"""`drift-drake replay` and `python -m diagrams.replay`: what they write, print and refuse."""

import json

import pandas as pd
import pytest

from diagrams.replay import ReplayConfig
from diagrams.replay import main as run_diagram
from drift_drake.cli.main import main


def arguments(files, *more):
    return ["replay", str(files / "run_0.csv"), "--vehicle", str(files / "car.yaml"), *more]


def test_a_log_is_replayed_with_both_cars(files, capsys):
    html, numbers = files / "replay.html", files / "deep" / "errors.json"
    code = main(arguments(files, "--corrected", str(files / "true.yaml"), "--html", str(html), "--json", str(numbers)))
    assert code == 0
    said = capsys.readouterr().out
    assert "run_0.csv: 4.0 s of predictions, restarted every 1 s" in said
    assert "position [m]" in said
    written = json.loads(numbers.read_text())
    assert written["rms"]["r"]["corrected"] < written["rms"]["r"]["nominal"]
    page = html.read_text()
    assert all(f">{name}</div>" in page for name in ("real", "nominal", "corrected"))
    assert "Simulated cars start from the real one every 1 s." in page


def test_errors_go_to_standard_output(files, capsys):
    assert main(arguments(files, "--json", "-")) == 0
    out, error = capsys.readouterr()
    assert json.loads(out)["restart"] == 1.0
    assert "position [m]" in error


def test_without_a_corrected_car_the_nominal_one_is_replayed(files, capsys):
    assert main(arguments(files, "--restart", "0")) == 0
    assert "never restarted" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("more", "says"),
    [
        (["--corrected", "nothing.yaml"], "nothing.yaml: cannot be read"),
        (["--restart", "-1"], "--restart is -1; give seconds between restarts, or 0 for never"),
    ],
)
def test_bad_input_is_one_sentence_and_exit_code_2(files, capsys, more, says):
    assert main(arguments(files, *more)) == 2
    error = capsys.readouterr().err
    assert says in error
    assert error.count("\n") == 1


def test_the_diagram_leaves_tables_numbers_and_pictures(files, capsys):
    config = ReplayConfig(files / "run_0.csv", files / "car.yaml", files / "true.yaml", out=files / "out")
    run_diagram(config)
    assert f"results in {files / 'out'}" in capsys.readouterr().out
    for name in ("config.json", "versions.json", "time_series.png", "overhead.png", "replay.html"):
        assert (files / "out" / name).stat().st_size > 100, name
    table = pd.read_csv(files / "out" / "replay.csv")
    assert len(table) == 401
    numbers = json.loads((files / "out" / "numbers.json").read_text())
    assert numbers["rms"]["beta"]["corrected"] < numbers["rms"]["beta"]["nominal"]
    run_diagram(ReplayConfig(files / "run_0.csv", files / "car.yaml", out=files / "graph", graph=True))
    assert (files / "graph" / "replay.svg").exists()
