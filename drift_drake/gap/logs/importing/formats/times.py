"""Times that are no plain numbers, to seconds: text (ISO 8601, hh:mm:ss.fff, mm:ss.fff, with dates, days, am and pm),
dates of a table's own type, and clocks packed into digits (hhmmss.ss)."""

import re
import warnings
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from pandas.api.types import is_datetime64_any_dtype, is_numeric_dtype, is_timedelta64_dtype

from drift_drake.common.arrays import Array
from drift_drake.common.units import PACKED
from drift_drake.gap.logs.wording.conversion import factor

DAY, HOUR = 86400.0, 3600.0  # [s]
WEEK = 7.0 * DAY  # [s]
LATE = 0.9  # of a day, of a week, by which a clock of its time goes back as it ends
TEXT = re.compile(
    r"""^\s*(?P<date>.*?)[\sT,;_]*?(?P<first>\d{1,3}):(?P<second>\d{1,2})(?::(?P<third>\d{1,2}))?
    (?:[.,:](?P<part>\d+))?\s*(?P<half>[AaPp]\.?[Mm]\.?)?\s*(?P<zone>Z|UTC|GMT|[+-]\d{2}:?\d{2})?\s*$""",
    re.VERBOSE,
)
BASIC = r"^\s*(\d{8})T(\d{2})(\d{2})(\d{2})"  # of ISO 8601, without dashes and colons
DAYS = re.compile(r"(?P<days>\d{1,4})\s*(?:d|day|days|\.)?[,.\s]*", re.IGNORECASE)
ALIKE = 0.9  # share of a column's texts that are times
TRIED = 50  # texts
LONGEST = 80  # characters of a time
WHOLE, PART = r"(.*?[._/ ]?)secs?", r"n(ano)?secs?"  # of names of whole seconds, and of their nanoseconds
MISSING = 39.0  # of the 40 s (or min) that packed digits jump by
THINNED = 101  # rows, of which one shows soon that a clock counts on beyond the sixtieth second


def with_times(table: pd.DataFrame) -> tuple[pd.DataFrame, list[str]]:
    """The table with each column of times in seconds, and these columns' names; seconds and their parts in two columns
    are one."""
    table, found = _joined(table)
    for number, name in enumerate(table.columns):
        values = table.iloc[:, number]
        if not is_numeric_dtype(values) and (seconds := seconds_of(values)) is not None:
            found[name] = seconds
    return (table.assign(**found) if found else table), list(found)


def _joined(table: pd.DataFrame) -> tuple[pd.DataFrame, dict[Any, Array]]:
    """The table without columns of whole seconds and of their nanoseconds (`stamp.sec`, `stamp.nanosec`), and their
    sums under the seconds' names."""
    found: dict[Any, Array] = {}
    for name in list(table.columns):
        stem = re.fullmatch(WHOLE, str(name), re.IGNORECASE)
        part = next((c for c in table.columns if stem and re.fullmatch(re.escape(stem[1]) + PART, str(c), re.I)), None)
        if part is None or not all(is_numeric_dtype(table[one]) for one in (name, part)):
            continue
        rest = table[part].to_numpy(dtype=float)
        if np.nanmax(rest, initial=0.0) < 1e9 and np.nanmin(rest, initial=0.0) >= 0.0:
            found[name] = table[name].to_numpy(dtype=float) + 1e-9 * rest
            table = table.drop(columns=part)
    return table, found


def seconds_of(values: "pd.Series[Any]") -> Array | None:
    """Seconds [n] of a column of times (since 1970 where they have a date, else since midnight, and on across it);
    None where it holds no times. What is none among them is NaN."""
    if is_datetime64_any_dtype(values) or is_timedelta64_dtype(values):
        plain = values.dt.tz_convert(None) if getattr(values.dt, "tz", None) is not None else values
        origin = pd.Timedelta(0) if is_timedelta64_dtype(values) else pd.Timestamp(0)
        elapsed: Any = plain - origin
        return np.array(elapsed.dt.total_seconds(), dtype=float)
    if re.match(BASIC, str(values.dropna().iloc[0] if values.notna().any() else "")):
        values = values.astype("string").str.replace(BASIC, r"\1 \2:\3:\4", regex=True)
    texts = values.dropna().astype(str)
    if len(texts) and texts.str.len().max() > LONGEST:
        return None
    some = texts.iloc[:: max(1, len(texts) // TRIED)]
    if not len(some) or np.mean([bool(TEXT.match(text)) for text in some]) < ALIKE:
        return None
    parts = values.astype("string").str.extract(TEXT)
    dates = _dates(parts["date"])
    if dates is None:
        return None
    first, second, third = (pd.to_numeric(parts[name]).to_numpy(float, na_value=np.nan)
                            for name in ("first", "second", "third"))  # fmt: skip
    part = pd.to_numeric("0." + parts["part"].fillna("0")).to_numpy(float, na_value=np.nan)
    short = np.isnan(third)  # mm:ss
    clock = np.where(short, 60.0 * first + second, HOUR * first + 60.0 * second + np.nan_to_num(third)) + part
    half = parts["half"].fillna("").str.lower().str[:1].to_numpy(dtype=str)
    clock += 12.0 * HOUR * (((half == "p") & (first < 12)) * 1.0 - ((half == "a") & (first == 12)))
    if np.all(dates == 0.0):
        return unwrapped(clock, HOUR if np.all(short) and np.nanmax(first) < 60 else DAY)
    return np.asarray(dates + clock - _zones(parts["zone"]))


def unwrapped(seconds: Array, turn: float = DAY) -> Array:
    """Times [n] [s] that begin anew after each turn [s], on and on; NaN stay."""
    there = np.isfinite(seconds)
    turns = np.cumsum(np.diff(seconds[there], prepend=seconds[there][:1]) < -0.5 * turn)
    out = seconds.copy()
    out[there] += turn * turns
    return out


def clock_seconds(numbers: Array, unit: str) -> Array:
    """Times [s] of a clock [n]: packed digits unpacked, a time of day across midnight goes on."""
    if unit in PACKED:
        return packed_seconds(numbers, unit)
    t = np.asarray(numbers * factor(unit, ("time",)))
    seen = t[np.isfinite(t)]
    if len(seen) < 2 or np.min(seen) < 0.0:
        return t
    back = float(np.min(np.diff(seen)))
    turn = next((turn for turn in (DAY, WEEK) if np.max(seen) <= turn and back < -LATE * turn), None)
    return t if turn is None else unwrapped(t, turn)


def packed_seconds(numbers: Array, unit: str) -> Array:
    """Seconds [n] of a clock whose digits are hhmmss.ss (or hhmmssfff), on across midnight; NaN where they are not."""
    digits = numbers / PACKED[unit]
    hours, minutes, seconds = digits // 1e4, digits // 1e2 % 1e2, digits % 1e2
    clock = np.where(
        (hours < 24.0) & (minutes < 60.0) & (seconds < 60.0), HOUR * hours + 60.0 * minutes + seconds, np.nan
    )
    return unwrapped(clock)


def packed_unit(numbers: Array) -> str | None:
    """The unit of a clock that looks packed: it jumps by the missing 40 s (or 40 min) where a minute (hour) is full."""
    seen: NDArray[np.float64] = numbers[np.isfinite(numbers)]
    if len(seen) < 3 or np.min(seen) < 0.0:
        return None
    for unit, scale in PACKED.items():
        if np.max(seen) >= 240000.0 * scale or np.any(seen[::THINNED] / scale % 100.0 >= 60.0):
            continue
        raw = np.diff(seen) / scale
        if not np.any((raw > MISSING) | (raw < -2e5)):
            continue
        with np.errstate(invalid="ignore"):
            steps = np.diff(packed_seconds(seen, unit))
        jumps = np.isfinite(steps) & (steps >= 0.0) & ((raw - steps > MISSING) | (raw < -2e5))
        usual = float(np.median(np.abs(raw)))
        if np.all(np.isfinite(steps)) and np.any(jumps & (steps < 10.0 * usual + 1e-6)) and usual < 20.0:
            return unit
    return None


def _dates(texts: "pd.Series[Any]") -> Array | None:
    """Seconds of the days [n] that stand before the clock; zero where none does, None where one is no date."""
    codes, unique = pd.factorize(texts.fillna("").str.strip(" ,;T_"))
    seconds = [_day(str(text), False) for text in unique]
    if any(value is None for value in seconds):
        return None
    known = np.array(seconds, dtype=float)
    if len(unique) > 1 and not any(re.match(r"\d{4}", str(text)) for text in unique):
        other = [_day(str(text), True) for text in unique]  # 3/4 is April or March: days of one drive are near
        swapped = np.array([np.nan if value is None else value for value in other], dtype=float)
        if np.isfinite(swapped).all() and np.ptp(swapped) < np.ptp(known):
            known = swapped
    return np.asarray(known[codes])


def _day(text: str, day_first: bool) -> float | None:
    if not text:
        return 0.0
    if days := DAYS.fullmatch(text):
        return DAY * float(days["days"])
    numbers = re.findall(r"\d+", text)
    first = "." in text or day_first or (len(numbers) == 3 and 12 < int(numbers[0]) <= 31)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            stamp = pd.to_datetime(text, dayfirst=first and len(numbers[0]) < 4 if numbers else first)
        return float((stamp - pd.Timestamp(0)) / pd.Timedelta("1s"))
    except (ValueError, TypeError, OverflowError):
        return None


def _zones(texts: "pd.Series[Any]") -> Array:
    """Seconds east [n] of the zones."""
    codes, unique = pd.factorize(texts.fillna(""))
    shifts = []
    for text in unique:
        found = re.fullmatch(r"([+-])(\d{2}):?(\d{2})", str(text))
        east = 0.0 if found is None else HOUR * int(found[2]) + 60.0 * int(found[3])
        shifts.append(-east if found is not None and found[1] == "-" else east)
    return np.array(shifts, dtype=float)[codes]
