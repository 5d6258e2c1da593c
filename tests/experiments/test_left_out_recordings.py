"""Recordings of one car, each left out of its baseline in turn."""

import json
from pathlib import Path

import pytest

from experiments.real import left_out
from experiments.real.left_out import LeaveOneOut, TooFewRecordingsError, main


def answer(none, verdict="none"):
    posterior = {"none": none, "unknown": 0.6 * (1.0 - none), "aero_drag": 0.4 * (1.0 - none)}
    return {"verdict": verdict, "posterior": posterior, "details": {"decision": "undecided"}}


@pytest.fixture
def asked(monkeypatch):
    """Jobs write their file; the second recording has a gap, the third cannot be used."""
    jobs = []

    def done(_workers, _function, todo, unit):
        jobs.extend(todo)
        for job in todo:
            job.out.parent.mkdir(parents=True, exist_ok=True)
            if unit == "car":
                job.out.write_text("{}")
            elif job.case.name == "c":
                job.out.with_suffix(".failed.json").write_text('{"verdict": "refused", "message": "c: too short"}')
            else:
                job.out.write_text(json.dumps(answer(0.9) if job.case.name == "a" else answer(0.1, "unknown")))

    monkeypatch.setattr(left_out, "done_once", done)
    return jobs


def test_each_recording_is_judged_by_the_others(asked, tmp_path, capsys):
    logs = tuple(Path(name) for name in ("logs/a", "logs/b", "logs/c"))
    main(LeaveOneOut(Path("car.yaml"), logs, out=tmp_path / "left"))
    cars, days = asked[:3], asked[3:]
    assert [set(job.logs) for job in cars] == [set(logs) - {log} for log in logs]
    assert [(job.case, job.car) for job in days] == [(log, car.folder) for log, car in zip(logs, cars, strict=True)]
    report = (tmp_path / "left" / "report.md").read_text()
    assert "| a | 0.90 | undecided | unknown 0.06, aero_drag 0.04 |" in report
    assert "| c | c: too short | refused |" in report
    assert "Alarms: 1 of 2" in report  # without the one that has no answer
    assert "results in" in capsys.readouterr().out


@pytest.mark.parametrize("logs", [("logs/a",), ("logs/a", "other/a")])
def test_too_few_recordings_are_refused(logs, tmp_path):
    with pytest.raises(TooFewRecordingsError, match="--logs"):
        main(LeaveOneOut(Path("car.yaml"), tuple(map(Path, logs)), out=tmp_path / "left"))
    assert not (tmp_path / "left").exists()
