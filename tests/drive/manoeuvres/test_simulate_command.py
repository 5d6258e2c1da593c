"""`drift-drake simulate`: manoeuvres by name, other logs' commands, and what it refuses."""

import json

import numpy as np
import pandas as pd
import pytest

from drift_drake.car.effects.magnitudes import make_effects
from drift_drake.car.log.table import read_run
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.vehicle_file import write_vehicle
from drift_drake.cli.main import main
from drift_drake.drive.manoeuvres.simulate import MANOEUVRES
from drift_drake.drive.manoeuvres.steering_check import steering_of
from drift_drake.drive.reference.similarity import Similarity


@pytest.fixture
def vehicle(tmp_path):
    path = tmp_path / "car.yaml"
    write_vehicle(path, VehicleParameters(), make_effects({"aero_drag": 1.0}))
    return path


def simulate(vehicle, drive, name, *more):
    out = vehicle.parent / name
    assert main(["simulate", str(drive), "--vehicle", str(vehicle), "--out", str(out), *more]) == 0
    return read_run(out)


@pytest.mark.parametrize("name", ["straight", "step_steer", "slalom", "steering_check", "figure_8"])
def test_each_manoeuvre_writes_a_log(vehicle, name, capsys):
    run = simulate(vehicle, name, "run_0.csv", "--duration", "1.5")
    assert len(run) == 151
    np.testing.assert_allclose(run.t, 0.01 * np.arange(151), atol=1e-12)
    assert "ended as planned" in capsys.readouterr().out
    if name == "straight":
        assert run.v[-1] > run.v[0] + 2.0
    if name == "steering_check":
        assert run.delta_cmd.max() > 0.1 > -0.1 > run.delta_cmd.min()
    if name == "figure_8":
        assert abs(run.beta[-1]) > 0.3


def test_a_small_car_is_checked_at_its_own_speed(tmp_path):
    """A tenth of the length: by Froude's similarity a third of the speed, in a third of the time."""
    path, small = tmp_path / "small.yaml", Similarity(10.0, 10.0**0.5, 1000.0).usual(VehicleParameters())
    write_vehicle(path, small, make_effects({"steering_rate_limit": 1.5}))
    run = simulate(path, "steering_check", "run_0.csv", "--noise", "0.1")
    assert run.t[-1] == pytest.approx(4.5 * 0.1**0.5, abs=0.01)
    assert run.v.mean() == pytest.approx(6.0 * 0.1**0.5, rel=0.03)
    assert steering_of(run, small).rate == pytest.approx(1.5, rel=0.15)


def test_the_catalogue_of_manoeuvres_is_in_the_help(capsys):
    with pytest.raises(SystemExit):
        main(["simulate", "--help"])
    said = capsys.readouterr().out
    assert all(name in said for name in MANOEUVRES)


def test_a_seed_replays_and_noise_can_be_left_out(vehicle):
    more = ("--duration", "1", "--json", str(vehicle.parent / "driven.json"))
    first, again = (simulate(vehicle, "slalom", f"{k}.csv", *more) for k in "ab")
    np.testing.assert_array_equal(first.r, again.r)
    other = simulate(vehicle, "slalom", "c.csv", *more, "--seed", "1")
    assert np.any(other.r != first.r)
    quiet = simulate(vehicle, "step_steer", "d.csv", "--duration", "0.9", "--noise", "0")
    np.testing.assert_array_equal(quiet.r, 0.0)
    assert json.loads((vehicle.parent / "driven.json").read_text())["effects"] == {"aero_drag": 1.0}


def test_what_was_driven_goes_to_standard_output(vehicle, capsys):
    simulate(vehicle, "slalom", "a.csv", "--duration", "1", "--json", "-")
    out, error = capsys.readouterr()
    assert json.loads(out)["ending"] == "time"
    assert "ended as planned" in error


def test_a_log_drives_again_by_its_commands(vehicle):
    first = simulate(vehicle, "step_steer", "run_0.csv.gz", "--noise", "0", "--duration", "2.5")
    again = simulate(vehicle, vehicle.parent / "run_0.csv.gz", "again.csv", "--noise", "0")
    np.testing.assert_allclose(again.r, first.r, atol=2e-4)
    commands = pd.DataFrame({"t": first.t, "delta_cmd": first.delta_cmd, "tau_cmd": first.tau_cmd})
    commands.to_csv(vehicle.parent / "commands.csv", index=False)
    from_commands = simulate(vehicle, vehicle.parent / "commands.csv", "third.csv", "--noise", "0", "--speed", "12")
    np.testing.assert_allclose(from_commands.v, first.v, atol=2e-2)


@pytest.mark.parametrize(
    ("drive", "more", "says"),
    [
        ("donut", [], "donut: no such file or manoeuvre; give a log or one of straight, step_steer, slalom"),
        ("TABLE", [], "table.csv: missing column tau_cmd; driving needs t, delta_cmd, tau_cmd"),
        ("slalom", ["--noise", "-1"], "--noise -1: give 0 or more"),
        ("slalom", ["--speed", "1"], "--speed 1: give 3 to 100 m/s for this car"),
    ],
)
def test_bad_input_is_one_sentence_and_exit_code_2(vehicle, capsys, drive, more, says):
    table = vehicle.parent / "table.csv"
    pd.DataFrame({"t": [0.0, 0.01], "delta_cmd": [0.0, 0.0]}).to_csv(table, index=False)
    drive = str(table) if drive == "TABLE" else drive
    assert main(["simulate", drive, "--vehicle", str(vehicle), "--out", str(vehicle.parent / "x.csv"), *more]) == 2
    error = capsys.readouterr().err
    assert says in error
    assert error.count("\n") == 1
