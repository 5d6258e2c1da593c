"""The road over other worlds without its long work: what is scored, what is kept, what is made and refused."""

import dataclasses
import json

import numpy as np
import pytest

from drift_drake.car.log.table import InvalidLogError
from experiments.other_worlds import jobs, make_worlds, road
from experiments.other_worlds.calibrations import calibration_row, calibration_scores, calibrations_text
from experiments.other_worlds.jobs import CRASHED, REFUSED, Calibrate, answer_of, failure_path, recorded
from experiments.other_worlds.make_worlds import MissingWorldError, MultiBody, Worlds, check_multibody, worlds_of
from experiments.other_worlds.pictures import draw_rows
from experiments.other_worlds.scoring import NO_LIMIT, Row, all_scores, ordered, scores_text, share, size_name


def answer(said, truth_in_set=(), magnitudes=None, detection=None):
    """An answer that names `said`."""
    effect = said not in ("none", "unknown")
    return {
        "verdict": "effect" if effect else said,
        "causes": said.split("+") if effect else [],
        "posterior": {said: 0.9, "other": 0.1},
        "ambiguity": [said, *truth_in_set],
        "magnitudes": magnitudes or {},
        "reduction": {"estimate": 0.8, "low": 0.7, "high": 0.9},
        "details": {"detection": detection or {}},
        "warnings": [],
        "seconds": 2.0,
        "cpu_seconds": 3.0,
    }


def row(effects, a, world="a", car="coupe"):
    return Row(world, car, "0123", effects, a)


LAG = {"steering_lag": {"estimate": 0.1, "low": 0.08, "high": 0.12}}
ROWS = [
    row({"steering_lag": 0.1}, answer("steering_lag", magnitudes=LAG, detection={"steering_lag": {"least": 0.04}})),
    row({"steering_lag": 0.2}, answer("steering_lag", magnitudes=LAG), world="b"),
    row({"mass_error": 0.1}, answer("none", ("mass_error",), detection={"mass_error": {"least": 0.2}})),
    row({}, answer("none")),
    row({}, answer("unknown"), world="b", car="saloon"),
]


def test_scores_count_what_was_right_in_the_set_and_covered():
    s = all_scores(ROWS)["all"]
    assert (s["right"]["hits"], s["right"]["count"]) == (3, 5)
    assert s["effects named"]["hits"] == 2
    assert s["effects in the ambiguity set"]["hits"] == 3
    assert s["effects called none"]["hits"] == 1
    assert (s["days with none: false alarms"]["hits"], s["days with none: false alarms"]["count"]) == (1, 2)
    assert s["days with none: an effect is named"]["hits"] == 0
    covered = s["intervals that hold the magnitude"]
    assert (covered["hits"], covered["count"]) == (1, 2)


def test_scores_by_group():
    result = all_scores(ROWS)
    assert list(result["by effect"]) == ["mass_error", "steering_lag", "none"]
    assert result["by car"]["saloon"]["right"]["hits"] == 0
    assert result["by size"]["below its detection limit"]["right"]["count"] == 1
    assert result["by size"]["above 2 limits"]["right"]["hits"] == 1
    assert [m["said"] for m in result["not right"]] == ["none", "unknown"]
    text = scores_text(result)
    assert "| steering_lag | 2 of 2: 1.00" in text
    assert "answered as unknown" in text
    json.dumps(result)


def strange(a, kind="gyro_drift", **more):
    a["details"] |= more
    return Row("a", "coupe", "0123", {}, a, kind)


STRANGE = [
    strange(answer("unknown"), decision="cause_open"),
    strange(answer("mass_error"), decision="cause", left_over={"probability": 0.8, "share": 0.4}),
    strange(answer("mass_error"), "jittered_commands", decision="cause"),
    strange(answer("none", ("mass_error+unknown",)), "jittered_commands", decision="undecided"),
]


def test_strange_faults_have_figures_of_their_own():
    result = all_scores([*ROWS, *STRANGE])
    assert result["all"] == all_scores(ROWS)["all"]
    s = result["strange faults"]
    assert (s["unknown, or a cause and something else"]["hits"], s["unknown"]["count"]) == (2, 4)
    assert s["a catalogued cause alone at p > 0.8"]["hits"] == 1
    assert s["called none"]["hits"] == 1
    assert result["by strange fault"]["gyro_drift"]["unknown, or a cause and something else"]["share"] == 1.0
    assert [row.held for row in STRANGE] == [True, True, False, True]
    text = scores_text(result)
    assert "jittered_commands answered as mass_error" in text
    assert "| jittered_commands | 0 of 2: 0.00" in text
    draw_rows([*ROWS, *STRANGE])
    json.dumps(result)


def test_decisions_are_counted_by_kind_of_day():
    result = all_scores([*ROWS, *STRANGE])["decisions"]
    assert result["with an effect"]["cause"]["count"] == 0  # of answers that have none
    decided = {name: (s["hits"], s["count"]) for name, s in result["with a strange fault"].items()}
    assert decided == {"none": (0, 0), "cause": (1, 2), "cause_open": (1, 1), "undecided": (0, 1)}


def test_a_cause_with_something_else_too_has_the_probability_of_both():
    a = answer("mass_error") | {"posterior": {"mass_error": 0.5, "mass_error+unknown": 0.4, "none": 0.1}}
    assert strange(a).sure_alone
    a["details"]["left_over"] = {"probability": 0.6}
    assert not strange(a).sure_alone


def test_a_limit_that_acts_the_more_the_lower_it_is_has_its_size_inverted():
    slow = row({"steering_rate_limit": 0.3}, answer("none", detection={"steering_rate_limit": {"least": 0.9}}))
    assert slow.size == pytest.approx(3.0)
    negative = row({"gyro_bias": -0.03}, answer("none", detection={"gyro_bias": {"least": 0.02}}))
    assert negative.size == pytest.approx(1.5)
    assert size_name(row({"mass_error": 0.1}, answer("none", detection={"mass_error": {"least": None}}))) == NO_LIMIT


def test_a_case_without_an_answer_counts_as_wrong_and_is_reported(tmp_path):
    out = tmp_path / "code.json"

    def broken(_part):
        raise np.linalg.LinAlgError("Singular matrix")

    recorded(broken, out)
    rows = [*ROWS, row({"mass_error": 0.1}, answer_of(out)), row({}, answer_of(out))]
    result = all_scores(rows)
    assert not out.exists()
    assert result["all"]["right"]["count"] == 7
    assert result["all"]["without an answer"]["hits"] == 2
    assert result["all"]["days with none: false alarms"]["hits"] == 1
    assert "crashed (LinAlgError: Singular matrix)" in scores_text(result)
    assert "traceback" in json.loads(failure_path(out).read_text())
    assert ordered({CRASHED, "none", "cg_shift", "unknown"}) == ["cg_shift", "none", "unknown", CRASHED]
    draw_rows(rows)


def test_a_failure_gives_way_to_an_answer(tmp_path):
    out = tmp_path / "code.json"

    def refused(_part):
        raise InvalidLogError("1.2 s of driving can be used")

    recorded(refused, out)
    assert answer_of(out)["verdict"] == REFUSED
    recorded(lambda part: part.write_text('{"verdict": "none"}'), out)
    assert answer_of(out)["verdict"] == "none"
    assert answer_of(out)["cpu_seconds"] >= 0.0
    assert [path.name for path in tmp_path.iterdir()] == ["code.json"]


def test_shares_of_nothing_have_no_value():
    assert share([])["share"] is None
    s = share([True] * 20)
    assert s["high"] == 1.0
    assert s["low"] == pytest.approx(0.025 ** (1 / 20), rel=1e-6)  # Clopper and Pearson's, in closed form


PARAMETERS = {
    "gear_ratio": {"estimate": 10.2, "low": 9.9, "high": 10.5, "deviation": 0.15, "prior": 0.6},
    "yaw_inertia": {"estimate": 1500.0, "low": 1450.0, "high": 1550.0, "deviation": 25.0, "prior": 300.0},
}
CAR = {
    "criterion": "prediction", "seconds": 60.0, "cpu_seconds": 90.0, "parameters": PARAMETERS, "warnings": [],
    "held_out": {"ratio": 0.5, "low": 0.4, "high": 0.6, "states": ["r", "v"], "before": [[1.0, 1.0], [0.4, 0.2]],
                 "after": [[1.0, 1.0], [0.1, 0.3]], "by_state": [[0.2, 0.3], [1.1, 1.9]]},
}  # fmt: skip
START = """mass: 1200.0\nyaw_inertia: 1800.0\nfront_axle_distance: 1.2\nrear_axle_distance: 1.4\nwheel_radius: 0.3
rear_axle_inertia: 20.0\ngear_ratio: 10.0\nfriction: 1.0\nfront_stiffness: 1.0e5\nrear_stiffness: 1.0e5\ngravity: 9.81
steering_limit: 0.6\ntorque_min: -50.0\ntorque_max: 400.0\n"""


def calibrated(tmp_path, name="car"):
    job = Calibrate((), tmp_path / "start.yaml", tmp_path / name)
    job.start.write_text(START)
    job.folder.mkdir()
    job.out.write_text(json.dumps(CAR))
    return job


def test_own_figures_are_held_or_not(tmp_path):
    first = calibration_row(calibrated(tmp_path), own_figures=True)
    assert first["half_second"]["r"] == {"first_guess": 0.4, "calibrated": 0.1}
    assert first["worse"] == ["v"]
    assert first["own_figures"]["gear_ratio"]["holds"]
    assert not first["own_figures"]["yaw_inertia"]["holds"]
    lost = {"failed": {"verdict": "crashed", "message": "Singular matrix"}}
    result = calibration_scores([first, lost])
    assert result["failed"] == 1
    assert result["half-second error over the first guess's, median"]["v"] == pytest.approx(1.5)
    assert result["interval holds the car's own figure"]["yaw_inertia"]["hits"] == 0
    text = calibrations_text(result, {"good": first, "bad": lost})
    assert "gear_ratio 10.2 (9.9 to 10.5; 10)" in text
    assert "Singular matrix" in text


def make_world(folder, days=("aa", "bb")):
    """A world of empty runs."""
    for name in ("day_one", *days):
        (folder / name).mkdir(parents=True)
        (folder / name / "run_0.csv").touch()
    (folder / "start.yaml").write_text(START)
    labels = {day: {"effects": {"mass_error": 0.1} if day == "aa" else {}} for day in days}
    (folder / "labels.json").write_text(json.dumps(labels))
    return folder


def test_the_road_asks_once_and_opens_labels_last(tmp_path, monkeypatch):
    world, out = make_world(tmp_path / "world"), tmp_path / "run"
    asked = []

    def done_here(_workers, function, work, _unit):
        for job in work:
            if not job.out.exists():
                asked.append(job.out.name)
                function(job)

    def answer_it(job):
        assert (job.car / "car.json").exists()
        job.out.write_text(json.dumps(answer("mass_error" if job.case.name == "aa" else "none")))

    def calibrate_it(job):
        job.folder.mkdir(parents=True)
        job.out.write_text(json.dumps(CAR))

    monkeypatch.setattr(road, "done_once", done_here)
    monkeypatch.setattr(road, "ask", answer_it)
    monkeypatch.setattr(road, "calibrate", calibrate_it)
    for _ in range(2):
        road.main(road.Road((world,), out=out))
    assert asked == ["car.json", "aa.json", "bb.json"]
    assert json.loads((out / "scores.json").read_text())["all"]["right"]["hits"] == 2
    assert (out / "said.png").exists()


def test_worlds_of_other_makers_are_read(tmp_path):
    world = make_world(tmp_path / "world", ("aa", "bb", "cc", "day_one_4", "left"))
    labels = {
        "aa": {"effects": {}, "strange": None, "within_tolerances": {"mass_error": 0.01}, "drives": "other"},
        "bb": {"effects": {}, "strange": "gyro_drift", "strange_magnitude": 0.05, "drives": "same"},
        "cc": {"effects": {"mass_error": 0.1}, "strange": None, "drives": "same"},
    }
    (world / "labels.json").write_text(json.dumps(labels))
    assert road.days_of(world) == ["aa", "bb", "cc", "left"]
    assert road.checked(world, "day_one_4") == world
    with pytest.raises(road.InvalidWorldError, match="day_one_9: holds no runs"):
        road.checked(world, "day_one_9")
    (tmp_path / "run" / "world").mkdir(parents=True)
    for code in road.days_of(world):
        (tmp_path / "run" / "world" / f"{code}.json").write_text(json.dumps(answer("none")))
    rows = road.rows_of("world", world, tmp_path / "run")
    assert [(row.truth, row.within_tolerances, row.drives) for row in rows] == [
        ("none", True, "other"), ("unknown", False, "same"), ("mass_error", False, "same"),
    ]  # fmt: skip
    s = all_scores(rows)
    assert s["all"]["days with variation within tolerances alone: false alarms"]["count"] == 1
    assert list(s["by drives"]) == ["other", "same"]


def test_a_folder_that_is_no_world_is_refused(tmp_path):
    with pytest.raises(road.InvalidWorldError, match=r"has no start\.yaml"):
        road.checked(tmp_path)
    one, other = make_world(tmp_path / "a" / "world"), make_world(tmp_path / "b" / "world")
    with pytest.raises(road.InvalidWorldError, match="same name"):
        road.main(road.Road((one, other), out=tmp_path / "run"))


def test_a_case_of_a_car_that_failed_is_reported(tmp_path):
    job = jobs.Ask(tmp_path / "case", tmp_path / "car", tmp_path / "case.json")
    jobs.ask(job)
    assert answer_of(job.out)["verdict"] == jobs.NO_CAR


def test_what_the_commands_refuse_is_reported_with_their_sentence(tmp_path):
    (tmp_path / "start.yaml").write_text(START)
    car = Calibrate((tmp_path / "day_one",), tmp_path / "start.yaml", tmp_path / "car")
    jobs.calibrate(car)
    assert "no such folder" in answer_of(car.out)["message"]
    (car.folder / "car.yaml").write_text(START)
    car.out.write_text("{}")
    job = jobs.Ask(tmp_path / "case", car.folder, tmp_path / "case.json")
    jobs.ask(job)
    assert answer_of(job.out)["verdict"] == REFUSED
    assert "no such folder; give a case" in answer_of(job.out)["message"]


def test_worlds_have_a_name_each(tmp_path):
    config = Worlds(tmp_path, cars=("coupe", "saloon"), seeds=(3, 4), smooth=(0.0, 8.0))
    worlds = worlds_of(config)
    assert len({world.out for world in worlds}) == len(worlds) == 16
    assert tmp_path / "saloon-4-8hz-other" in {world.out for world in worlds}
    with pytest.raises(MissingWorldError, match="unknown car tractor"):
        worlds_of(dataclasses.replace(config, cars=("tractor",)))


def test_multi_body_worlds_need_their_script_and_package(tmp_path, monkeypatch):
    with pytest.raises(MissingWorldError, match="no such file"):
        check_multibody(tmp_path / "days.py")
    script = tmp_path / "days.py"
    script.touch()
    monkeypatch.setattr(make_worlds, "PACKAGE", "no_such_package")
    with pytest.raises(MissingWorldError, match="drift_drake\\[worlds\\]"):
        check_multibody(script)


def test_a_world_is_there_only_when_it_is_whole(tmp_path):
    script = tmp_path / "days.py"
    script.write_text("import sys\nopen(sys.argv[1] + '/start.yaml', 'w').write(' '.join(sys.argv[2:]))\n")
    world = MultiBody(tmp_path / "multibody1", "multibody1", 1, 7, 8.0, 2, script)
    make_worlds.make_world(world)
    assert (world.out / "start.yaml").read_text() == "--car 1 --seed 7 --smooth 8.0 --none 2"
    assert road.car_of(world.out) == "multibody1"
    script.write_text("raise SystemExit('no tyres')\n")
    broken = dataclasses.replace(world, out=tmp_path / "broken")
    with pytest.raises(MissingWorldError, match="no tyres"):
        make_worlds.make_world(broken)
    assert not broken.out.exists()


def test_no_worlds_are_one_sentence():
    with pytest.raises(road.InvalidWorldError, match="no worlds; make some with"):
        road.worlds_by_name([], "day_one")
