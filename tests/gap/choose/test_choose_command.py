"""`drift-drake choose` as a user calls it."""

import json
import re
from collections.abc import Callable
from pathlib import Path

import pandas as pd
import pytest

from drift_drake.car.car_file import read_car
from drift_drake.car.double_track.parameters import CARS
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.log.table import COLUMNS
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.vehicle_file import read_vehicle, write_vehicle
from drift_drake.cli.main import main
from drift_drake.common.interruption import BAD_INPUT
from drift_drake.drive.gathering.config import GatheringConfig
from drift_drake.drive.gathering.gather import gather
from drift_drake.drive.gathering.plan import plan_drive
from drift_drake.drive.learnt.checkpoint import BayesianModel
from drift_drake.gap.choose.choice import Choice, Findings
from drift_drake.gap.choose.identified import IdentifiedCar
from experiments.benchmarks.vehicles import draw_effects


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory, model: BayesianModel) -> Path:
    """An informative plan driven twice by a vehicle that no model was trained on."""
    config, folder = GatheringConfig(starts=1, max_iterations=20), tmp_path_factory.mktemp("choose")
    plan = plan_drive(model, model.prior(), config, config.alpha)
    for seed in range(2):
        table, _ = gather(plan, draw_effects("validation", 0, 98001), VehicleParameters(), config, seed)
        table[[name for name in COLUMNS if name in table]].to_csv(folder / f"run_{seed}.csv", index=False)
    return folder


def test_the_logs_of_a_car_say_which_model_may_drive_it(
    logs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, found = tmp_path / "identified.yaml", tmp_path / "choice.json"
    assert main(["choose", str(logs), "--out", str(out), "--json", str(found)]) == 0
    said, choice = capsys.readouterr().out, json.loads(found.read_text())
    assert ("drive with the identified car: " in said) == (choice["believed"] == "identified")
    assert "; no car" not in said
    assert f"{out}: the car that the logs identify" in said
    assert choice["doubts"] == []
    assert choice["forecast_error"] < 0.05
    assert choice["tracks"] == 1
    assert choice["rehearsal"]["can"]
    assert "rehearsed in simulation, the identified car drifts the figure-8" in said
    vehicle, effects = read_vehicle(out)
    assert vehicle.mass == pytest.approx(choice["vehicle"]["mass"])
    assert effects.steering_lag == pytest.approx(choice["effects"].get("steering_lag", 0.0))


def test_logs_too_short_identify_no_car(logs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out, short = tmp_path / "identified.yaml", tmp_path / "run_0.csv"
    pd.read_csv(logs / "run_0.csv").iloc[:350].to_csv(short, index=False)
    assert main(["choose", str(short), "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert "; no car was identified" in said
    assert f"{out}: not written, since no car was identified" in said
    assert not out.exists()


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda table: table.drop(columns="beta"), "run run_0 has no column beta"),
        (lambda table: table.iloc[::2], "the rows of run run_0 are 0.02 s apart; what is usual was measured on rows"),
    ],
)
def test_a_log_that_cannot_be_asked_is_said_so(
    change: Callable[[pd.DataFrame], pd.DataFrame],
    said: str,
    logs: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    path = tmp_path / "run_0.csv"
    change(pd.read_csv(logs / "run_0.csv")).to_csv(path, index=False)
    assert main(["choose", str(path)]) == BAD_INPUT
    assert said in capsys.readouterr().err


@pytest.fixture(scope="module")
def check(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A slow drive of a car whose steering turns at most 0.3 rad/s."""
    folder = tmp_path_factory.mktemp("check")
    effects = draw_effects("validation", 0, 98001)._replace(steering_rate_limit=0.3)
    write_vehicle(folder / "car.yaml", VehicleParameters(), effects)
    drive = ["simulate", "steering_check", "--vehicle", str(folder / "car.yaml"), "--out", str(folder / "check.csv")]
    assert main(drive) == 0
    return folder / "check.csv"


def test_a_check_of_several_runs_is_refused(logs: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["choose", str(logs), "--check", str(logs)]) == 2
    assert re.search(r"holds \d runs; give the file of one to --check", capsys.readouterr().err)


def test_a_check_shows_a_limit_of_the_steering_that_drives_kept_below(
    logs: Path, check: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The drives are of a car that has none: what is identified from them begins with the check's."""
    out = tmp_path / "identified.yaml"
    assert main(["choose", str(logs), "--check", str(check), "--out", str(out), "--no-rehearse"]) == 0
    said = capsys.readouterr().out
    assert f"{check}: a steering that is 0.0" in said
    assert "late, as if it turned at most 0.29 rad/s" in said
    assert "the identified car with steering_rate_limit" in said
    assert read_vehicle(out)[1].steering_rate_limit >= 0.29


def test_a_check_of_something_else_is_refused(
    logs: Path, check: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table, other = pd.read_csv(check), tmp_path / "other.csv"
    for change, said in (
        ({"delta_cmd": table["delta_cmd"].iloc[::-1].to_numpy()}, "the steering does not explain the yaw rate; drive"),
        ({"t": 2.0 * table["t"]}, "rows are 0.02 s apart; give a log with 0.01 s"),
    ):
        table.assign(**change).to_csv(other, index=False)
        assert main(["choose", str(logs), "--check", str(other)]) == BAD_INPUT
        message = capsys.readouterr().err
        assert said in message
        assert str(other) in message
        assert message.count("\n") == 1


def test_a_double_track_car_is_written_as_one(
    logs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    car, out = IdentifiedCar(CARS["saloon"], Effects(steering_lag=0.05)), tmp_path / "identified.yaml"
    monkeypatch.setattr("drift_drake.gap.choose.choice.ask", lambda *_: Choice(Findings(car, 0.01), 0.012))
    assert main(["choose", str(logs), "--out", str(out), "--json", str(tmp_path / "choice.json")]) == 0
    assert "drive with the identified double-track car: " in capsys.readouterr().out
    assert read_car(out) == car
    choice = json.loads((tmp_path / "choice.json").read_text())
    assert (choice["tracks"], choice["vehicle"]["front_tire"]["shape"]) == (2, 1.25)


def test_a_double_track_car_is_a_first_guess_too(logs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As `identify` writes it, and as what `choose` itself has identified."""
    asked = []
    monkeypatch.setattr("drift_drake.gap.choose.choice.ask",
                        lambda _, first, *__: asked.append(first) or Choice(Findings(None), 0.012))  # fmt: skip
    write_vehicle(tmp_path / "car.yaml", CARS["saloon"], Effects(), (CARS["saloon"].single_track(), Effects()))
    assert main(["choose", str(logs), "--vehicle", str(tmp_path / "car.yaml")]) == 0
    assert asked == [CARS["saloon"]]
