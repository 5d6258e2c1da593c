"""The blind check's books: labels stay sealed until the answers are there, and cannot be changed."""

import json

import numpy as np
import pandas as pd
import pytest

from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.car.log.table import read_case
from drift_drake.car.parameters import VehicleParameters
from drift_drake.common.executors import ExecutorConfig
from drift_drake.gap.diagnosis.answers.answer import Answer
from drift_drake.gap.estimation.prior import Interval
from experiments.gap import blind
from experiments.gap.blind import Make, Respond, answer, case_truth, make, opened, scored_row


@pytest.fixture(scope="module")
def cases(tmp_path_factory):
    out = tmp_path_factory.mktemp("blind")

    def run_here(_run_on, function, jobs, finish, _unit, **_options):
        for job in jobs:
            finish(job, function(job))

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(blind, "run_jobs", run_here)
        make(Make(out, count=2, run_on=ExecutorConfig(workers=1), compiled=True, seed=7))
    return out


def test_cases_are_runs_and_labels_are_not_readable(cases):
    manifest = json.loads((cases / "manifest.json").read_text())
    assert len(manifest["cases"]) == 2
    for name in manifest["cases"]:
        assert len(read_case(cases / "cases" / name)) == 4
    sealed = (cases / "labels.sealed").read_bytes()
    assert b"effects" not in sealed
    assert not any(name.encode() in sealed for name in CATALOGUE)


def test_scored_cases_are_rows_with_what_they_hid(tmp_path):
    (tmp_path / "answers").mkdir()
    nothing = Interval(0.0, 0.0, 0.0)
    lag = {"steering_lag": Interval(0.1, 0.05, 0.15)}
    for name, causes in (("one", lag), ("two", {})):
        verdict = "effect" if causes else "none"
        posterior = {"+".join(causes) or verdict: 0.9}
        Answer(name, verdict, list(causes), posterior, [], causes, {}, nothing, 1.0, {}, {}, []).write(
            tmp_path / "answers" / f"{name}.json"
        )
    (tmp_path / "manifest.json").write_text(json.dumps({"cases": {"one": {"without": []}, "two": {"without": []}}}))
    answer(Respond(tmp_path, run_on=ExecutorConfig(workers=1)))
    assert list(read_table(tmp_path)["causes"].fillna("")) == ["steering_lag", ""]
    row = scored_row(tmp_path, {"case": "one", "tier": "exact", "effects": {"steering_lag": 0.12}})
    assert (row["steering_lag"], row["true_steering_lag"], row["true_causes"]) == (0.1, 0.12, "steering_lag")


def read_table(folder):
    (path,) = folder.glob("results.*")
    return pd.read_parquet(path) if path.suffix == ".parquet" else pd.read_csv(path)


def test_labels_open_only_after_all_answers_and_only_as_sealed(cases):
    with pytest.raises(SystemExit, match="2 cases have no answer yet"):
        opened(cases)
    (cases / "answers").mkdir()
    first, second = json.loads((cases / "manifest.json").read_text())["cases"]
    (cases / "answers" / f"{first}.json").write_text("{}")
    assert [label["case"] for label in opened(cases, partial=True)] == [first]
    (cases / "answers" / f"{second}.json").write_text("{}")
    assert len(opened(cases)) == 2
    sealed = cases / "labels.sealed"
    sealed.write_bytes(sealed.read_bytes() + b"x")
    with pytest.raises(SystemExit, match="not what the manifest's hash"):
        opened(cases)


def test_a_removed_effect_is_named_for_the_catalogue():
    truth, without = case_truth("removed", np.random.default_rng(0), VehicleParameters())
    assert list(truth.effects) == without
    assert case_truth("pair", np.random.default_rng(0), VehicleParameters())[1] == []
