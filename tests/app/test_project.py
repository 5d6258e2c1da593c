"""A project's files: days, changes of two windows, hashes of inputs, and names of files that are sent."""

import json
import threading

import pytest
import yaml

from drift_drake.app import stages
from drift_drake.app.aside import drop, put_aside, put_back, there
from drift_drake.app.jobs import LOST, Jobs, RunningCommand
from drift_drake.app.mapping_edits import edit, merge, set_global
from drift_drake.app.project import InvalidProjectError, Project
from drift_drake.app.uploads import UnusableUploadError, file_name
from drift_drake.car.templates import TEMPLATES
from drift_drake.car.vehicle_file import write_vehicle

RUN = "t,r,v,delta_cmd\n" + "".join(f"{0.01 * k:.2f},0,10,0\n" for k in range(60))


@pytest.fixture
def project(tmp_path):
    """A folder with two recordings and a day of runs."""
    for name in ("first.csv", "second.csv"):
        (tmp_path / name).write_text("Time,v\n0,1\n")
    (tmp_path / "logs" / "old").mkdir(parents=True)
    (tmp_path / "logs" / "old" / "run_0.csv").write_text(RUN)
    write_vehicle(tmp_path / "car.yaml", TEMPLATES["coupe"])
    return Project(tmp_path)


def done(project, stage, **more):
    for path in stage.outputs:
        target = project.folder / path
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text(json.dumps(more))
    with project.changing() as data:
        data["steps"][stage.name] = {"ended": "done", "inputs": stage.digest()}


def test_days_are_recordings_and_folders_of_runs(project):
    with project.changing() as data:
        data["recordings"] = {"first.csv": "monday", "second.csv": "", "gone.csv": "monday"}
    assert project.recordings() == ["first.csv", "second.csv"]
    assert project.days() == {"monday": ["first.csv"], "old": []}


def test_two_windows_do_not_lose_each_others_changes(project):
    one, other = project, Project(project.folder)
    with one.changing() as data:
        data["recordings"]["first.csv"] = "monday"
    with other.changing() as data:
        data["recordings"]["second.csv"] = "tuesday"
    assert one.read()["recordings"] == {"first.csv": "monday", "second.csv": "tuesday"}
    one.change_mapping(lambda data: edit(data, "r", "column", "gyro", []))
    other.change_mapping(lambda data: edit(data, "v", "column", "speed", []))
    one.change_mapping(lambda data: edit(data, "r", "unit", "deg/s", []))
    assert one.mapping()["signals"] == {
        "r": {"column": "gyro", "unit": "deg/s"}, "v": {"column": "speed", "unit": "m/s"},
    }  # fmt: skip


def test_a_project_file_of_another_shape_is_refused(project):
    for text in ("recordings: 3\n", "- a\n", "a: [\n"):
        (project.folder / "project.yaml").write_text(text)
        with pytest.raises(InvalidProjectError, match=r"project\.yaml"):
            project.read()


def test_a_step_goes_stale_when_an_input_changes(project):
    stage = stages.check_day(project, "old", project.read())
    assert stage.state(project.read()) == "none"
    done(project, stage, for_calibration={"good_enough": True})
    assert stage.state(project.read()) == "done"
    assert stages.passed(project, "old", project.read())
    write_vehicle(project.folder / "car.yaml", TEMPLATES["saloon"])
    assert stages.check_day(project, "old", project.read()).state(project.read()) == "stale"
    assert not stages.passed(project, "old", project.read())


def test_nothing_is_calibrated_before_the_check_has_passed(project):
    data = project.read()
    jobs = Jobs(project)
    assert "check first whether old" in jobs.start(stages.calibrate(project, data))
    check = stages.check_day(project, "old", data)
    done(project, check, for_calibration={"good_enough": False})
    assert "check first" in stages.calibrate(project, project.read()).refused()
    with project.changing() as data:
        data["days"]["old"] = {"accepted": check.digest()}
    assert stages.calibrate(project, project.read()).refused() is None
    (project.folder / "logs" / "old" / "run_1.csv").write_text(RUN)  # other logs than those that were taken
    assert "check first" in stages.calibrate(project, project.read()).refused()


def test_commands_are_those_of_a_terminal(project):
    with project.changing() as data:
        data["recordings"] = {"first.csv": "a day"}
        data["days"]["a day"] = {"start": 2.5}
    data = project.read()
    assert stages.import_day(project, "a day", data).command() == (
        "drift-drake import first.csv --mapping mapping.yaml --out 'logs/a day' --start 2.5"
    )
    assert stages.calibrate(project, data).command() == (
        "drift-drake identify 'logs/a day' --vehicle car.yaml --out calibrated.yaml --json calibrated.json "
        "--report calibrated.html"
    )


@pytest.mark.parametrize("name", ["../a", "a/b", ".hidden", "-rf", "", "x" * 41])
def test_a_day_is_a_plain_name(name):
    assert not stages.DAY.fullmatch(name)


def test_progress_and_sentences_are_distinguished():
    job = RunningCommand(None)
    job.hear("\rinitial: 12%|#  | 00:03\rsearch: 55%|### | 00:09")
    job.hear("a sentence\n")
    assert (job.share, job.doing, list(job.lines)) == (0.55, "search", ["a sentence"])


def test_a_command_that_was_cut_off_is_said_to_be_lost(project):
    with project.changing() as data:
        written = {"calibrated.yaml": True, "calibrated.json": False}
        digest = stages.calibrate(project, data).digest()
        data["steps"]["calibrate"] = {"ended": "running", "inputs": digest, "written": written}
    (project.folder / "calibrated.yaml").write_text("before")
    put_aside(project.folder, written)
    for name in written:
        (project.folder / name).write_text("half")
    Jobs(project)
    assert (project.folder / "calibrated.yaml").read_text() == "before"
    assert not (project.folder / "calibrated.json").exists()
    stage = stages.calibrate(project, project.read())
    assert stage.state(project.read()) == "cancelled"
    assert stage.said(project.read()) == LOST


def test_a_mapping_is_changed_line_by_line():
    data = {"clocks": {"c": {"column": "t"}}, "signals": {"omega_r": {"column": "w", "unit": "m/s", "clock": "c"}}}
    edit(data, "omega_r", "unit", "rpm", [])
    assert data["signals"]["omega_r"]["radius"] > 0.0
    edit(data, "omega_r", "unit", "km/h", [])
    assert "radius" not in data["signals"]["omega_r"]
    edit(data, "delta_cmd", "column", "w", [])
    assert data["signals"]["delta_cmd"] == {"column": "w", "unit": "rad", "clock": "c"}
    edit(data, "delta_cmd", "ratio", 16.0, [])
    assert data["signals"]["delta_cmd"]["scale"] == 1.0 / 16.0
    edit(data, "delta_cmd", "ratio", None, [])
    assert "scale" not in data["signals"]["delta_cmd"]
    set_global(data, "measured_point", (1, 0.4))
    assert data["measured_point"] == [0.0, 0.4]
    set_global(data, "measured_point", (1, None))
    assert "measured_point" not in data


def test_a_fix_keeps_what_was_changed_since_it_was_offered():
    before = {"signals": {"r": {"unit": "rad/s"}, "v": {"unit": "m/s"}}}
    after = {"signals": {"r": {"unit": "deg/s"}, "v": {"unit": "m/s"}}}
    now = {"signals": {"r": {"unit": "rad/s"}, "v": {"unit": "km/h"}}, "wheelbase": 2.6}
    merge(now, before, after)
    assert yaml.safe_dump(now) == yaml.safe_dump(
        {"signals": {"r": {"unit": "deg/s"}, "v": {"unit": "km/h"}}, "wheelbase": 2.6}
    )


@pytest.mark.parametrize("asked", ["", "..", ".bashrc", "-x.csv", "a/", "x" * 200, "a\nb.csv"])
def test_names_of_files_that_are_sent(asked):
    with pytest.raises(UnusableUploadError):
        file_name(asked)
    assert file_name("../../etc/lap 1.mat") == "lap 1.mat"
    assert file_name(r"C:\logs\lap.mat") == "lap.mat"


def test_a_command_that_did_not_end_well_leaves_files_as_they_were(project):
    data = {"recordings": {"first.csv": "monday"}, "days": {}, "options": {}, "steps": {}}
    folder = project.folder
    imported, exported = stages.import_day(project, "monday", data), stages.export(project, "old")
    checked = stages.check_day(project, "old", data)
    (folder / "foxglove" / "old").mkdir(parents=True)
    (folder / "foxglove" / "old" / "mine.txt").write_text("kept")
    for stage, part in ((imported, "logs/monday/run_0.csv"), (exported, "foxglove/old/run_0.mcap")):
        written = there(folder, stage.written)
        put_aside(folder, written)
        assert set(project.days(data)) == {"monday", "old"}  # what is put aside is no day
        (folder / part).parent.mkdir(parents=True, exist_ok=True)
        (folder / part).write_text("half")
        put_back(folder, written)
        assert not (folder / part).exists()
    assert not (folder / "logs" / "monday").exists()
    assert (folder / "foxglove" / "old" / "mine.txt").read_text() == "kept"
    (folder / "check").mkdir()
    for before in (None, "earlier"):
        if before is not None:
            (folder / checked.outputs[0]).write_text(before)
        written = there(folder, checked.written)
        put_back(folder, written)  # ended before anything was put aside
        assert (folder / checked.outputs[0]).exists() == (before is not None)
        put_aside(folder, written)
        (folder / checked.outputs[0]).write_text("half")
        put_back(folder, written)
        assert (folder / checked.outputs[0]).exists() == (before is not None)
    assert (folder / checked.outputs[0]).read_text() == "earlier"


def test_a_file_that_is_put_back_is_there_all_the_time(project):
    report, ended, missed = project.folder / "report.html", threading.Event(), []

    def ask():  # as a frame of the page does
        while not ended.is_set():
            missed.extend([1] * (not report.is_file()))

    report.write_text("earlier")
    asking = threading.Thread(target=ask)
    asking.start()
    for _ in range(300):
        put_aside(project.folder, ["report.html"])
        put_back(project.folder, {"report.html": True})
    ended.set()
    asking.join()
    assert not missed


def test_of_a_folder_that_is_made_anew_what_no_command_wrote_stays(project):
    folder = project.folder / "logs" / "old"
    (folder / "notes.txt").write_text("mine")
    put_aside(project.folder, ["logs/old"])
    folder.mkdir()
    (folder / "run_0.csv").write_text("new")
    drop(project.folder, ["logs/old"])
    assert {path.name: path.read_text() for path in folder.iterdir()} == {"run_0.csv": "new", "notes.txt": "mine"}
    assert [path.name for path in folder.parent.iterdir()] == ["old"]


def test_a_step_goes_stale_with_what_it_rests_on_and_not_with_a_run_that_was_cancelled(project):
    with project.changing() as data:
        data["recordings"] = {"first.csv": "monday"}
    (project.folder / "mapping.yaml").write_text("{}")
    (project.folder / "logs" / "monday").mkdir()
    (project.folder / "logs" / "monday" / "run_0.csv").write_text(RUN)

    def way():
        data = project.read()
        return [stages.import_day(project, "monday", data), stages.check_day(project, "monday", data),
                stages.calibrate(project, data), stages.diagnose(project, "old", data),
                stages.apply(project, "old", data), stages.replay(project, "old", "run_0.csv", data)]  # fmt: skip

    def states():
        return [stage.state(project.read()) for stage in way()]

    for k in range(6):
        done(project, way()[k], for_calibration={"good_enough": True})
    assert states() == ["done"] * 6
    write_vehicle(project.folder / "car.yaml", TEMPLATES["saloon"])  # no file that the diagnosis reads has changed
    assert states() == ["done"] + ["stale"] * 5
    assert "calibrate the car first" in way()[3].refused()
    write_vehicle(project.folder / "car.yaml", TEMPLATES["coupe"])
    assert states() == ["done"] * 6
    with project.changing() as data:
        data["days"]["monday"] = {"start": 1.0}  # which the import alone depends on
    assert states() == ["stale"] * 6
    with project.changing() as data:
        data["days"]["monday"] = {}
    jobs = Jobs(project)
    jobs._record(way()[2], way()[2].digest(), ended="cancelled", said="")
    assert states() == ["done", "done", "cancelled", "done", "done", "done"]
    assert way()[3].refused() is None
    project.set_option("criterion", "likelihood")  # of the calibration that was cancelled and is not there
    jobs._record(way()[2], way()[2].digest(), ended="cancelled", said="")
    assert states() == ["done", "done", "cancelled", "stale", "stale", "stale"]
