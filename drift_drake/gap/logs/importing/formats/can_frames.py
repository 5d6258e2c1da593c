"""Raw CAN frames (candump, Vector's .asc and .blf, PEAK's .trc, MDF 4 of frames) by a database (DBC): each message a
topic, a column each signal. A value that the database gives a text for, such as "not available", is NaN."""

import dataclasses
import datetime
import itertools
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from drift_drake.gap.logs.importing.formats.topics import NeededError, Topic

HEADER = 20  # lines of an .asc that its header is looked for in
SHOWN = 5  # identifiers in a sentence
MULTIPLEXED = "the frames do not hold it"


class Frame(NamedTuple):
    """A data frame: time [s], channel of the recorder, identifier and whether it is extended (29 bits), payload."""

    time: float
    channel: str
    identifier: int
    extended: bool
    data: bytes


def read_can(path: Path, databases: Sequence[Path] = ()) -> list[Topic]:
    """All messages of a log of frames that the databases know.

    Raises:
        ValueError: no databases, none of their messages in the log, or a file that is none; ImportError: `python-can`
            or `cantools` is not installed; OSError.
    """
    import can

    ending = path.suffix.lower()
    if ending in (".blf", ".asc", ".trc"):
        # Absolute times of day, where the file has them, have the recorder's time zone: relative ones are sure.
        readers = {".blf": can.BLFReader, ".asc": can.ASCReader, ".trc": can.TRCReader}
        with readers[ending](str(path)) as reader:
            return topics_of_frames(_of_messages(reader, ending == ".asc" and _in_steps(path)), databases)
    with path.open(encoding="utf-8", errors="replace") as stream:
        return topics_of_frames(_of_candump(stream), databases)


def read_mdf_frames(path: Path, databases: Sequence[Path] = ()) -> list[Topic]:
    """All messages of an MDF 4 file's raw frames that the databases know; raises as `read_can`."""
    import can

    with can.MF4Reader(str(path)) as reader:
        return topics_of_frames(_of_messages(reader), databases)


def topics_of_frames(frames: Iterable[Frame], databases: Sequence[Path]) -> list[Topic]:
    """Topics of frames, by message; raises ValueError where no database knows any."""
    if not databases:
        raise NeededError("holds raw CAN frames, which say nothing without their database; add --dbc FILE.dbc")
    messages = _messages(databases)
    rows: dict[tuple[str, str], tuple[list[float], list[dict[str, Any]]]] = {}
    unknown: dict[int, int] = {}
    found: dict[tuple[int, bool], Any] = {}
    left_out: dict[str, str] = {}
    try:
        for frame in frames:
            key = (frame.identifier, frame.extended)
            if key not in found:
                found[key] = messages.get(key) or messages.get((frame.identifier, not frame.extended))
            message = found[key]
            if message is None or message.is_container:
                unknown[frame.identifier] = unknown.get(frame.identifier, 0) + 1
                continue
            times, values = rows.setdefault((message.name, frame.channel), ([], []))
            times.append(frame.time)
            values.append(_decoded(message, frame.data))
    except Exception as error:  # of many classes: a log that breaks off is read up to there
        if not rows:
            raise
        left_out["the end of the file"] = f"damaged ({(str(error) or type(error).__name__).splitlines()[0]})"
    if not rows:
        seen = ", ".join(f"0x{name:X}" for name in list(unknown)[:SHOWN])
        if not seen:
            raise ValueError("it holds no data frames")
        raise NeededError(
            f"none of its CAN frames is in {' or '.join(path.name for path in databases)}; it holds the identifiers "
            f"{seen}{', ...' if len(unknown) > SHOWN else ''}: give --dbc the database of this car's bus"
        )
    left_out |= {f"0x{name:X}": f"{count} frames, not in the database" for name, count in unknown.items()}
    by_name = {message.name: message for message in messages.values()}
    channels = {name: [channel for other, channel in rows if other == name] for name, _ in rows}
    topics = [
        _topic(by_name[name], f"{channel}.{name}" if len(channels[name]) > 1 else name, times, values)
        for (name, channel), (times, values) in rows.items()
    ]
    first = topics[0]
    topics[0] = dataclasses.replace(first, left_out=dict(first.left_out) | left_out)
    return topics


def _messages(databases: Sequence[Path]) -> dict[tuple[int, bool], Any]:
    """Messages of all databases by identifier, those of the first database first."""
    import cantools

    messages: dict[tuple[int, bool], Any] = {}
    for path in databases:
        try:
            database = cantools.database.load_file(str(path), strict=False)
        except OSError as error:
            raise ValueError(f"{path} cannot be read ({error.strerror})") from None
        except Exception as error:  # of many classes
            reason = (str(error) or type(error).__name__).splitlines()[0]
            raise ValueError(f"{path} is no CAN database that can be read ({reason})") from None
        for message in getattr(database, "messages", []):
            if hasattr(message, "frame_id"):
                messages.setdefault((message.frame_id, message.is_extended_frame), message)
    return messages


def _decoded(message: Any, data: bytes) -> dict[str, Any]:
    try:
        return dict(message.decode(data, allow_truncated=True))
    except Exception:  # a multiplexer's value that the database does not know, of several classes
        return {}


def _topic(message: Any, name: str, times: list[float], values: list[dict[str, Any]]) -> Topic:
    columns: dict[str, np.ndarray] = {f"{name}.time": np.array(times)}
    units, left_out = {f"{name}.time": "s"}, {}
    for signal in message.signals:
        full = f"{name}.{signal.name}"
        given = [row.get(signal.name) for row in values]
        numbers = np.array([value if isinstance(value, int | float) else np.nan for value in given], dtype=float)
        if np.isnan(numbers).all():
            texts = list(dict.fromkeys(str(value) for value in given if value is not None))
            left_out[full] = f"no number, only texts ({', '.join(texts[:SHOWN])})" if texts else MULTIPLEXED
            continue
        columns[full] = numbers
        units[full] = signal.unit or ""
    return Topic(name, pd.DataFrame(columns), units, clock=f"{name}.time", left_out=left_out)


def _in_steps(path: Path) -> bool:
    """Whether the times of an .asc are those since the line before."""
    with path.open(encoding="utf-8", errors="replace") as stream:
        return any("timestamps relative" in line.lower() for line in itertools.islice(stream, HEADER))


def _of_messages(reader: Iterable[Any], in_steps: bool = False) -> Iterator[Frame]:
    time = 0.0
    for message in reader:
        time = time + message.timestamp if in_steps else message.timestamp
        if not (message.is_error_frame or message.is_remote_frame):
            channel = "" if message.channel is None else f"can{message.channel}"
            yield Frame(time, channel, message.arbitration_id, message.is_extended_id, bytes(message.data))


def _of_candump(stream: Any) -> Iterator[Frame]:
    """Frames of candump's text, as it is written to a file or shown; lines that are none are passed over."""
    from cantools import logreader

    for frame in logreader.Parser(stream, tz=datetime.UTC):
        if frame.is_remote_frame:
            continue
        time = frame.timestamp
        if time is None:
            raise NeededError("holds CAN frames without times; record them with candump -l")
        if isinstance(time, datetime.timedelta):
            seconds = time.total_seconds()
        else:
            seconds = (time if time.tzinfo else time.replace(tzinfo=datetime.UTC)).timestamp()
        yield Frame(seconds, frame.channel, frame.frame_id & 0x1FFFFFFF, frame.is_extended_frame, frame.data)
