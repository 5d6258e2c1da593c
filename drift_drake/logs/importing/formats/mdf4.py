"""MDF files (ASAM MDF 3 and 4): each channel group is a topic with its master channel as `GROUP.time`."""

import gc
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from drift_drake.logs.importing.formats.topics import LONGEST_ARRAY, Topic


def read_mdf(path: Path) -> list[Topic]:
    """All channel groups that hold numbers.

    Raises:
        ValueError: no MDF, or no numbers; ImportError: `asammdf` is not installed; OSError.
    """
    import asammdf  # noqa: F401 (an ImportError is no damaged file)

    damaged = None
    try:
        topics = _topics(path)
    except Exception as error:  # of many classes
        damaged = str(error) or type(error).__name__
    if damaged is not None:
        _delete_silently()
        raise ValueError(damaged)
    if not topics:
        raise ValueError("holds no channels with numbers")
    return topics


def _delete_silently() -> None:
    """Deletes what asammdf leaves of a damaged file, which fails to close itself and would print a traceback."""
    hook = sys.unraisablehook
    sys.unraisablehook = lambda _: None
    try:
        gc.collect()
    finally:
        sys.unraisablehook = hook


def _topics(path: Path) -> list[Topic]:
    from asammdf import MDF

    topics: list[Topic] = []
    with MDF(path) as file:
        groups: list[Any] = file.groups
        for number, group in enumerate(groups):
            name = str(getattr(group.channel_group, "acq_name", "") or f"group_{number}")
            if any(topic.name == name for topic in topics):
                name = f"{name}_{number}"
            columns: dict[str, np.ndarray] = {}
            units: dict[str, str] = {}
            master = file.masters_db.get(number)
            for index in range(len(group.channels)):
                if index == master:
                    continue
                signal = file.get(group=number, index=index)
                parts = _parts(f"{name}.{signal.name}", np.asarray(signal.samples))
                columns |= parts | ({f"{name}.time": np.asarray(signal.timestamps, dtype=float)} if parts else {})
                units |= dict.fromkeys(parts, signal.unit or "")
            if columns:
                topics.append(Topic(name, pd.DataFrame(columns), units | {f"{name}.time": "s"}))
    return topics


def _parts(name: str, samples: np.ndarray) -> dict[str, np.ndarray]:
    """Columns of one channel: itself, or the elements of its arrays."""
    if samples.dtype.names:
        return {key: part for field in samples.dtype.names for key, part in _parts(name, samples[field]).items()}
    if samples.dtype.kind not in "biuf" or samples.ndim > 2 or (samples.ndim == 2 and samples.shape[1] > LONGEST_ARRAY):
        return {}
    if samples.ndim == 1:
        return {name: samples}
    return {f"{name}[{index}]": samples[:, index] for index in range(samples.shape[1])}
