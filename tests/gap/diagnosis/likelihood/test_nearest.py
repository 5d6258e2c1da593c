"""What an answer of `unknown` leaves an engineer with."""

import dataclasses
import json

import numpy as np
import pytest

from drift_drake.car.parameters import VehicleParameters
from drift_drake.gap.diagnosis.answers.answer import read_answer
from drift_drake.gap.diagnosis.likelihood.diagnose import diagnose
from experiments.benchmarks.compiled_cases import make_case
from experiments.benchmarks.truths import Truth


@pytest.fixture(scope="module")
def diagnosis():
    runs = make_case(Truth({}, {"crosswind": 500.0}), VehicleParameters(), np.random.default_rng(4), 3.0)
    return diagnose(runs, VehicleParameters(), case="windy", catalogue=("differential_yaw_moment", "road_grade"))


def test_unknown_names_the_nearest_known_cause_and_the_ceiling(diagnosis):
    answer = diagnosis.answer
    assert answer.verdict == "unknown"
    assert answer.magnitudes == {}
    found = answer.details["nearest"]
    assert found["name"] == answer.details["leading_known"]
    assert set(found["magnitudes"]) == set() if found["name"] == "none" else set(found["name"].split("+"))
    assert found["removes"] < found["free_forces_remove"] <= 1.0
    assert found["free_forces_remove"] > 0.3


def test_what_adds_to_the_errors_removes_nothing(diagnosis):
    answer = diagnosis.answer
    nearest = answer.details["nearest"] | {"free_forces_remove": -68.6}
    spoilt = dataclasses.replace(answer, details=answer.details | {"nearest": nearest})
    assert "free-form forces" in spoilt.sentence()
    assert "-68" not in spoilt.sentence()


def test_the_sentence_says_so_and_survives_the_file(diagnosis, tmp_path):
    diagnosis.answer.write(tmp_path / "answer.json")
    sentence = read_answer(tmp_path / "answer.json").sentence()
    assert sentence == diagnosis.answer.sentence()
    assert "free-form forces" in sentence
    data = json.loads((tmp_path / "answer.json").read_text())
    del data["details"]["nearest"]
    (tmp_path / "old.json").write_text(json.dumps(data))
    assert read_answer(tmp_path / "old.json").sentence().endswith(").")
