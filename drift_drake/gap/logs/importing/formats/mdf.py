"""MDF 3 and 4: each channel group a topic, with a clock of its own."""

import dataclasses
import gc
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from drift_drake.car.log.numbers import as_numbers
from drift_drake.gap.logs.importing.formats.topics import LONGEST_ARRAY, Topic

DATA_FRAMES = "CAN_DataFrame"  # the channel of a group of raw frames that carry data
FRAMES = ("CAN_DataFrame", "CAN_RemoteFrame", "CAN_ErrorFrame", "CAN_OverloadFrame", "LIN_Frame")
SHOWN = 3  # texts in a sentence


def read_mdf(path: Path, databases: tuple[Path, ...] = ()) -> list[Topic]:
    """All channel groups that hold numbers; NaN where a sample is marked invalid, or a text stands for it.

    Args:
        databases: of raw CAN frames (DBC), which are decoded by them.

    Raises:
        ValueError: no MDF, or no numbers; ImportError: `asammdf` is not installed; OSError.
    """
    import asammdf  # noqa: F401 (an ImportError is no damaged file)

    damaged = None
    try:
        topics, frames = _topics(path)
    except Exception as error:  # of many classes
        damaged = str(error) or type(error).__name__
    if damaged is not None:
        _delete_silently()
        raise ValueError(damaged)
    if frames and (databases or not topics):
        from drift_drake.gap.logs.importing.formats.can_frames import read_mdf_frames

        topics += read_mdf_frames(path, databases)
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


def _topics(path: Path) -> tuple[list[Topic], bool]:
    """Topics of all groups with numbers, and whether raw CAN frames are there."""
    from asammdf import MDF

    topics: list[Topic] = []
    left_out: dict[str, str] = {}
    frames = False
    with MDF(path) as file:
        groups: list[Any] = file.groups
        for number, group in enumerate(groups):
            raw = next((name for channel in group.channels if (name := str(channel.name)) in FRAMES), None)
            frames = frames or raw == DATA_FRAMES
            if not group.channel_group.cycles_nr:
                continue
            if raw is not None:
                left_out[f"group_{number}"] = f"raw frames ({raw}), for --dbc to decode"
                continue
            name = str(getattr(group.channel_group, "acq_name", "") or f"group_{number}")
            if any(topic.name == name for topic in topics):
                name = f"{name}_{number}"
            topic = _group(file, number, name, left_out)
            if topic is not None:
                topics.append(topic)
    if topics and left_out:
        first = topics[0]
        topics[0] = dataclasses.replace(first, left_out=left_out)
    return topics, frames


def _group(file: Any, number: int, name: str, left_out: dict[str, str]) -> Topic | None:
    """The numbers of one channel group; None where it has none. What is left out is added to `left_out`."""
    columns: dict[str, np.ndarray] = {}
    units: dict[str, str] = {}
    time = f"{name}.time"
    master = file.masters_db.get(number)
    for index, channel in enumerate(file.groups[number].channels):
        full = f"{name}.{channel.name}"
        if index == master or full in columns:
            continue
        # Invalid samples keep their rows: taken out, a group's columns would be of several lengths.
        signal = file.get(group=number, index=index, raw=True, ignore_invalidation_bits=True)
        samples, reason = _numbers(signal)
        parts = {} if reason else _parts(full, samples)
        if not parts:
            left_out[full] = reason or "text or bytes"
            continue
        columns |= {time: np.asarray(signal.timestamps, dtype=float)} | parts
        units |= dict.fromkeys(parts, signal.unit or "")
    if not columns:
        return None
    return Topic(name, pd.DataFrame(columns), units | {time: "s"}, clock="" if master is None else time)


def _numbers(signal: Any) -> tuple[np.ndarray, str]:
    """Samples in their unit, NaN where one is marked invalid or a text stands for it; and why none is left, or ""."""
    samples, conversion = np.asarray(signal.samples), signal.conversion
    invalid = np.zeros(len(samples), dtype=bool)
    if signal.invalidation_bits is not None:
        invalid = np.asarray(signal.invalidation_bits, dtype=bool)
    texts: dict[float, str] = {}
    if conversion is not None:
        if samples.ndim == 1 and samples.dtype.kind in "biuf":
            texts = _texts(conversion, np.unique(samples))
            invalid = invalid | np.isin(samples, list(texts))
        samples = np.asarray(conversion.convert(samples, ignore_value2text_conversions=True))
    if texts and samples.dtype.kind == "O":
        samples = as_numbers(pd.Series(samples)).to_numpy(dtype=float)
    if invalid.any():
        samples = _without(samples, invalid)
    if not len(samples) or not invalid.all():
        return samples, ""
    some = ", ".join(list(dict.fromkeys(texts.values()))[:SHOWN])
    return samples, f"no number, only texts ({some})" if texts else "all samples are marked invalid"


def _without(samples: np.ndarray, invalid: np.ndarray) -> np.ndarray:
    """Samples as they are, those that are numbers as NaN where they are invalid."""
    if samples.dtype.names:
        kinds = [(name, float if samples[name].dtype.kind in "biuf" else samples[name].dtype, samples[name].shape[1:])
                 for name in samples.dtype.names]  # fmt: skip
        out = np.empty(len(samples), dtype=kinds)
        for name in samples.dtype.names:
            out[name] = _without(samples[name], invalid)
        return out
    if samples.dtype.kind not in "biuf":
        return samples
    out = samples.astype(float)
    out[invalid] = np.nan
    return out


def _texts(conversion: Any, raw: np.ndarray) -> dict[float, str]:
    """Texts that stand for some of a channel's raw values."""
    values = np.asarray(conversion.convert(raw, as_object=True))
    said = {
        value: text.decode("utf-8", "replace") if isinstance(text, bytes) else str(text)
        for value, text in zip(raw.tolist(), values.tolist(), strict=True)
        if isinstance(text, bytes | str)
    }
    return {value: text for value, text in said.items() if text.strip("\0 ")}


def _parts(name: str, samples: np.ndarray) -> dict[str, np.ndarray]:
    """Columns of one channel: itself, or the elements of its arrays; none where it has no numbers."""
    if samples.dtype.names:
        return {key: part for field in samples.dtype.names for key, part in _parts(name, samples[field]).items()}
    if samples.dtype.kind not in "biuf" or samples.ndim > 2 or (samples.ndim == 2 and samples.shape[1] > LONGEST_ARRAY):
        return {}
    if samples.ndim == 1:
        return {name: samples}
    return {f"{name}[{index}]": samples[:, index] for index in range(samples.shape[1])}
