"""CSV and other text tables, as spreadsheets and race loggers write them (`layout`), to one topic."""

import re
import warnings
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from pandas.api.types import is_numeric_dtype

from drift_drake.common.arrays import Array
from drift_drake.common.bounds import PACKINGS, STREAMS, packing
from drift_drake.gap.logs.importing.formats.layout import BLANKS, DECIMAL_COMMA, HEAD, WINDOWS, Layout, layout_of
from drift_drake.gap.logs.importing.formats.long_tables import as_wide
from drift_drake.gap.logs.importing.formats.times import with_times
from drift_drake.gap.logs.importing.formats.topics import NeededError, Topic

OF_FRAMES = (
    r"(can|arbitration|msg|message)?[ _]?id( \(hex\))?",
    r"dlc|len(gth)?",
    r"data( ?bytes)?( \(hex\))?|(data ?|d|b|byte ?)[01]",
)  # columns
BLANK = ["-", "--", "---", "n.a.", "n.v.", "k.A.", "SNA", "INVALID", "Invalid", "invalid", "*", "?", "nil", "No Data",
         "NoData", "#VALUE!", "#DIV/0!", "#REF!", "#NUM!", "[]"]  # fmt: skip
"""What stands where no reading is, besides what pandas knows."""
LARGE, PIECE = 1 << 25, 50_000  # bytes of a file; rows that are read at once
FEW = 0.5  # share of a column's texts that are numbers with a comma, from which all are read so


def read_csv(path: Path) -> list[Topic]:
    """The table of a text file; ValueError or OSError where it is none."""
    magic = packing(path)
    packed = PACKINGS.get(magic)
    with STREAMS[magic](path) if magic else path.open("rb") as stream:
        head = stream.read(HEAD + 1)
    layout = layout_of(head[:HEAD], len(head) <= HEAD)
    if not layout.plain:
        try:
            return [_read(path, layout, packed)]
        except UnicodeDecodeError:  # of an umlaut below the first lines
            return [_read(path, Layout(**{**vars(layout), "encoding": WINDOWS[0]}), packed)]
    try:
        return [_read_plain(path, packed, "utf-8")]
    except UnicodeDecodeError:
        return [_read_plain(path, packed, WINDOWS[0])]


def _read_plain(path: Path, packed: str | None, encoding: str) -> Topic:
    """A table as pandas takes it by itself."""
    read: Any = partial(pd.read_csv, path, compression=packed, encoding=encoding)
    table = _table(path, compression=packed, encoding=encoding, na_values=BLANK)
    header = read(header=None, nrows=1, dtype=str, keep_default_na=False).iloc[0]
    return topic_of_table(table, [str(name).strip() for name in header])


def _table(path: Path, **options: Any) -> pd.DataFrame:
    """What pandas reads; a large table of numbers alone in pieces, which takes half the memory."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", pd.errors.ParserWarning)
        try:
            if path.stat().st_size > LARGE and (columns := _numbers(path, options)) is not None:
                return pd.DataFrame(columns, copy=False)
            return pd.read_csv(path, low_memory=False, **options)
        except pd.errors.ParserWarning:
            raise ValueError("its rows have more fields than its header has names; name each column") from None


def _numbers(path: Path, options: dict[str, Any]) -> dict[Any, Array] | None:
    """The columns of a table in which all are whole or other numbers throughout."""
    pieces = []
    with pd.read_csv(path, chunksize=PIECE, low_memory=False, **options) as read:
        for piece in read:
            if not all(kind.kind in "if" for kind in piece.dtypes):
                return None
            pieces.append(piece)
    return {name: np.concatenate([piece[name].to_numpy() for piece in pieces]) for name in pieces[0]}


def topic_of_table(table: pd.DataFrame, names: Sequence[str], units: Sequence[str] = (), first_line: int = 2) -> Topic:
    """The topic of a table by the names in its file; where one is there twice, both say which column they are. Times
    that are no numbers become seconds."""
    if len(names) != len(table.columns):  # rows that are longer than their header
        names = [str(name).strip() for name in table.columns]
    if all(any(re.fullmatch(words, name, re.IGNORECASE) for name in names) for words in OF_FRAMES):
        raise NeededError("is a table of raw CAN frames, which is not read; save them as candump's .log, .asc or .blf")
    unique = [name if names.count(name) == 1 else f"{name} (column {number})" for number, name in enumerate(names, 1)]
    table.columns = pd.Index(unique)
    table, times = with_times(table)
    if (wide := as_wide(table, times)) is not None:
        table, units_of_signals = wide
        return Topic("", table, units_of_signals | dict.fromkeys(times, "s"), first_line)
    stated = {name: unit for name, unit in zip(unique, units, strict=False) if unit}
    return Topic("", table, stated | dict.fromkeys(times, "s"), first_line)


def _read(path: Path, layout: Layout, packed: str | None) -> Topic:
    """A table that is not as pandas takes it by itself."""
    width = len(layout.names)
    options: dict[str, Any] = {
        "sep": layout.separator, "encoding": layout.encoding, "header": None, "names": range(width), "index_col": False,
        "skiprows": layout.start, "comment": layout.comment, "skipinitialspace": True,
        "na_values": BLANK, "compression": packed,
    }  # fmt: skip
    if layout.separator == BLANKS:
        options.pop("skipinitialspace")
    table = _table(path, decimal=layout.decimal, thousands=layout.thousands, **options)
    if layout.decimal == "." and layout.separator != "," and any(_has_commas(table[k]) for k in table):
        table = _table(path, decimal=",", **options)  # the first lines held whole numbers alone
    empty = [k for k, name in enumerate(layout.names) if not name and table[k].isna().all()]
    table = table.drop(columns=empty)
    kept = [k for k in range(width) if k not in empty]
    names = [layout.names[k] or f"column {k + 1}" for k in kept]
    units = [layout.units[k] for k in kept] if layout.units else []
    return topic_of_table(table, names, units, layout.start + 1)


def _has_commas(values: "pd.Series[Any]") -> bool:
    if is_numeric_dtype(values):
        return False
    texts = values.dropna().astype(str)
    return len(texts) > 0 and float(np.mean(texts.str.fullmatch(DECIMAL_COMMA.pattern))) > FEW


def read_parquet(path: Path) -> list[Topic]:
    """The table of a Parquet file; ImportError where pyarrow is not installed."""
    table = pd.read_parquet(path)
    if not isinstance(table.index, pd.RangeIndex):  # of times, as a rule
        if table.index.name is None and table.index.dtype.kind in "Mmf":
            table.index.name = "time"
        table = table.reset_index()
    return [topic_of_table(table, [str(name).strip() for name in table.columns])]
