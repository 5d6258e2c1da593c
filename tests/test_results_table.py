"""Tables of many results: Parquet where pyarrow is installed, else CSV; an answer as a row."""

from pathlib import Path

import pandas as pd
import pytest

from drift_drake.common import run_folder
from drift_drake.common.run_folder import write_results_table
from drift_drake.gap.diagnosis.answers.answer import Answer, answer_row
from drift_drake.gap.estimation.prior import Interval

ROWS = [{"case": "a", "refused": True, "mass_error": 0.1}, {"case": "b", "outcome": "spin"}]


def check(table: pd.DataFrame) -> None:
    assert list(table) == ["case", "refused", "mass_error", "outcome"]
    assert list(table["case"]) == ["a", "b"]
    assert table["mass_error"][0] == 0.1
    assert table["refused"].isna().tolist() == [False, True]


def test_parquet_where_it_can_be_written(tmp_path: Path) -> None:
    pytest.importorskip("pyarrow", reason="Parquet is an extra: pip install 'drift_drake[parquet]'")
    path = write_results_table(tmp_path, ROWS)
    assert path.name == "results.parquet"
    check(pd.read_parquet(path))
    write_results_table(tmp_path, pd.DataFrame(ROWS[:1]))  # whole again
    assert len(pd.read_parquet(path)) == 1
    assert [file.name for file in tmp_path.iterdir()] == ["results.parquet"]


def test_csv_without_pyarrow(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(run_folder, "find_spec", lambda _name: None)
    path = write_results_table(tmp_path, ROWS)
    assert path.name == "results.csv"
    check(pd.read_csv(path))


def test_an_answer_is_a_row() -> None:
    posterior = {"none": 0.1, "aero_drag+mass_error": 0.7, "unknown": 0.2}
    magnitudes = {"mass_error": Interval(0.1, 0.05, 0.15), "aero_drag": Interval(0.4, 0.3, 0.5)}
    answer = Answer("monday", "effect", ["mass_error", "aero_drag"], posterior, [], magnitudes, {},
                    Interval(0.8, 0.7, 0.9), 12.0, {}, {}, ["one"])  # fmt: skip
    row = answer_row(answer)
    assert row["case"] == "monday"
    assert row["causes"] == "aero_drag+mass_error"
    assert row["probability"] == 0.7
    assert (row["mass_error"], row["aero_drag_low"], row["reduction_high"]) == (0.1, 0.3, 0.9)
    assert row["warnings"] == 1
