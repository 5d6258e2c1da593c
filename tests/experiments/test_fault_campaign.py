"""The fault campaign: a fair order of jobs, a resumed folder, the table and the picture."""

import dataclasses
import json
from pathlib import Path

import pandas as pd
import pytest

from drift_drake.common.executors import ExecutorConfig
from drift_drake.drive.loop.closed_loop import ControlConfig
from drift_drake.drive.loop.faults import KINDS, parse_fault
from experiments.robustness import fault_campaign
from experiments.robustness.fault_campaign import FAULTS, CampaignConfig, main, make_jobs, picture, shares, table
from experiments.settings import OtherExperimentError

QUICK = CampaignConfig(loops=4, vehicles=1, models=("nominal",), distance=22.0,
                       control=ControlConfig(horizon=12, period=0.02, delay=0.02))  # fmt: skip


def test_every_kind_of_fault_is_in_it() -> None:
    assert {parse_fault(text).kind for text in FAULTS.values() if text} == set(KINDS)


def test_loops_come_in_pairs_and_none_twice() -> None:
    jobs = make_jobs(CampaignConfig(loops=1100))
    assert len({job.name for job in jobs}) == 1100
    for one, other in zip(jobs[::2], jobs[1::2], strict=True):
        assert dataclasses.replace(one, guarded=False) == other


def test_a_campaign_is_resumed_and_reported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], here: ExecutorConfig
) -> None:
    monkeypatch.setattr(fault_campaign, "FAULTS", {name: FAULTS[name] for name in ("none", "no reading any more")})
    config = dataclasses.replace(QUICK, run_on=here, out=tmp_path)
    main(config)
    reported = capsys.readouterr().out
    assert reported.startswith("4 loops: ")
    assert "; 0 commands that are no finite number" in reported.splitlines()[0]
    assert "| no reading any more | 2 | 1 of 1 (1 stopped) |" in reported
    assert (tmp_path / "fault_campaign.png").stat().st_size > 10_000
    done = {path: path.stat().st_mtime_ns for path in (tmp_path / "loops").iterdir()}
    spoilt = next(iter(done))
    before = json.loads(spoilt.read_text())
    spoilt.write_text("")
    main(config)
    same = {path for path in done if path.stat().st_mtime_ns == done[path]}
    assert same == set(done) - {spoilt}
    after = json.loads(spoilt.read_text())
    assert without_times(after) == without_times(before)


def test_loops_of_other_settings_are_not_gone_on_with(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fault_campaign, "run_kept", lambda *_: [])
    main(dataclasses.replace(QUICK, out=tmp_path))
    main(dataclasses.replace(QUICK, loops=8, out=tmp_path))
    with pytest.raises(OtherExperimentError, match="made with another distance; give another folder"):
        main(dataclasses.replace(QUICK, distance=23.0, out=tmp_path))


def without_times(result: dict[str, object]) -> dict[str, object]:
    return {name: value for name, value in result.items() if "_ms_" not in name and name != "late_solves"}


def test_shares_are_of_the_loops_that_stay_on_the_lane() -> None:
    runs = pd.DataFrame(
        [{"fault": "none", "guarded": guarded, "outcome": outcome} for guarded in (True, False)
         for outcome in ("completed", "stopped safely", "spin", "left the lane", "simulation failed")]
    )  # fmt: skip
    found = shares(runs)
    assert found["stayed"].tolist() == [2, 2]
    assert found["failed"].tolist() == [1, 1]
    ended = "2 of 5 (1 completed, 1 stopped, 1 left the lane, 1 spun, 1 failed)"
    assert f"| none | 10 | {ended} | {ended} |" in table(found)
    assert picture(found).axes
