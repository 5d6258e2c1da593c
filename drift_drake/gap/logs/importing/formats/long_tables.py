"""Tables in long format, a row for each reading (time, signal, value), to columns."""

from typing import Any

import pandas as pd
from pandas.api.types import is_numeric_dtype

from drift_drake.car.log.numbers import as_numbers
from drift_drake.gap.logs.wording.vocabulary import LONGEST, pieces

ROLES = {
    "signal": (
        "signal channel name variable topic key parameter param tag metric measure field quantity message kanal "
        "signalname groesse messgroesse canal voie grandeur"
    ),
    "value": "value val values reading data wert messwert valeur mesure valore valor",
    "unit": "unit units einheit unite unita",
    "time": "time timestamp t ts stamp zeit zeitstempel temps tempo tiempo seconds date datetime utc clock",
}
SIGNALS, VALUES, UNITS, TIMES = (set(words.split()) for words in ROLES.values())  # words of the columns' names
MOST_SIGNALS = 1000
FEWEST_ROWS = 5  # of a signal, in the mean
NUMBERS = 0.5  # share of values from which they are numbers


def as_wide(table: pd.DataFrame, times: list[str]) -> tuple[pd.DataFrame, dict[str, str]] | None:
    """A column for each signal of a table in long format, in rows of equal times, and the units that it states.

    Args:
        times: columns that are known to be times.

    Returns:
        None of a table of any other kind.
    """
    columns = [str(name) for name in table.columns]
    words = {name: set(pieces(name[:LONGEST])) for name in columns}
    signal = next((n for n in columns if words[n] & SIGNALS and not is_numeric_dtype(table[n])), None)
    value = next((n for n in columns if n != signal and words[n] & VALUES), None)
    time = next((n for n in columns if n not in (signal, value) and (n in times or words[n] & TIMES)), None)
    if signal is None or value is None or time is None or not is_numeric_dtype(table[time]):
        return None
    names = table[signal].astype("string").str.strip()
    numbers = as_numbers(table[value])
    count = names.nunique()
    if not 1 <= count <= min(MOST_SIGNALS, len(table) // FEWEST_ROWS) or numbers.notna().mean() < NUMBERS:
        return None
    kept = names.notna() & (names != "") & numbers.notna() & table[time].notna()
    long = pd.DataFrame({"time": table[time], "signal": names, "value": numbers})[kept]
    # Twice at one time: the later one is what was known then.
    wide = long.drop_duplicates(["time", "signal"], keep="last").pivot(index="time", columns="signal", values="value")
    out = wide.reset_index().rename(columns={"time": time})
    out.columns = pd.Index([time, *(f"{name} (signal)" if name == time else str(name) for name in out.columns[1:])])
    unit = next((n for n in columns if n not in (signal, value, time) and words[n] & UNITS), None)
    return out, {} if unit is None else _units(names[kept], table[unit][kept])


def _units(names: "pd.Series[Any]", units: "pd.Series[Any]") -> dict[str, str]:
    """The first unit that stands next to each signal."""
    stated: Any = units.astype("string").str.strip().groupby(names.to_numpy()).first()
    return {str(name): str(unit) for name, unit in stated.items() if isinstance(unit, str) and unit}
