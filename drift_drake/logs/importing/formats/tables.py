"""CSV and Parquet: one topic, whose rows were written together. A unit may stand in a name: `speed [km/h]`."""

from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from drift_drake.logs.importing.formats.topics import Topic


def read_csv(path: Path) -> list[Topic]:
    """The table of a CSV file; ValueError or OSError where it is none."""
    table = pd.read_csv(path, low_memory=False)
    header = pd.read_csv(path, header=None, nrows=1, dtype=str, keep_default_na=False).iloc[0]
    return [_topic(table, [str(name).strip() for name in header])]


def read_parquet(path: Path) -> list[Topic]:
    """The table of a Parquet file; ImportError where pyarrow is not installed."""
    table = pd.read_parquet(path)
    return [_topic(table, [str(name).strip() for name in table.columns])]


def _topic(table: pd.DataFrame, names: Sequence[str]) -> Topic:
    """The table by the names in the file; where one is there twice, both say which column they are."""
    if len(names) != len(table.columns):  # rows that are longer than their header
        names = [str(name).strip() for name in table.columns]
    table.columns = [
        name if names.count(name) == 1 else f"{name} (column {number})" for number, name in enumerate(names, 1)
    ]
    return Topic("", table)
