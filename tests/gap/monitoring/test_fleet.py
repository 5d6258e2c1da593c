"""A fleet in one model: what all share, what one car has, what one day brings; from scores that are drawn here."""

import dataclasses

import numpy as np
import pytest

from drift_drake.car.effects.magnitudes import Effects, make_effects
from drift_drake.car.given_vehicle import GivenVehicle
from drift_drake.car.log.table import write_run
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.vehicle_file import write_vehicle
from drift_drake.cli.fleet import day_folders
from drift_drake.cli.main import main
from drift_drake.common.errors import DriftDrakeError
from drift_drake.common.run_folder import to_json
from drift_drake.gap.monitoring.bank import make_nodes
from drift_drake.gap.monitoring.baselines import learn_baseline
from drift_drake.gap.monitoring.evidence import evidence_problem
from drift_drake.gap.monitoring.fleet import fleet_findings
from drift_drake.gap.monitoring.fleet_days import FleetDay, Judge, days_of, shared_columns
from drift_drake.gap.monitoring.fleet_page import lines
from experiments.monitoring.drives import changed_double_track_drive, changed_drive
from tests.conftest import OtherCar

NODES = make_nodes(["aero_drag", "mass_error", "steering_delay", "gyro_bias", "torque_gain_error"], VehicleParameters())
PROBLEM = evidence_problem(NODES, np.zeros(len(NODES)))
NAMES = [node.name for node in NODES]


def day(rng: np.random.Generator, car: str, name: str, amplitudes: dict[str, float]) -> FleetDay:
    """A day whose scores are white about known amplitudes."""
    m = np.linalg.qr(rng.normal(size=(200, len(NODES))))[1] * np.sqrt(len(NODES))
    truth = np.zeros(len(NODES))
    for effect, amplitude in amplitudes.items():
        truth[NAMES.index(effect)] = amplitude
    return FleetDay(car, name, m @ truth + rng.normal(size=len(NODES)), m)


def fleet(shared: dict[str, float], own: dict[str, dict[str, float]], daily: dict[str, dict[str, float]]):
    rng = np.random.default_rng(3)
    days = [day(rng, f"car_{c}", f"day_{d}", shared | own.get(f"car_{c}", {}) | daily.get(f"car_{c}/day_{d}", {}))
            for c in range(6) for d in range(2)]  # fmt: skip
    return fleet_findings(PROBLEM, days)


def drifting(cars: int, drift: float, own: float = 0.0, dates: int = 5):
    """Cars whose drag grows by `drift` from the first day to the last, and by `own` more on the first car."""
    rng = np.random.default_rng(5)
    return fleet_findings(PROBLEM, [
        day(rng, f"car_{c}", f"day_{d}", {"aero_drag": (drift + own * (c == 0)) * d / (dates - 1)})
        for c in range(cars) for d in range(dates)
    ])  # fmt: skip


def test_a_common_drift_is_distinguished_from_one_cars() -> None:
    drag = NODES[NAMES.index("aero_drag")].magnitude
    (shared,), (own,) = drifting(5, 2.0).tables, drifting(5, 0.0, 2.0).tables
    for table, q in ((shared, shared.parts.drift), (own, own.parts.drifts["car_0"])):
        assert table.effect == "aero_drag"
        assert q is not None
        assert q.low < 2.0 * drag < q.high
        assert q.low > 0.5 * drag
    assert all(q.low < 0.0 < q.high for q in shared.parts.drifts.values())
    assert own.parts.drift is not None
    assert own.parts.drift.low < 0.0
    assert ("drift", "") in {(term.level, term.owner) for term in drifting(5, 2.0).terms}


def test_of_one_car_alone_nothing_is_common() -> None:
    found = drifting(1, 2.0)
    (table,) = found.tables
    assert table.parts.common is None
    assert table.parts.drift is None
    assert not table.parts.days
    assert table.parts.drifts["car_0"].low > 0.0
    assert "one car alone: what all cars would have cannot be distinguished from its own" in "\n".join(lines(found))


def test_a_batch_that_all_cars_have_is_common_and_no_cars_own() -> None:
    (table,) = fleet({"aero_drag": 1.5}, {}, {}).tables
    assert table.parts.common is not None
    assert table.parts.common.low > 0.0
    assert all(q.low < 0.0 < q.high for q in table.parts.cars.values())


def test_shared_own_and_daily_effects_are_kept_apart():
    found = fleet({"aero_drag": 0.6}, {"car_2": {"mass_error": 0.8}}, {"car_4/day_1": {"gyro_bias": -0.9}})
    reported = {(term.level, term.owner, term.effect): term for term in found.terms}
    assert set(reported) == {
        ("fleet", "", "aero_drag"),
        ("car", "car_2", "mass_error"),
        ("day", "car_4/day_1", "gyro_bias"),
    }
    drag = reported["fleet", "", "aero_drag"]
    truth = 0.6 * NODES[NAMES.index("aero_drag")].magnitude
    assert drag.low - 0.05 < truth < drag.high + 0.05
    assert not found.outliers
    assert "all cars: aero_drag" in "\n".join(lines(found))


def test_a_fleet_that_the_simulator_knows_lacks_nothing():
    found = fleet({}, {}, {})
    assert not found.terms
    assert lines(found)[1].strip() == "nothing is missing from the simulator"


def test_folders_of_cars_and_days(tmp_path):
    for place in ("a/monday/run_0.csv", "a/tuesday/run_0.csv", "b/run_0.csv"):
        path = tmp_path / place
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    assert list(day_folders(tmp_path)) == [("a", "monday"), ("a", "tuesday"), ("b", "runs")]
    with pytest.raises(DriftDrakeError, match="no such folder"):
        day_folders(tmp_path / "nowhere")
    (tmp_path / "empty").mkdir()
    with pytest.raises(DriftDrakeError, match="holds no cars"):
        day_folders(tmp_path / "empty")


def test_days_are_compared_by_what_all_runs_have_each_at_its_own_rate(tmp_path):
    run = changed_drive("slalom", Effects(), 1.0, seed=3, duration=6.0)
    folders = {("a", "runs"): tmp_path / "a", ("b", "runs"): tmp_path / "b"}
    write_run(run, tmp_path / "a" / "run_0.csv")
    write_run(run.thinned(2).without("beta", "psi"), tmp_path / "b" / "run_0.csv")
    write_run(run, tmp_path / "b" / "run_1.csv")
    used = shared_columns(folders)
    assert used == ("r", "v", "omega_r", "ax", "ay")
    judge = Judge(GivenVehicle(VehicleParameters(), Effects()), used)
    found = fleet_findings(judge.problem(), days_of(folders, judge))
    assert not found.terms
    assert not found.outliers


def test_days_of_a_car_calibrated_by_prediction_are_judged_by_windows(other_car: OtherCar, tmp_path, capsys) -> None:
    found = other_car.found
    write_vehicle(tmp_path / "car.yaml", found.vehicle, found.effects)
    watching = learn_baseline(other_car.runs, found.vehicle, found.effects, other_car.normal)
    (tmp_path / "car.json").write_text(to_json({"normal": other_car.normal, "watching": watching}))
    for car, effects in (("a", {}), ("b", {}), ("c", {"gyro_bias": 0.03})):
        for i in range(2):
            run = changed_double_track_drive("slalom", make_effects(effects), 0.0, 10 + i, 8.0)
            write_run(run, tmp_path / "fleet" / car / f"day_{i}" / "run_0.csv")
    files = ["--vehicle", str(tmp_path / "car.yaml"), "--calibration", str(tmp_path / "car.json")]
    page = tmp_path / "fleet.html"
    assert main(["fleet", str(tmp_path / "fleet"), *files, "--workers", "1", "--page", str(page)]) == 0
    said = capsys.readouterr().out
    assert "  c: gyro_bias +0.0" in said
    assert "all cars" not in said.split("over cars and days")[0]
    assert "<td>c</td>" in page.read_text()


def test_mistakes_are_one_sentence(tmp_path, capsys):
    run = changed_drive("slalom", Effects(), 1.0, seed=3, duration=1.0)
    write_run(run.without("tau_cmd"), tmp_path / "fleet" / "a" / "run_0.csv")
    VehicleParameters().to_yaml(tmp_path / "car.yaml")
    command = ["fleet", str(tmp_path / "fleet"), "--vehicle", str(tmp_path / "car.yaml")]
    assert main(command) == 2
    assert "a/run_0.csv: has no column tau_cmd" in capsys.readouterr().err
    assert main([*command, "--workers", "0"]) == 2
    assert "--workers 0: give 1 or more" in capsys.readouterr().err


def test_what_all_cars_have_hides_no_cars_own():
    """A strong shared effect is seen on all cars, so that it makes none of them doubtful."""
    weak = {"car_3": {"torque_gain_error": 0.45}}
    alone, among_others = fleet({}, weak, {}), fleet({"aero_drag": 4.0}, weak, {})
    for found in (alone, among_others):
        assert ("car_3", "torque_gain_error") in {(term.owner, term.effect) for term in found.terms}


@pytest.mark.slow
def test_a_cluster_finds_what_one_process_finds(tmp_path):
    distributed = pytest.importorskip("distributed", reason="an extra: pip install drift_drake[cluster]")
    run = changed_drive("slalom", Effects(), 1.0, seed=3, duration=3.0)
    for car in "ab":
        write_run(run, tmp_path / "fleet" / car / "run_0.csv")
    VehicleParameters().to_yaml(tmp_path / "car.yaml")
    command = ["fleet", str(tmp_path / "fleet"), "--vehicle", str(tmp_path / "car.yaml"), "--json"]
    assert main([*command, str(tmp_path / "here.json"), "--workers", "1"]) == 0
    with distributed.LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address="127.0.0.1:0") as cluster:
        assert main([*command, str(tmp_path / "there.json"), "--scheduler", cluster.scheduler_address]) == 0
    assert (tmp_path / "there.json").read_bytes() == (tmp_path / "here.json").read_bytes()


def test_days_of_which_nothing_can_be_judged_are_reported(tmp_path, capsys):
    run = changed_drive("slalom", Effects(), 1.0, seed=3, duration=3.0)
    still = dataclasses.replace(run, v=0.0 * run.v)
    write_run(still, tmp_path / "fleet" / "a" / "run_0.csv")
    VehicleParameters().to_yaml(tmp_path / "car.yaml")
    command = ["fleet", str(tmp_path / "fleet"), "--vehicle", str(tmp_path / "car.yaml"), "--workers", "1"]
    assert main(command) == 2
    assert "of each day less than 2 s can be judged" in capsys.readouterr().err
    write_run(run, tmp_path / "fleet" / "b" / "run_0.csv")
    assert main(command) == 0
    reported = capsys.readouterr()
    assert (
        "left out, since less than 2 s can be judged: at rest, nearly so, sideways, or harder than calibrated: a/runs"
        in reported.err
    )
    assert reported.out.startswith("1 cars, 1 days")


def test_a_watched_car_at_rest_is_no_car_that_agrees(tmp_path, capsys):
    run = changed_drive("slalom", Effects(), 1.0, seed=3, duration=3.0)
    write_run(dataclasses.replace(run, v=0.0 * run.v), tmp_path / "still.csv")
    write_run(run, tmp_path / "drive.csv")
    VehicleParameters().to_yaml(tmp_path / "car.yaml")
    assert main(["watch", str(tmp_path / "still.csv"), "--vehicle", str(tmp_path / "car.yaml")]) == 0
    assert "no row can be judged: the equations hold above 3 m/s" in capsys.readouterr().out
    assert main(["watch", str(tmp_path / "drive.csv"), "--vehicle", str(tmp_path / "car.yaml")]) == 0
    assert "nothing has changed in the 2.7 s that could be judged" in capsys.readouterr().out
