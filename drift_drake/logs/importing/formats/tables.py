"""CSV and Parquet: one topic, whose rows were written together. A unit may stand in a name: `speed [km/h]`."""

from pathlib import Path

import pandas as pd

from drift_drake.logs.importing.formats.topics import Topic


def read_csv(path: Path) -> list[Topic]:
    """The table of a CSV file; ValueError or OSError where it is none."""
    return [_topic(pd.read_csv(path, low_memory=False))]


def read_parquet(path: Path) -> list[Topic]:
    """The table of a Parquet file; ImportError where pyarrow is not installed."""
    return [_topic(pd.read_parquet(path))]


def _topic(table: pd.DataFrame) -> Topic:
    table.columns = [str(name).strip() for name in table.columns]
    return Topic("", table)
