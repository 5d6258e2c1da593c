"""The information gathering experiment's books, and its sentence where the drives are missing."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from drift_drake.model.checkpoint import load
from drift_drake.model.features import FEATURE_COUNT
from drift_drake.model.posterior import covariance_norms, update_all
from experiments.information_gathering import InformationConfig, full_weight_total, main
from experiments.information_summary import markdown, stop_round, summarise


def judged(total: float, error: float) -> dict[str, Any]:
    norms = [0.7 * total, 0.1 * total, 0.1 * total, 0.1 * total]
    return {"norms": norms, "total": total, "full_weight_total": 0.1 * total, "one_step": [error] * 4,
            "rollout": [error] * 4, "one_step_scaled": error, "rollout_scaled": error}  # fmt: skip


def driven(total: float, error: float, gain: float, ending: str = "time") -> dict[str, Any]:
    return judged(total, error) | {"predicted": gain, "obtained": gain, "ending": ending, "max_e": 1.0, "max_beta": 0.2,
                                   "plan_seconds": 4.0}  # fmt: skip


def vehicle(twice: float, error: float, ending: str = "time") -> dict[str, Any]:
    return {
        "prior": judged(100.0, 3.0), "Once-OCP": driven(50.0, 2.5, 5.0), "random steering": driven(40.0, 2.5, 6.0),
        "slalom": driven(30.0, 2.5, 9.0), "rounds": [driven(20.0, 2.0, 20.0), driven(twice, error, 10.0, ending)],
    }  # fmt: skip


def test_counts_and_spreads() -> None:
    summary = summarise([vehicle(4.0, 1.0), vehicle(5.0, 2.2), vehicle(60.0, 1.5, "spin")], 0.1)
    assert list(summary["counts"].values()) == [2, 2, 2, 2]
    assert summary["prior total over Twice-Info's"]["median"] == pytest.approx(20.0)
    twice = summary["models"]["Twice-Info"]
    assert twice["total"] == {"best": 4.0, "median": 5.0, "worst": 60.0}
    assert twice["not driven to the end"] == 1
    assert "33.98" in markdown(summary | {"plan_seconds": {"OCP": 0.3}})


def test_the_rounds_stop_when_little_is_promised() -> None:
    gains = [100.0, 20.0, 11.0, 14.0, 5.0]
    rounds = [{"predicted": gain, "obtained": gain} for gain in gains]
    assert stop_round(rounds, 0.1) == 2
    assert stop_round(rounds, 0.05) == 4
    assert stop_round(rounds, 0.01) == 5


def test_missing_drives_are_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(SystemExit, match=r"held_out\.npz: no such file; make the drives with `python -m experiments"):
        main(InformationConfig(drives=tmp_path))


def test_the_total_at_full_weight_is_that_of_samples_that_count_in_full() -> None:
    model = load()
    generator = np.random.default_rng(0)
    phi, y = generator.normal(size=(30, 4, FEATURE_COUNT)), generator.normal(size=(30, 4))
    belief = update_all(model.prior(), phi, y, model.sample_weight)
    full = update_all(model.prior(), phi, y)
    assert full_weight_total(model, belief) == pytest.approx(covariance_norms(full)[1], rel=1e-6)
