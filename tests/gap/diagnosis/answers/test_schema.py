"""The shipped JSON Schema of an answer: answers of every kind follow it, and it says what each field is."""

import copy
import dataclasses
import json
from pathlib import Path

import pytest

jsonschema = pytest.importorskip("jsonschema", reason="an extra: pip install 'drift_drake[test]'")

from answer_schema import errors, schema  # noqa: E402

from drift_drake.gap.diagnosis.answers.answer import Answer  # noqa: E402
from drift_drake.gap.estimation.prior import Interval  # noqa: E402

SHARED = Path(__file__).parents[5] / "shared"
NOTHING = Interval(0.0, 0.0, 0.0)
ANSWER = Answer("monday", "none", [], {"none": 1.0}, ["none"], {}, {}, NOTHING, 1.0, {}, {}, [])


def data(answer):
    return json.loads(answer.to_json())


def parts(of, path=""):
    """Each subschema with its path."""
    yield path, of
    for key in ("properties", "$defs"):
        for name, part in of.get(key, {}).items():
            yield from parts(part, f"{path}.{name}")
    if isinstance(of.get("additionalProperties"), dict):
        yield from parts(of["additionalProperties"], path)


def test_the_schema_is_one():
    jsonschema.Draft202012Validator.check_schema(schema())


def test_every_field_is_described_and_no_number_lacks_its_unit():
    for path, part in parts(schema()):
        for name, field in part.get("properties", {}).items():
            described = field.get("description") or schema()["$defs"].get(field.get("$ref", "").rpartition("/")[2], {})
            described = described if isinstance(described, str) else described.get("description", "")
            assert described or name == "map", f"{path}.{name}"
            if field.get("$ref", "").endswith("/number") or field.get("type") == "number":
                united = "[" in described or "unit" in described or path.endswith(".interval")
                assert united, f"{path}.{name}: {described}"


def test_an_answers_fields_are_the_schemas():
    assert set(schema()["properties"]) == {field.name for field in dataclasses.fields(Answer)}


def test_answers_relative_to_a_baseline_follow_it(late_day, plain_day, strange_day):
    for found, verdict in ((late_day, "effect"), (plain_day, "none"), (strange_day, "unknown")):
        assert found.answer.verdict == verdict
        assert errors(data(found.answer)) == []


def test_a_cause_with_something_else_and_an_open_cause_follow_it(late_day):
    left = {"probability": 0.8, "share": 0.3, "signals": {"r": 1.0}, "driving": [], "like": ""}
    for details in ({"left_over": left}, {"decision": "cause_open"}):
        answer = dataclasses.replace(late_day.answer, details=late_day.answer.details | details)
        assert errors(data(answer)) == []


def test_a_number_that_is_not_finite_is_null_and_follows_it():
    assert errors(data(dataclasses.replace(ANSWER, reduction=Interval(float("nan"), 0.0, 0.0)))) == []


@pytest.mark.parametrize(("change", "where"), [
    ({"verdict": "maybe"}, "verdict"),
    ({"causes": ["mass_error"]}, "causes"),
    ({"posterior": {"none": 1.5}}, "posterior.none"),
    ({"reduction": {"estimate": 0.0, "low": 0.0}}, "reduction"),
    ({"details": {"mood": 1.0}}, "details"),
    ({"seconds": None}, "seconds"),
    ({"vehicle": "mine"}, ""),
])  # fmt: skip
def test_what_is_no_answer_is_refused(change, where):
    assert [error.partition(":")[0] for error in errors(copy.deepcopy(data(ANSWER)) | change)] == [where]


def test_shared_answers_follow_it():
    found = sorted(SHARED.rglob("answer*.json")) if SHARED.is_dir() else []
    if not found:
        pytest.skip("there are no answers next to the repository (../shared)")
    for path in found:
        assert errors(json.loads(path.read_text())) == [], path
