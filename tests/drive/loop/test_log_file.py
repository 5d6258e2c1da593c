"""A log that goes to a file on the way: the same rows to the bit, few of them in memory."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, EventStatus
from pydrake.systems.primitives import Sine

from drift_drake.common.errors import OutputError
from drift_drake.drive.loop import runner
from drift_drake.drive.loop.runner import LogFile, Logs, read_log

PERIOD, END = 0.01, 2.0


def waves() -> tuple[Diagram, Logs]:
    """A diagram of two sines and their logs."""
    builder = DiagramBuilder()
    source = builder.AddSystem(Sine(np.array([1.0, 0.3]), np.array([3.0, 7.1]), np.zeros(2)))
    logs = Logs(builder, PERIOD)
    logs.add(source.get_output_port(0), ("a", "b"), "waves")
    logs.add(source.get_output_port(1), ("slope", ""), "slopes")
    return builder.Build(), logs


def run(diagram: Diagram, logs: Logs, file: LogFile | None) -> tuple[Context, int]:
    """(the Context at the end, the most rows in memory), the drive advanced in two pieces."""
    simulator, most = Simulator(diagram), 0

    def monitor(root: Context) -> EventStatus:
        nonlocal most
        if file is not None:
            file.take(root)
        most = max(most, logs.count(root))
        return EventStatus.DidNothing()

    simulator.set_monitor(monitor)
    for end in (0.5 * END, END):
        simulator.AdvanceTo(end)
    return simulator.get_mutable_context(), most


def test_the_file_holds_the_table_to_the_bit_and_memory_few_rows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(runner, "ROWS", 25)
    diagram, logs = waves()
    context, most = run(diagram, logs, None)
    table = logs.table(context)
    assert len(table) == most == round(END / PERIOD) + 1
    file = LogFile(logs, tmp_path / "run.csv")
    context, most = run(diagram, logs, file)
    assert most < 25
    assert file.finish(context) == tmp_path / "run.csv"
    pd.testing.assert_frame_equal(read_log(tmp_path / "run.csv"), table, check_exact=True)


def test_a_file_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match=r"nowhere/run.csv: cannot be written \(No such file or directory\)"):
        LogFile(waves()[1], tmp_path / "nowhere" / "run.csv")
