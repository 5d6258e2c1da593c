"""The results of many cases, cars or runs as one table, a row each."""

from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from drift_drake.safe_files import replacing

if TYPE_CHECKING:
    import pandas as pd


def write_results_table(folder: Path, rows: "Sequence[Mapping[str, Any]] | pd.DataFrame") -> Path:
    """Writes results.parquet, or results.csv where pyarrow is not installed, whole or not at all; returns its path.

    Args:
        rows: one for each result, by column; what one has and another lacks is empty there.

    Raises:
        OutputError: the file cannot be written.
    """
    import pandas as pd

    table = pd.DataFrame(rows)
    if find_spec("pyarrow") is None:
        path = folder / "results.csv"
        with replacing(path) as part:
            table.to_csv(part, index=False)
        return path
    path = folder / "results.parquet"
    with replacing(path) as part:
        table.to_parquet(part, index=False)
    return path
