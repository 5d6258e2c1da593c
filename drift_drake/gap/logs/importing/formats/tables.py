"""Parquet, one topic, whose rows were written together. A unit may stand in a column's name: `speed [km/h]`."""

from pathlib import Path

import pandas as pd

from drift_drake.gap.logs.importing.formats.text_tables import topic_of_table
from drift_drake.gap.logs.importing.formats.topics import Topic


def read_parquet(path: Path) -> list[Topic]:
    """The table of a Parquet file; ImportError where pyarrow is not installed."""
    table = pd.read_parquet(path)
    if not isinstance(table.index, pd.RangeIndex):  # of times, as a rule
        if table.index.name is None and table.index.dtype.kind in "Mmf":
            table.index.name = "time"
        table = table.reset_index()
    return [topic_of_table(table, [str(name).strip() for name in table.columns])]
