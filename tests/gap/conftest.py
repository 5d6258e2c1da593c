"""Answers are checked by the shipped JSON Schema; a short drive whose rear tyres become softer, and its monitor."""

import json
from functools import wraps

import numpy as np
import pytest

from drift_drake.car.effects.magnitudes import make_effects
from drift_drake.car.log.table import Run
from drift_drake.car.parameters import VehicleParameters
from drift_drake.gap.diagnosis.answers.answer import Answer
from drift_drake.gap.diagnosis.calibrated import diagnose_change
from drift_drake.gap.diagnosis.likelihood import diagnose
from drift_drake.gap.monitoring.monitor import Monitor, make_monitor
from experiments.monitoring.drives import changed_drive

ONSET = 2.5


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


@pytest.fixture(scope="session")
def monitor() -> Monitor:
    return make_monitor(VehicleParameters())


@pytest.fixture(scope="session")
def changed_run() -> Run:
    effects = make_effects({"rear_stiffness_error": -0.25})
    return changed_drive("slalom", effects, ONSET, seed=4, duration=5.0)


@pytest.fixture(scope="session")
def commands(changed_run: Run) -> np.ndarray:
    return np.stack([changed_run.delta_cmd, np.asarray(changed_run.tau_cmd)], axis=1)
