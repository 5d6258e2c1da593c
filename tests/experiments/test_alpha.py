"""The choice of the information's weight in the paper's recipe: by convergence, then by information."""

from pathlib import Path

import pytest

from drift_drake.common.executors import ExecutorConfig
from experiments.gathering import alpha
from experiments.gathering.alpha import AlphaConfig, chosen, main, report, summarise


def entry(failed: int, both: float) -> dict[str, float]:
    return {"failed": failed, "both": both}


def test_fewest_failures_come_first_then_most_information_then_the_least_weight() -> None:
    assert chosen({1.0: entry(0, 50.0), 4.0: entry(0, 60.0), 8.0: entry(1, 90.0)}) == 4.0
    assert chosen({3.0: entry(0, 59.0), 4.0: entry(0, 60.0)}) == 3.0
    assert chosen({3.0: entry(0, 58.0), 4.0: entry(0, 60.0)}) == 4.0


def test_a_plan_that_failed_tells_nothing_and_is_counted() -> None:
    good = {"plans": 2, "obtained": [50.0, 10.0], "norm_ratio": 100.0, "slowest": 3.0, "sideslip": 0.2}
    lost = {"plans": 1, "obtained": [40.0], "norm_ratio": 50.0, "slowest": 5.0, "sideslip": 0.1}
    none = {"plans": 0, "obtained": []}
    first = {"tried": 10, "converged": 9}
    found = {(2.0, -1): first, (2.0, 0): good, (2.0, 1): lost, (2.0, 2): none}
    summary = summarise(AlphaConfig(alphas=(2.0,), vehicles=3), found)
    of_two = summary["weights"][2.0]
    assert of_two["failed"] == 3
    assert (of_two["first"], of_two["second"], of_two["both"]) == (40.0, 0.0, 40.0)
    assert (of_two["slowest"], of_two["sideslip"]) == (3.0, 0.2)
    assert "| 2 | 9 of 10 draws of guesses | 3 | 40.0, 0.0, 40.0 | 75 | 3.00 | 0.20 |" in report(summary)


def test_it_goes_on_where_it_was(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, here: ExecutorConfig) -> None:
    config = AlphaConfig(alphas=(4.0,), vehicles=1, seeds=1, run_on=here, out=tmp_path)
    main(config)
    assert "Chosen: 4." in (tmp_path / "report.md").read_text()
    monkeypatch.setattr(alpha, "found_of", None)  # nothing is left to do
    main(config)
