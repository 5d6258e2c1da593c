"""The same run several times over counts once; runs that only begin alike are all kept."""

import dataclasses

import numpy as np
import pytest
from kinematic_log import kinematic_log

from drift_drake.gap.logs.noise import step
from drift_drake.gap.logs.screening import repeated
from drift_drake.gap.logs.screening.repeated import without_repeated


@pytest.fixture(scope="module")
def log():
    return kinematic_log(12.0)


def test_copies_are_counted_once_and_named(log):
    copies = [dataclasses.replace(log, name=f"run_{i}", t=log.t + 7.0 * i) for i in range(6)]
    kept, (sentence,) = without_repeated([*copies, kinematic_log(12.0, seed=9)])
    assert [run.name for run in kept] == ["run_0", "run_9"]
    assert sentence == "run_1, run_2, run_3, run_4, run_5 are rows of run_0 once more: counted once"


def test_a_part_that_is_rounded_is_a_copy_too(log):
    part = dataclasses.replace(log.rows(300, 900), name="part", r=np.round(log.r[300:900], 4),
                               beta=np.round(log.beta[300:900], 4))  # fmt: skip
    kept, (sentence,) = without_repeated([part, log])
    assert kept == [log]
    assert sentence == "part is rows of run_0 once more: counted once"


def test_drives_that_begin_alike_or_do_nothing_are_kept(log):
    other = kinematic_log(12.0, seed=5)
    alike = dataclasses.replace(log, name="alike", r=np.concatenate([log.r[:400], other.r[400:]]))
    assert without_repeated([log, alike]) == ([log, alike], [])
    still = dataclasses.replace(log, r=np.zeros(len(log)), v=np.full(len(log), 9.0))
    assert without_repeated([still, still])[1] == []


def test_each_column_is_looked_through_once_however_many_runs_there_are(monkeypatch: pytest.MonkeyPatch) -> None:
    """An hour of logs is some three hundred runs, and fifty thousand pairs of them."""
    looked = []
    monkeypatch.setattr(repeated, "step", lambda values: looked.append(len(values)) or step(values))
    runs = [kinematic_log(12.0, seed=seed) for seed in range(5)]
    assert without_repeated(runs)[0] == runs
    assert len(looked) <= len(runs) * len(repeated.COMPARED)
