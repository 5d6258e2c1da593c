"""The blind check's books: labels stay sealed until the answers are there, and cannot be changed."""

import json

import numpy as np
import pytest

from drift_drake.executors import ExecutorConfig
from drift_drake.logs.table import read_case
from drift_drake.vehicle.catalogue import CATALOGUE
from drift_drake.vehicle.parameters import VehicleParameters
from experiments.gap.blind import Make, case_truth, make, opened


@pytest.fixture(scope="module")
def cases(tmp_path_factory):
    out = tmp_path_factory.mktemp("blind")
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
