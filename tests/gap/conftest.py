"""Every answer that a diagnosis of these tests gives is one by the shipped JSON Schema."""

import json
from functools import wraps

import pytest

from drift_drake.gap.diagnosis.answers.answer import Answer
from drift_drake.gap.diagnosis.calibrated import diagnose_change
from drift_drake.gap.diagnosis.likelihood import diagnose


@pytest.fixture(scope="session", autouse=True)
def answers_follow_the_schema():
    """Checked where a diagnosis makes its answer: of every kind that some test asks for."""
    try:
        from answer_schema import errors
    except ImportError:  # jsonschema is an extra
        yield
        return

    @wraps(Answer, updated=())
    def checked(**fields):
        answer = Answer(**fields)
        assert errors(json.loads(answer.to_json())) == []
        return answer

    with pytest.MonkeyPatch.context() as patch:
        for module in (diagnose_change, diagnose):
            patch.setattr(module, "Answer", checked)
        yield
