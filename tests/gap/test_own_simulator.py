"""A simulator of the user's from its logs to the corrected one: identify, check, diagnose, apply, replay."""

import json
from pathlib import Path

import numpy as np
import pytest

from drift_drake.car.car_file import read_car
from drift_drake.car.foreign.pool import end_workers
from drift_drake.car.log.table import Run, write_run
from drift_drake.cli.main import main
from tests.car.foreign.bicycle import PARAMETERS, simulate, written

TRUE = PARAMETERS | {"cf": 0.7 * PARAMETERS["cf"], "mu": 0.92}
ROWS = 701
T = 0.01 * np.arange(ROWS)


def day(folder: Path, seed: int, **changed: float) -> Path:
    """Three runs of the true car, or of a changed one: slaloms under power, a turn, noise of the sensors."""
    rng = np.random.default_rng(seed)
    pace, phase = rng.uniform(1.5, 3.2, 3)[:, None], rng.uniform(0.0, 6.0, 3)[:, None]
    delta = np.array([[0.05], [0.075], [0.02]]) * np.sin(pace * T + phase) + np.array([[0.0], [0.0], [0.06]]) * (
        T > 0.5
    )
    tau = 40.0 + np.array([[120.0], [60.0], [50.0]]) * np.sin(0.9 * T + phase) + 70.0 * (np.sin(2.3 * T + phase) > 0.6)
    start = {"r": np.zeros(3), "vx": np.full(3, 11.5), "vy": np.zeros(3), "w": np.full(3, 11.5 / 0.32)}
    found = simulate(start, {"steer": delta, "torque": 8.0 * tau}, 0.01, TRUE | changed, steps=8)
    v, beta = np.hypot(found["vx"], found["vy"]), np.arctan2(found["vy"], found["vx"])
    folder.mkdir()
    for i in range(3):
        noisy = {name: values[i] + size * rng.normal(size=ROWS) for name, values, size in (
            ("r", found["r"], 0.004), ("v", v, 0.02), ("beta", beta, 0.003), ("omega_r", 0.32 * found["w"], 0.03),
            ("psi", found["psi"], 0.002))}  # fmt: skip
        write_run(Run(f"run_{i}", t=T, delta_cmd=delta[i], tau_cmd=tau[i], **noisy), folder / f"run_{i}.csv")
    return folder


@pytest.fixture(scope="module")
def calibrated(tmp_path_factory: pytest.TempPathFactory):
    """A folder with what `drift-drake identify` writes of a simulator whose tyres were guessed wrongly."""
    folder = tmp_path_factory.mktemp("own")
    assert main(["identify", str(day(folder / "one", 1)), "--vehicle", str(written(folder)), "--out",
                 str(folder / "found.yaml"), "--json", str(folder / "found.json"), "--report",
                 str(folder / "found.html"), "--quiet"]) == 0  # fmt: skip
    yield folder
    end_workers()


def test_the_simulator_is_calibrated_with_intervals(calibrated: Path) -> None:
    found = json.loads((calibrated / "found.json").read_text())
    assert found["criterion"] == "prediction"
    assert found["held_out"]["ratio"] < 0.5
    for name, true in (("front_stiffness", TRUE["cf"]), ("friction", TRUE["mu"]), ("soft", TRUE["soft"])):
        p = found["parameters"][name]
        assert p["low"] <= true <= p["high"]
        assert name == "soft" or abs(p["estimate"] - true) < 0.5 * abs(p["start"] - true)
    assert any("not judged, since the simulator cannot have it: sliding_friction_drop" in w for w in found["warnings"])
    assert not any("windows of" in warning for warning in found["warnings"])  # a short day: all are asked for
    car, _ = read_car(calibrated / "found.yaml")
    assert car.constants().by_name()["cf"] == pytest.approx(found["parameters"]["front_stiffness"]["estimate"])
    assert "simulator" in (calibrated / "found.html").read_text()


def diagnosed(folder: Path, logs: Path, *more: str) -> dict:
    answer = folder / f"{logs.name}.json"
    assert main(["diagnose", str(logs), "--vehicle", str(folder / "found.yaml"), "--calibration",
                 str(folder / "found.json"), "--json", str(answer), "--quiet", *more]) == 0  # fmt: skip
    return json.loads(answer.read_text())


def test_a_day_without_a_change_has_no_gap(calibrated: Path) -> None:
    answer = diagnosed(calibrated, day(calibrated / "two", 2))
    assert answer["verdict"] == "none"
    assert not any("windows of" in warning for warning in answer["warnings"])  # all that there are are asked for


def test_a_heavier_car_is_named_and_the_corrected_simulator_replays_better(
    calibrated: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    logs = day(calibrated / "three", 3, m=1.16 * TRUE["m"])
    answer = diagnosed(calibrated, logs, "--report", str(calibrated / "three.html"))
    assert (answer["verdict"], answer["causes"]) == ("effect", ["mass_error"])
    mass = answer["magnitudes"]["mass_error"]
    assert mass["low"] <= 0.16 <= mass["high"]
    corrected, first = calibrated / "corrected.yaml", calibrated / "found.yaml"
    assert main(["apply", str(calibrated / "three.json"), "--vehicle", str(first), "--out", str(corrected)]) == 0
    capsys.readouterr()
    assert main(["replay", str(logs / "run_0.csv"), "--vehicle", str(first), "--corrected", str(corrected), "--json",
                 str(calibrated / "replay.json")]) == 0  # fmt: skip
    errors = json.loads((calibrated / "replay.json").read_text())["rms"]["v"]
    assert errors["corrected"] < 0.6 * errors["nominal"]


def test_a_drive_is_watched_with_the_simulator(calibrated: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Runs without a change raise nothing; a gain of the torque does, under its own name."""
    known, weak = day(calibrated / "as_before", 4), day(calibrated / "weak", 5)
    table = (weak / "run_0.csv").read_text().splitlines()
    at = table[0].split(",").index("tau_cmd")
    rows = [line.split(",") for line in table[1:]]
    for row in rows:  # what the car is asked for, of which it gives 0.75
        row[at] = f"{float(row[at]) / 0.75:.6g}"
    (weak / "run_0.csv").write_text("\n".join([table[0], *map(",".join, rows)]) + "\n")
    car = ["--vehicle", str(calibrated / "found.yaml"), "--calibration", str(calibrated / "found.json"), "--json", "-"]
    found = []
    for log in (known / "run_0.csv", known / "run_1.csv", weak / "run_0.csv"):
        assert main(["watch", str(log), *car]) == 0
        found.append([json.loads(line) for line in capsys.readouterr().out.splitlines()])
    for events in found[:2]:
        assert [event["event"] for event in events] == ["end"]
        assert events[0]["judged"] > 5.0
    causes = [event["cause"] for event in found[2] if event["event"] in ("change", "cause")]
    assert causes[-1] == "torque_gain_error"


def test_check_says_what_logs_would_show(calibrated: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", str(calibrated / "one"), "--vehicle", str(calibrated / "found.yaml"), "--calibration",
                 str(calibrated / "found.json")]) == 0  # fmt: skip
    said = capsys.readouterr().out
    assert "mass_error" in said
    assert main(["check", str(calibrated / "one"), "--vehicle", str(calibrated / "found.yaml")]) == 0
    assert "! not judged, since the simulator cannot have it: sliding_friction_drop" in capsys.readouterr().out


def test_what_has_no_equations_is_refused_in_a_sentence(calibrated: Path, capsys: pytest.CaptureFixture[str]) -> None:
    first = str(calibrated / "found.yaml")
    for command in (
        ["drive", "figure_8", "--vehicle", first],
        ["watch", str(calibrated / "one" / "run_0.csv"), "--vehicle", first],
        ["diagnose", str(calibrated / "one"), "--vehicle", first],
        ["identify", str(calibrated / "one"), "--vehicle", first, "--criterion", "likelihood"],
        ["identify", str(calibrated / "one"), "--vehicle", first, "--car", "double-track"],
    ):
        assert main(command) == 2
        said = capsys.readouterr().err
        assert "simulator" in said
        assert "Traceback" not in said
