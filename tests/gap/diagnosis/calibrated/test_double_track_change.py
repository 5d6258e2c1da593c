"""A car that no single-track model follows, by the commands: calibrated on two tracks, diagnosed, corrected, played."""

import json
from pathlib import Path

import pytest

from drift_drake.car.car_file import read_car
from drift_drake.car.double_track.parameters import CARS, DoubleTrackParameters
from drift_drake.car.given_vehicle import vehicle_given
from drift_drake.car.log.table import InvalidLogError
from drift_drake.car.parameters import InvalidVehicleError, VehicleParameters
from drift_drake.car.vehicle_file import write_vehicle
from drift_drake.cli.main import main
from drift_drake.common.first_use import SENTENCE
from drift_drake.gap.diagnosis.answers.answer import UnplannableError
from drift_drake.gap.diagnosis.likelihood.beliefs import Belief, Sensing
from drift_drake.gap.identification import by_prediction
from drift_drake.gap.identification import identify as identification
from drift_drake.gap.identification.calibration import read_trust
from drift_drake.gap.identification.identify import identify, may_have_two_tracks
from drift_drake.gap.next_drive import plan as next_drive
from drift_drake.gap.next_drive.plan import NextDrive
from tests.conftest import OtherCar
from tests.gap.diagnosis.calibrated.test_calibrated_command import write_day

KNOWN = ("mass", "front_axle_distance", "rear_axle_inertia", "torque", "steering_offset")
BAD_INPUT = 2


@pytest.fixture(scope="module")
def folder(other_car: OtherCar, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Files of a car that `identify` found by itself to have two tracks, and a day with a delay."""
    folder = tmp_path_factory.mktemp("double_track")
    write_day(folder / "baseline", other_car.runs)
    write_day(folder / "late", other_car.day({"steering_delay": 0.07}, 1))
    other_car.guess.to_yaml(folder / "start.yaml")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(identification, "FURTHER", ())
        patch.setattr(by_prediction, "MOST_WINDOWS", 100)
        code = main(["identify", str(folder / "baseline"), "--vehicle", str(folder / "start.yaml"), "--criterion",
                     "prediction", "--out", str(folder / "car.yaml"), "--json",
                     str(folder / "car.json"), "--quiet", "--effects", "tyre_relaxation", "--known",
                     *KNOWN])  # fmt: skip
    assert code == 0
    return folder


def test_two_tracks_are_chosen_by_held_out_errors_and_said(folder: Path) -> None:
    data = json.loads((folder / "car.json").read_text())
    (said,) = (warning for warning in data["warnings"] if warning.startswith("a double-track car"))
    assert "times the single-track car's" in said
    car, effects = read_car(folder / "car.yaml")
    assert isinstance(car, DoubleTrackParameters)
    assert effects.tyre_relaxation == 0.0  # it is in the tyres
    truth = CARS["coupe"].single_track()
    for name in ("friction", "front_stiffness", "rear_stiffness", "yaw_inertia"):
        stated = data["parameters"][name]
        assert stated["low"] <= getattr(truth, name) <= stated["high"], name
    for name in ("cg_height", "shape", "longitudinal_friction"):
        found = data["parameters"][name]
        assert found["low"] < found["estimate"] < found["high"]
        assert found["deviation"] <= found["prior"] * 1.001
    normal = read_trust(folder / "car.json").normal
    assert normal is not None
    assert "cg_height" in normal.of_kind
    assert "longitudinal_load_transfer" not in normal.names  # this car has its own


def test_a_day_is_diagnosed_applied_and_played(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    car, answer, corrected = (str(folder / name) for name in ("car.yaml", "answer.json", "corrected.yaml"))
    asked = ["diagnose", str(folder / "late"), "--vehicle", car, "--calibration", str(folder / "car.json"), "--quiet",
             "--workers", "1", "--effects", "steering_delay", "friction_level", "gyro_bias"]  # fmt: skip
    assert main([*asked, "--json", answer, "--report", str(folder / "answer.html")]) == 0
    data = json.loads(Path(answer).read_text())
    assert data["causes"] == ["steering_delay"]
    assert data["magnitudes"]["steering_delay"]["low"] <= 0.07 <= data["magnitudes"]["steering_delay"]["high"]
    assert main(["apply", answer, "--vehicle", car, "--out", corrected]) == 0
    vehicle, effects = read_car(corrected)
    assert isinstance(vehicle, DoubleTrackParameters)
    assert effects.steering_delay == pytest.approx(data["magnitudes"]["steering_delay"]["estimate"])
    played = str(folder / "played.json")
    run = str(folder / "late" / "run_0.csv")
    assert main(["replay", run, "--vehicle", car, "--corrected", corrected, "--json", played]) == 0
    rms = json.loads(Path(played).read_text())["rms"]
    assert rms["r"]["corrected"] < 0.5 * rms["r"]["nominal"]
    assert "double" not in capsys.readouterr().err


@pytest.mark.parametrize(
    ("command", "words"),
    [
        (["diagnose", "LATE"], "give --calibration"),
        (["check", "LATE"], "give --calibration"),
        (["simulate", "slalom", "--out", "LATE/simulated.csv"], "give a single-track vehicle file"),
    ],
)
def test_what_asks_for_a_single_track_car_says_so(
    folder: Path, command: list[str], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    given = [part.replace("LATE", str(folder / "late")) for part in command]
    assert main([*given, "--vehicle", str(folder / "car.yaml")]) == BAD_INPUT
    said = capsys.readouterr().err
    assert words in said
    assert "Traceback" not in said


def test_a_bank_of_filters_takes_the_single_track_car_that_is_kept(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Windows are the double-track car's own. Of a file that keeps no other the sentence says what writes one."""
    log, given = str(folder / "baseline" / "run_0.csv"), vehicle_given(folder / "car.yaml")
    assert main(["watch", log, "--vehicle", str(folder / "car.yaml"), "--calibration", str(folder / "car.json")]) == 0
    said = capsys.readouterr()
    assert "nothing has changed" in said.out
    assert said.err.replace(f"{SENTENCE}\n", "") == ""
    assert main(["watch", log, "--vehicle", str(folder / "car.yaml")]) == 0
    assert "this uses the single-track car that was calibrated on the same logs" in capsys.readouterr().err
    alone = folder / "alone.yaml"
    write_vehicle(alone, given.parameters, given.effects)
    assert main(["watch", log, "--vehicle", str(alone)]) == BAD_INPUT
    assert "that 'drift-drake identify --car auto' or '--car single-track' writes" in capsys.readouterr().err


def test_the_next_drive_is_planned_for_the_single_track_car_that_is_kept(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Between the hypotheses that the answer of the double-track car leaves open."""
    planned = []

    def plan(vehicle: VehicleParameters, sensing: Sensing, beliefs: list[Belief], _: object) -> NextDrive:
        planned.append((vehicle, sensing.own, [belief.names for belief in beliefs]))
        raise UnplannableError("planned")

    monkeypatch.setattr(next_drive, "plan_next", plan)
    car, answer = str(folder / "car.yaml"), str(folder / "open.json")
    assert main(["diagnose", str(folder / "baseline"), "--vehicle", car, "--calibration", str(folder / "car.json"),
                 "--quiet", "--workers", "1", "--effects", "steering_delay", "road_grade", "gyro_bias", "--json",
                 answer]) == 0  # fmt: skip
    main(["plan-next", answer, "--vehicle", car])
    assert "this uses the single-track car" in capsys.readouterr().err
    (found,) = planned
    assert found[:2] == vehicle_given(car).single_track
    assert len(found[2]) > 1


def test_a_calibration_of_the_other_kind_of_car_is_refused(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    asked = ["diagnose", str(folder / "late"), "--vehicle", str(folder / "start.yaml"), "--calibration",
             str(folder / "car.json"), "--quiet"]  # fmt: skip
    assert main(asked) == BAD_INPUT
    assert "the calibration is of another kind of car" in capsys.readouterr().err


def test_a_car_driven_at_both_axles_is_no_double_track_one(other_car: OtherCar) -> None:
    driven = other_car.guess.replace(front_coupling=1.0)
    assert not may_have_two_tracks(other_car.runs, driven)
    assert not may_have_two_tracks([run.without("tau_cmd") for run in other_car.runs], other_car.guess)
    with pytest.raises(InvalidVehicleError, match="drives its rear wheels alone, and front_coupling is 1"):
        identify(other_car.runs, driven, criterion="prediction", car="double-track")


def test_by_likelihood_it_cannot_be_calibrated(other_car: OtherCar) -> None:
    with pytest.raises(InvalidLogError, match="a double-track car is calibrated by prediction"):
        identify(other_car.runs, VehicleParameters(), criterion="likelihood", car="double-track")
