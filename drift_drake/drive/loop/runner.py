"""What every simulated drive shares: the integrator, the monitor that ends it, and the logs that it leaves."""

from collections.abc import Callable, Sequence
from pathlib import Path

import pandas as pd
from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, EventStatus, OutputPort, System
from pydrake.systems.primitives import VectorLogSink

from drift_drake.common.arrays import Array
from drift_drake.common.errors import OutputError

# [s] of the integrator: just above the events' period. At 0.01 itself, rounding of the events' times leaves one step in
# seven with 1e-15 s to go, which takes another three derivatives.
MAX_STEP = 0.01 * (1.0 + 1e-6)
ACCURACY = 1e-4
ROWS = 1000  # in memory at most


def make_simulator(
    diagram: Diagram,
    context: Context | None = None,
    ends: tuple[System, Callable[[Context], str | None]] | None = None,
    accuracy: float = ACCURACY,
) -> Simulator:
    """A simulator with the integrator that all drives use (third order, steps by error control).

    Args:
        context: of the diagram; a default one without.
        ends: a system, and why the run ends there and then (None where it goes on), from the diagram's Context.
    """
    simulator = Simulator(diagram, context) if context is not None else Simulator(diagram)
    ResetIntegratorFromFlags(simulator, "runge_kutta3", MAX_STEP).set_target_accuracy(accuracy)
    if ends is not None:
        system, reason_at = ends

        def monitor(root: Context) -> EventStatus:
            reason = reason_at(root)
            return EventStatus.DidNothing() if reason is None else EventStatus.ReachedTermination(system, reason)

        simulator.set_monitor(monitor)
    return simulator


def add_logger(builder: DiagramBuilder, port: OutputPort, name: str, period: float) -> VectorLogSink:
    """Adds a logger of a port to a diagram, called log_NAME; `period`: [s] between its samples."""
    sink = builder.AddNamedSystem(f"log_{name}", VectorLogSink(port.size(), period))
    builder.Connect(port, sink.get_input_port())
    return sink


class Logs:
    """Loggers of a diagram's ports, one table of them all.

    Args:
        builder: of the diagram; period: [s] between rows.
    """

    def __init__(self, builder: DiagramBuilder, period: float) -> None:
        self._builder, self._period = builder, period
        self._columns: list[tuple[VectorLogSink, tuple[str, ...]]] = []

    def add(self, port: OutputPort, columns: Sequence[str], name: str) -> None:
        """Logs a port under a name; `columns`: what its numbers are called in the table, empty for those left out."""
        self._columns.append((add_logger(self._builder, port, name, self._period), tuple(columns)))

    def count(self, context: Context) -> int:
        """Rows that are logged."""
        return int(self._columns[0][0].FindLog(context).num_samples())

    def clear(self, context: Context) -> None:
        for sink, _ in self._columns:
            sink.FindMutableLog(context).Clear()

    def table(self, context: Context) -> pd.DataFrame:
        """A row each period; t is the sampling's time unless a port gives a column t.

        An instant that is logged twice (at the end of a run) has its last values.
        """
        columns: dict[str, Array] = {}
        for sink, names in self._columns:
            log = sink.FindLog(context)
            columns.setdefault("t", log.sample_times())
            columns |= {name: values for name, values in zip(names, log.data(), strict=True) if name}
        return pd.DataFrame(columns).drop_duplicates("t", keep="last", ignore_index=True)


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
            reason = f"{self._path}: cannot be written ({error.strerror}); give another place, or free some space"
            raise OutputError(reason) from error


def read_log(path: Path) -> pd.DataFrame:
    """The table of a `LogFile`: that of `Logs.table`, to the bit."""
    return pd.read_csv(path)
