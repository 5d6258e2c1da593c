"""Right days over the runs of a baseline, without the long work: what is copied, kept, reported and drawn."""

import json

import pytest

from experiments.other_worlds import road
from experiments.other_worlds.baselines import STRANGE_RIGHT, Baselines, draw_baselines, figures, first_runs, main
from experiments.other_worlds.reliability import rows_of_road
from experiments.other_worlds.scoring import share

LABELS = {
    "aa": {"effects": {"mass_error": 0.1}, "strange": None},
    "bb": {"effects": {}, "strange": None},
    "cc": {"effects": {}, "strange": "gyro_drift"},
}
HELD_OUT = {"ratio": 0.5, "low": 0.4, "high": 0.6, "states": ["r"], "before": [[0.4]], "after": [[0.1]],
            "by_state": [[0.2, 0.3]]}  # fmt: skip
CAR = {"criterion": "prediction", "seconds": 6.0, "cpu_seconds": 9.0, "parameters": {}, "warnings": [],
       "held_out": HELD_OUT}  # fmt: skip
START = """mass: 1200.0\nyaw_inertia: 1800.0\nfront_axle_distance: 1.2\nrear_axle_distance: 1.4\nwheel_radius: 0.3
rear_axle_inertia: 20.0\ngear_ratio: 10.0\nfriction: 1.0\nfront_stiffness: 1.0e5\nrear_stiffness: 1.0e5\ngravity: 9.81
steering_limit: 0.6\ntorque_min: -50.0\ntorque_max: 400.0\n"""


@pytest.fixture
def world(tmp_path):
    folder = tmp_path / "world"
    for code, count in {"day_one": 11, **dict.fromkeys(LABELS, 1)}.items():
        (folder / code).mkdir(parents=True)
        for i in range(count):
            (folder / code / f"run_{i}.csv").touch()
    (folder / "start.yaml").write_text(START)
    (folder / "labels.json").write_text(json.dumps(LABELS))
    return folder


@pytest.fixture
def asked(monkeypatch):
    """Has cars answer at once: on one run they miss what is there."""
    done = []

    def done_here(_workers, function, work, _unit):
        for job in work:
            if not job.out.exists():
                function(job)

    def calibrate_it(job):
        job.folder.mkdir(parents=True)
        done.append(sorted(path.name for path in job.logs[0].iterdir()))
        job.out.write_text(json.dumps(CAR))

    def answer_it(job):
        few = job.car.parent.name == "runs_1"
        says = "none" if few else {"aa": "mass_error", "bb": "none", "cc": "unknown"}[job.case.name]
        job.out.write_text(json.dumps({
            "verdict": "effect" if says == "mass_error" else says, "causes": [says] * (says == "mass_error"),
            "posterior": {says: 1.0}, "ambiguity": [says], "magnitudes": {}, "details": {}, "warnings": [],
            "reduction": {"estimate": 0.5}, "seconds": 1.0, "cpu_seconds": 2.0,
        }))  # fmt: skip

    for name, function in (("done_once", done_here), ("calibrate", calibrate_it), ("ask", answer_it)):
        monkeypatch.setattr(road, name, function)
    return done


def test_each_count_is_a_road_of_its_own_and_is_kept(world, asked, tmp_path, capsys):
    out = tmp_path / "out"
    for _ in range(2):
        main(Baselines((world,), counts=(1, 3), out=out))
    assert asked == [["run_0.csv"], ["run_0.csv", "run_1.csv", "run_2.csv"]]
    text = (out / "baselines.md").read_text()
    assert "| runs of the baseline | 1 | 3 |" in text
    assert "| right | 1 of 2: 0.50 (0.01 to 0.99) | 2 of 2: 1.00 (0.16 to 1.00) |" in text
    assert (
        "| strange faults: unknown, or a cause and something else | 0 of 1: 0.00 (0.00 to 0.97) | 1 of 1: 1.00" in text
    )
    assert "| world | 1 of 2: 0.50" in text
    assert "| without an answer | 0 of 2: 0.00" in text
    assert text.strip() in capsys.readouterr().out
    assert (out / "baselines.png").stat().st_size > 10_000
    assert len(rows_of_road(out / "runs_3")) == 3


def test_the_first_runs_are_those_of_the_lowest_numbers(world, tmp_path):
    folder = first_runs(world, "day_one", 11, tmp_path / "first")
    assert len(list(folder.iterdir())) == 11
    assert {path.name for path in first_runs(world, "day_one", 3, tmp_path / "less").iterdir()} == {
        "run_0.csv", "run_1.csv", "run_2.csv",
    }  # fmt: skip
    with pytest.raises(road.InvalidWorldError, match="holds 11 runs, 12 are asked for"):
        first_runs(world, "day_one", 12, tmp_path / "more")


def test_counts_below_one_are_refused(world):
    with pytest.raises(ValueError, match="give one or more numbers of runs"):
        Baselines((world,), counts=(0, 4))


@pytest.mark.usefixtures("asked")
def test_worlds_without_strange_faults_are_drawn_too(world, tmp_path):
    labels = {code: label for code, label in LABELS.items() if not label["strange"]}
    (world / "labels.json").write_text(json.dumps(labels))
    main(Baselines((world,), counts=(4,), out=tmp_path / "out"))
    scores = json.loads((tmp_path / "out" / "runs_4" / "scores.json").read_text())
    row = figures(scores)
    assert row[STRANGE_RIGHT]["count"] == 0
    figure = draw_baselines({4: row, 12: row}, {"world": {4: share([True]), 12: share([False])}})
    legend = figure.axes[0].get_legend().get_texts()
    assert {text.get_text() for text in legend} == {"right", "false alarms", "goal, right"}
