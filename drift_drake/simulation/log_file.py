"""A run's log as a CSV that grows while the car drives, so that memory does not."""

from pathlib import Path

import pandas as pd
from pydrake.systems.framework import Context

from drift_drake.errors import OutputError
from drift_drake.simulation.runner import Logs

ROWS = 1000  # in memory at most


class LogFile:
    """Moves the rows of `Logs` to a file, a thousand at a time; what a run that is killed has written stays.

    Args:
        logs: of the diagram; path: of the file, which is begun anew.

    Raises:
        OutputError: the file cannot be written, now or later.
    """

    def __init__(self, logs: Logs, path: Path) -> None:
        self._logs, self._path = logs, path
        self._newest = pd.DataFrame()
        self._write("", "w")

    def take(self, context: Context) -> None:
        """Moves the rows if they are many; to be called after each step (a monitor), from the diagram's Context."""
        if self._logs.count(context) >= ROWS:
            rows = self._rows(context)
            # The newest row waits: an instant that is logged again has its last values.
            self._append(rows.iloc[:-1])
            self._newest = rows.iloc[-1:]
            self._logs.clear(context)

    def finish(self, context: Context) -> Path:
        """Moves all rows that are left; the file."""
        self._append(self._rows(context))
        self._logs.clear(context)
        return self._path

    def _rows(self, context: Context) -> pd.DataFrame:
        rows = self._logs.table(context)
        if not self._newest.empty:
            rows = pd.concat([self._newest, rows]).drop_duplicates("t", keep="last", ignore_index=True)
        return rows

    def _append(self, rows: pd.DataFrame) -> None:
        self._write(rows.to_csv(index=False, header=self._newest.empty), "a")

    def _write(self, text: str, mode: str) -> None:
        try:
            with self._path.open(mode, encoding="utf-8", newline="") as file:
                file.write(text)
        except OSError as error:
            reason = f"{self._path}: cannot be written ({error.strerror}); give another place, or make room"
            raise OutputError(reason) from error


def read_log(path: Path) -> pd.DataFrame:
    """The table of a `LogFile`: that of `Logs.table`, to the bit."""
    return pd.read_csv(path)
