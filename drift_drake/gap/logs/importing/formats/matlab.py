"""MATLAB's .mat (also 7.3): arrays and structs, tables and timetables, and Simulink's logs with their own times.

Of Simulink's structure with time, of a timeseries, and of a matrix of times and values by the name X, the values go by
the name X and their clock by `X.time`. Series that were read at the same times are one topic.
"""

import dataclasses
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from drift_drake.common.arrays import Array
from drift_drake.gap.logs.importing.formats.arrays import SHORTEST, topics_of_arrays
from drift_drake.gap.logs.importing.formats.topics import LONGEST_ARRAY, Topic

PLAIN = {"double", "single", "logical", "char", "cell", "struct", "sparse", "function"}
NO_TIMES = (
    "pos",
    "xy",
    "path",
    "track",
    "coord",
    "curve",
    "map",
    "line",
    "yout",
    "xout",
)  # pairs by such names are no series
STEADY = 3.0  # steps of a pair's clock differ from their median by at most this factor
HDF5_VERSION = (b"\x00\x02", b"\x02\x00")  # in the header of a file of 7.3
CHANNELS = {"name": ("name", "label", "channel"), "data": ("data", "values", "value", "samples"),
            "time": ("time", "times", "t"), "unit": ("unit", "units")}  # fmt: skip
TOUT = "tout"  # Simulink's vector of times


class Series(NamedTuple):
    """Values by name, read at times t [n] that go by the name `clock` (None: those of `tout`)."""

    clock: str
    t: Array | None
    columns: dict[str, np.ndarray]


def read_mat(path: Path) -> list[Topic]:
    """All numeric arrays of a MATLAB file, structs by dots.

    Raises:
        ValueError: no MATLAB file, or no arrays; ImportError: `pymatreader` is not installed; OSError.
    """
    from pymatreader import read_mat as read
    from scipy.io.matlab import MatReadError

    objects, left_out = _objects(path)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # on objects of MATLAB's own classes, which are read otherwise
            content = read(str(path))
    except (MatReadError, NotImplementedError, TypeError, KeyError, IndexError) as error:
        raise ValueError(str(error) or "no MATLAB file") from None
    content = {
        name: value
        for name, value in content.items()
        if not str(name).startswith(("__", "#")) and name not in {"None", *objects, *left_out}
    } | {name: value for name, value in objects.items() if not isinstance(value, pd.DataFrame)}
    found: list[Series] = []
    rest = _without_series("", content, found)
    topics = [_of_table(name, table) for name, table in objects.items() if isinstance(table, pd.DataFrame)]
    topics += _of_series(found, content.get(TOUT))
    try:
        topics += [_with_tout(topic) for topic in topics_of_arrays(rest)]
    except ValueError:
        if not topics:
            said = ", ".join(f"{name}: {why}" for name, why in left_out.items())
            raise ValueError(f"holds no arrays of numbers with rows{f' ({said})' if said else ''}") from None
    first = topics[0]
    topics[0] = dataclasses.replace(first, left_out=left_out)
    return _named_once(topics)


def _objects(path: Path) -> tuple[dict[str, Any], dict[str, str]]:
    """Variables of MATLAB's own classes: tables, the properties of others as mappings; and why some are left out."""
    if not _has_objects(path):
        return {}, {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # on an option of pandas that it sets
        from matio import load_from_mat, whosmat
    kinds = {name: kind for name, (_, kind) in whosmat(str(path)).items()}
    names = [name for name, kind in kinds.items() if kind not in PLAIN and not kind.startswith(("int", "uint"))]
    objects: dict[str, Any] = {}
    left_out: dict[str, str] = {}
    for name in names:
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                loaded = load_from_mat(str(path), raw_data=False, variable_names=[name])[name]
            value = loaded if isinstance(loaded, pd.DataFrame) else _plain(loaded)
        except Exception:  # of many classes
            value = None
        if isinstance(value, pd.DataFrame | dict):
            objects[name] = value
        else:
            left_out[name] = f"an object of the class {kinds[name]}; save it as a structure or a timetable"
    return objects, left_out


def _has_objects(path: Path) -> bool:
    """Whether a file has the part that objects of classes are kept in."""
    with path.open("rb") as stream:
        header = stream.read(128)
    if header[124:126] not in HDF5_VERSION:
        return header.startswith(b"MATLAB") and bool(header[116:124].strip(b" \0"))
    import h5py

    with h5py.File(path, "r") as file:
        return "#subsystem#" in file


def _plain(value: Any) -> Any:
    """Properties of objects as mappings, cells as lists, nested."""
    properties = getattr(value, "properties", None)
    if isinstance(properties, Mapping):
        return {str(key).strip("_"): _plain(part) for key, part in properties.items()}
    if isinstance(value, Mapping):
        return {str(key): _plain(part) for key, part in value.items()}
    if isinstance(value, np.ndarray) and value.dtype == object:
        parts = [_plain(part) for part in value.ravel()]
        return parts[0] if len(parts) == 1 else parts
    return np.squeeze(value) if isinstance(value, np.ndarray) and value.dtype.kind in "biuf" else value


def _of_table(name: str, table: pd.DataFrame) -> Topic:
    """A topic of a table, or of a timetable with its times [s]."""
    columns: dict[str, Any] = {}
    clock = ""
    if isinstance(table.index, pd.TimedeltaIndex | pd.DatetimeIndex):
        clock = f"{name}.{table.index.name or 'Time'}"
        index: Any = table.index
        origin = pd.Timestamp(0, tz=index.tz) if isinstance(index, pd.DatetimeIndex) else pd.Timedelta(0)
        columns[clock] = np.asarray((index - origin) / pd.Timedelta(1, "s"), dtype=float)
    for key in table.columns:
        values: Any = table[key]
        if values.dtype.kind == "m":
            values = values / pd.Timedelta(1, "s")
        columns[f"{name}.{key}"] = values.to_numpy()
    return Topic(name, pd.DataFrame(columns), {clock: "s"} if clock else {}, clock=clock)


def _without_series(name: str, value: Any, found: list[Series]) -> Any:
    """What is left of nested content once its series are taken out, which are added to `found`."""
    if isinstance(value, Mapping):
        value = _channels(value) or value
        series = _series(name, value)
        if series is not None:
            found.append(series)
            return {}
        inner = {key: part for key, part in value.items() if not (str(key).lower() == "values" and name)}
        rest = {key: _without_series(f"{name}.{key}" if name else str(key), part, found) for key, part in inner.items()}
        for key in set(value) - set(inner):  # an element of a data set: Name, Values
            rest[key] = _without_series(name, value[key], found) if isinstance(value[key], Mapping) else value[key]
        return rest
    if isinstance(value, list) and any(isinstance(part, Mapping) for part in value):
        parts = []
        for index, part in enumerate(value[:LONGEST_ARRAY]):
            said = part.get("Name", "") if isinstance(part, Mapping) else ""
            called = f"{name}.{said}" if isinstance(said, str) and said else f"{name}[{index}]"
            parts.append(_without_series(called, part, found))
        return parts
    series = _pair(name, value)
    if series is not None:
        found.append(series)
        return {}
    return value


def _channels(value: Mapping[str, Any]) -> dict[str, Any] | None:
    """An array of structures with names and values, as a structure by these names; None of any other."""
    parts = {role: next((value[key] for key in value if str(key).lower() in words), None)
             for role, words in CHANNELS.items()}  # fmt: skip
    names, data = parts["name"], parts["data"]
    if not isinstance(names, list) or not all(isinstance(name, str) and name for name in names) or data is None:
        return None
    if len(set(names)) < len(names) or len(data) != len(names):
        return None
    units = parts["unit"] if isinstance(parts["unit"], list) else [""] * len(names)
    called = [f"{name} [{unit}]" if isinstance(unit, str) and unit else name
              for name, unit in zip(names, units, strict=False)]  # fmt: skip
    if parts["time"] is None or len(parts["time"]) != len(names):
        return dict(zip(called, data, strict=True))
    return {key: {"data": part, "time": t} for key, part, t in zip(called, data, parts["time"], strict=True)}


def _series(name: str, value: Mapping[str, Any]) -> Series | None:
    """A structure of Simulink with its times and signals, or a timeseries; None of any other."""
    keys = {str(key).strip("_").lower(): key for key in value}
    if "signals" in keys and "time" in keys:
        clock, t = f"{name}.{keys['time']}", _vector(value[keys["time"]])
        columns = _signals(name, value[keys["signals"]])
    elif "data" in keys and ({"time", "timeinfo"} & set(keys)):
        clock, t = f"{name}.{keys.get('time', 'Time')}", _times(value, keys)
        columns = {name: value[keys["data"]]}
        if t is None:
            return None
    else:
        return None
    if t is not None and len(t) < SHORTEST:
        t = None
    split: dict[str, np.ndarray] = {}
    for key, values in columns.items():
        split |= _split(key, np.asarray(values), None if t is None else len(t))
    return Series(clock, t, split) if split else None


def _signals(name: str, signals: Any) -> dict[str, Any]:
    """Values of a structure's signals: one by its name, several by their labels or numbers."""
    if isinstance(signals, Mapping):
        values, labels = signals.get("values"), signals.get("label", "")
        if not isinstance(values, list):
            return {name: values}
        labels = labels if isinstance(labels, list) else [labels] * len(values)
        signals = [{"values": part, "label": label} for part, label in zip(values, labels, strict=False)]
    parts = [part for part in signals if isinstance(part, Mapping)] if isinstance(signals, list) else []
    if len(parts) == 1:
        return {name: parts[0].get("values")}
    labels = [part.get("label") for part in parts]
    return {
        f"{name}.{label}" if isinstance(label, str) and label and labels.count(label) == 1 else f"{name}[{index}]": (
            part.get("values")
        )
        for index, (label, part) in enumerate(zip(labels, parts, strict=True))
    }


def _times(value: Mapping[str, Any], keys: Mapping[str, str]) -> Array | None:
    """Times of a timeseries: written out, or by their start and increment."""
    if "time" in keys and (t := _vector(value[keys["time"]])) is not None:
        return t
    info = value.get(keys.get("timeinfo", ""), {})
    if not isinstance(info, Mapping):
        return None
    parts = {str(key).strip("_").lower(): part for key, part in info.items()}
    if (t := _vector(parts.get("time"))) is not None and len(t) >= SHORTEST:
        return t
    try:
        start, step, count = (float(np.squeeze(parts[key])) for key in ("start", "increment", "length"))
        return np.asarray(start + step * np.arange(int(count)), dtype=float) if step > 0.0 else None
    except (KeyError, TypeError, ValueError):
        return None


def _vector(value: Any) -> Array | None:
    values = np.asarray(value)
    return values.astype(float).ravel() if values.dtype.kind in "biuf" and values.ndim in (1, 2) else None


def _split(name: str, values: np.ndarray, rows: int | None) -> dict[str, np.ndarray]:
    """Columns of values [n], [n x k] or [k x n]; none where they are no numbers or of another length."""
    values = np.squeeze(values)
    if values.dtype.kind not in "biuf" or values.ndim not in (1, 2):
        return {}
    if values.ndim == 2 and values.shape[0] != rows and (values.shape[1] == rows or values.shape[0] < values.shape[1]):
        values = values.T
    if (rows is not None and len(values) != rows) or len(values) < SHORTEST:
        return {}
    if values.ndim == 1:
        return {name: values}
    return {f"{name}[{i}]": values[:, i] for i in range(values.shape[1])} if values.shape[1] <= LONGEST_ARRAY else {}


def _pair(name: str, value: Any) -> Series | None:
    """A matrix of two columns (or rows) whose first one advances steadily: times and values."""
    values = np.asarray(value) if isinstance(value, np.ndarray) else np.empty(0)
    if values.ndim != 2 or 2 not in values.shape or values.dtype.kind not in "iuf" or not name:
        return None
    values = values if values.shape[1] == 2 else values.T
    last = name.split(".")[-1].lower()
    steps = np.diff(values[:, 0].astype(float))
    if len(steps) < SHORTEST or not np.all(steps > 0.0) or any(word in last for word in NO_TIMES):
        return None
    typical = float(np.median(steps))
    if np.max(steps) > STEADY * typical or np.min(steps) < typical / STEADY:
        return None
    return Series(f"{name}.time", values[:, 0].astype(float), {name: values[:, 1]})


def _of_series(found: list[Series], tout: Any) -> list[Topic]:
    """A topic of all series that were read at the same times below the same name."""
    common = _vector(tout)
    groups: dict[tuple[str, bytes], tuple[str, dict[str, np.ndarray], dict[str, str]]] = {}
    for series in found:
        t, clock = (series.t, series.clock) if series.t is not None else (common, TOUT)
        parent = series.clock.rpartition(".")[0].rpartition(".")[0] or "series"
        columns = {key: values for key, values in series.columns.items() if t is None or len(values) == len(t)}
        stamp = t.tobytes() if t is not None else str(len(next(iter(series.columns.values())))).encode()
        _, table, units = groups.setdefault((parent, stamp), (clock if t is not None else "", {}, {}))
        table |= ({clock: t} if t is not None else {}) | columns
        units |= {clock: "s"} if t is not None else {}
    return [
        Topic(parent, pd.DataFrame(table), units, clock=clock) for (parent, _), (clock, table, units) in groups.items()
    ]


def _with_tout(topic: Topic) -> Topic:
    clock = next((str(name) for name in topic.table if str(name).rpartition(".")[2] == TOUT), "")
    return dataclasses.replace(topic, clock=clock)


def _named_once(topics: list[Topic]) -> list[Topic]:
    """The topics, those of one name distinguished by their rows, or by a number."""
    names: list[str] = []
    for topic in topics:
        name = topic.name
        if sum(other.name == name for other in topics) > 1 and name:
            name = f"{name}({len(topic.table)} rows)"
        while name in names:
            name += "'"
        names.append(name)
    return [dataclasses.replace(topic, name=name) for name, topic in zip(names, topics, strict=True)]
