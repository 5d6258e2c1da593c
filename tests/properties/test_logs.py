"""What must not matter in a file does not, and what must is seen: units and axes, the order of columns and of rows."""

import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

pytest.importorskip("hypothesis", reason="properties need the extra `test`")

from hypothesis import given, settings
from hypothesis import strategies as st

from drift_drake.car.log.table import COLUMNS, InvalidLogError, Run, read_run
from drift_drake.gap.logs.importing.importer import import_recordings
from drift_drake.gap.logs.importing.mapping import mapping_from_dict
from drift_drake.gap.logs.wording.conversion import DIMENSIONS, FRAMES, MIRRORED, QUANTITIES, factor

few = settings(max_examples=12, deadline=None, derandomize=True, database=None)
COUNT, PERIOD = 400, 0.01
SIGNALS = ("r", "v", "beta", "ax", "ay", "psi", "delta_cmd", "tau_cmd")


def drive() -> pd.DataFrame:
    """Columns of a log, in SI and ISO 8855: no car's, but the size of one's."""
    t = PERIOD * np.arange(COUNT)
    wave, slow = np.sin(2.3 * t), np.cos(0.9 * t)
    return pd.DataFrame(
        {"t": t, "r": 0.3 * wave, "v": 14.0 + slow, "beta": -0.02 * wave, "ax": 0.5 * slow, "ay": 4.0 * wave,
         "psi": 0.13 * (1.0 - np.cos(2.3 * t)), "delta_cmd": 0.05 * wave, "tau_cmd": 80.0 + 40.0 * slow}
    )  # fmt: skip


def recorded(
    columns: pd.DataFrame, signals: dict[str, Any], frame: str = "iso8855", unit: str = "s"
) -> tuple[Run, list[str]]:
    """The run that an import makes of a recording in these units and axes, and its remarks."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run_0.csv"
        columns.to_csv(path, index=False)
        mapping = mapping_from_dict(
            {"frame": frame, "clocks": {"main": {"column": "t", "unit": unit}}, "signals": signals}, "mapping"
        )
        (one,), report = import_recordings([path], mapping)
        return one, report.remarks


def plain_signals() -> dict[str, Any]:
    return {name: {"column": name, "unit": DIMENSIONS[QUANTITIES[name]][0]} for name in SIGNALS}


@pytest.fixture(scope="module")
def expected() -> Run:
    return recorded(drive(), plain_signals())[0]


@few
@given(data=st.data())
def test_units_and_axes_changed_in_mapping_and_file_give_the_same_run(expected: Run, data: st.DataObject) -> None:
    frame, clock = data.draw(st.sampled_from(FRAMES)), data.draw(st.sampled_from(["s", "ms", "us"]))
    columns, signals = drive(), plain_signals()
    columns["t"] /= factor(clock)
    for name in SIGNALS:
        unit = data.draw(st.sampled_from(list(DIMENSIONS[QUANTITIES[name]][1])), label=name)
        sign = data.draw(st.sampled_from([1, -1]), label=f"sign of {name}")
        mirrored = -1 if frame != "iso8855" and name in MIRRORED else 1
        columns[name] *= sign * mirrored / factor(unit)
        signals[name] |= {"unit": unit, "sign": sign}
    run, _ = recorded(columns, signals, frame, clock)
    for name in COLUMNS:
        one, other = run.column(name), expected.column(name)
        assert (one is None) == (other is None)
        if one is not None and other is not None:
            np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-9 * np.ptp(other))


def written(folder: Path, columns: pd.DataFrame) -> Path:
    columns.to_csv(folder / "run_0.csv", index=False)
    return folder / "run_0.csv"


@few
@given(order=st.permutations(list(drive().columns)))
def test_the_order_of_columns_does_not_matter(order: list[str]) -> None:
    with tempfile.TemporaryDirectory() as folder:
        run = read_run(written(Path(folder), drive()[order]))
    for name in drive().columns:
        np.testing.assert_allclose(run.column(name), drive()[name], rtol=1e-12)


@st.composite
def reordered(draw: st.DrawFn) -> list[int]:
    """Rows in another order: a block moved elsewhere, perhaps turned round."""
    first = draw(st.integers(0, COUNT - 2))
    last = draw(st.integers(first + 1, COUNT))
    rows = list(range(COUNT))
    block, rest = rows[first:last], rows[:first] + rows[last:]
    block = block[::-1] if draw(st.booleans()) else block
    to = draw(st.integers(0, len(rest)))
    return rest[:to] + block + rest[to:]


@few
@given(rows=reordered().filter(lambda rows: rows != list(range(COUNT))))
def test_rows_in_another_order_are_refused(rows: list[int]) -> None:
    columns = drive().iloc[rows]
    with tempfile.TemporaryDirectory() as folder:
        path = written(Path(folder), columns)
        with pytest.raises(InvalidLogError, match="sort the rows"):
            read_run(path)
    try:
        _, remarks = recorded(columns, plain_signals())
    except InvalidLogError:
        return
    assert any("left out of 't'" in remark for remark in remarks)  # a few only, and reported
