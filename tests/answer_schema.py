"""The shipped JSON Schema of an answer, and what a text has against it."""

import json
from functools import cache
from importlib.resources import files
from typing import Any

from jsonschema import Draft202012Validator


@cache
def schema() -> dict[str, Any]:
    """As it is shipped."""
    return json.loads((files("drift_drake.gap.diagnosis.answers") / "answer.schema.json").read_text(encoding="utf-8"))


def errors(answer: Any) -> list[str]:
    """Where an answer is not by the schema, and how; none if it is."""
    found = Draft202012Validator(schema()).iter_errors(answer)
    return [f"{'.'.join(map(str, error.absolute_path))}: {error.message[:200]}" for error in found]
