"""Experiments without worker processes."""

from collections.abc import Callable, Sequence
from typing import Any

import pytest

from drift_drake.common.executors import ExecutorConfig
from experiments import settings
from experiments.drifting import runs as drift_runs
from experiments.gathering import beliefs


@pytest.fixture
def here(monkeypatch: pytest.MonkeyPatch) -> ExecutorConfig:
    """Has drives and gatherings made in this process."""

    def run_here(_config: ExecutorConfig, function: Callable[[Any], Any], jobs: Sequence[Any],
                 finish: Callable[[Any, Any], None], unit: str, **_: Any) -> None:  # fmt: skip
        assert unit
        for job in jobs:
            finish(job, function(job))

    for module in (drift_runs, beliefs, settings):
        monkeypatch.setattr(module, "run_jobs", run_here)
    return ExecutorConfig(workers=1)
