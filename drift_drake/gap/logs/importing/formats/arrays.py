"""Files of named arrays as topics: NumPy's .npz and HDF5.

Arrays of one length below the same name at the file's top are one topic: of the structs `imu` and `gps` one each, and
the plain vectors of a workspace one for each length.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from drift_drake.gap.logs.importing.formats.topics import LONGEST_ARRAY, Topic

SHORTEST = 2  # rows of a topic


def read_npz(path: Path) -> list[Topic]:
    """All numeric arrays of an .npz file.

    Raises:
        ValueError: no arrays, or pickled objects; OSError.
    """
    with path.open("rb") as stream, np.load(stream, allow_pickle=False) as file:
        return topics_of_arrays({name: file[name] for name in file.files})


def read_hdf5(path: Path) -> list[Topic]:
    """All numeric data sets of an HDF5 file, groups by dots; units from their attribute `units` or `unit`.

    Raises:
        ValueError: no arrays; ImportError: `h5py` is not installed; OSError.
    """
    import h5py

    arrays: dict[str, np.ndarray] = {}
    units: dict[str, str] = {}

    def visit(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset) and item.dtype.kind in "biufV":
            arrays[name.replace("/", ".")] = item[()]
            unit = item.attrs.get("units", item.attrs.get("unit"))
            if unit is not None:
                units[name.replace("/", ".")] = unit.decode() if isinstance(unit, bytes) else str(unit)

    with h5py.File(path, "r") as file:
        file.visititems(visit)
    return topics_of_arrays(arrays, units)


def topics_of_arrays(content: Mapping[str, Any], units: Mapping[str, str] | None = None) -> list[Topic]:
    """Topics of nested named arrays.

    Raises:
        ValueError: no array of numbers with at least two rows.
    """
    flat: dict[str, np.ndarray] = {}
    _flatten(flat, "", content)
    topics: dict[tuple[str, int], dict[str, np.ndarray]] = {}
    stated: dict[str, str] = {}
    for name, values in flat.items():
        top = name.split(".")[0].split("[")[0] if "." in name else ""
        rows = {} if values.ndim == 1 else {f"{name}[{i}]": values[:, i] for i in range(values.shape[1])}
        columns = rows or {name: values}
        topics.setdefault((top, len(values)), {}).update(columns)
        stated |= dict.fromkeys(columns, (units or {}).get(name, ""))
    if not topics:
        raise ValueError("holds no arrays of numbers with rows")
    tops = [top for top, _ in topics]
    names = {key: key[0] if tops.count(key[0]) == 1 else f"{key[0]}({key[1]} rows)" for key in topics}
    return [Topic(names[key], pd.DataFrame(columns), stated) for key, columns in topics.items()]


def _flatten(flat: dict[str, np.ndarray], name: str, value: Any) -> None:
    if isinstance(value, Mapping):
        for key, part in value.items():
            _flatten(flat, f"{name}.{key}" if name else str(key), part)
        return
    if isinstance(value, list) and value and any(isinstance(part, (Mapping, list, np.ndarray)) for part in value):
        for index, part in enumerate(value[:LONGEST_ARRAY]):
            _flatten(flat, f"{name}[{index}]", part)
        return
    values = np.asarray(value)
    if values.dtype.names:
        _flatten(flat, name, {field: values[field] for field in values.dtype.names})
        return
    if values.dtype.kind not in "biuf" or values.ndim not in (1, 2):
        return
    if values.ndim == 2:
        # MATLAB's vectors are rows or columns; a time-series is longer than it is wide.
        values = values.T if values.shape[0] < values.shape[1] else values
        if values.shape[1] > LONGEST_ARRAY:
            return
        values = values[:, 0] if values.shape[1] == 1 else values
    if len(values) >= SHORTEST:
        flat[name] = values
