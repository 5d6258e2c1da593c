"""What a recorder's file holds: topics, each a table whose columns were read at the same ticks."""

import dataclasses
import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from pandas.api.types import is_numeric_dtype

from drift_drake.common.errors import DriftDrakeError

LONGEST_ARRAY = 64  # elements of an array within a message; longer ones (images, scans) are no signals
STAMP = ({"sec", "nanosec"}, {"secs", "nsecs"}, {"sec", "nsec"})
PIECE = 1e-9  # [s] of the second field of a stamp


class NeededError(DriftDrakeError, ValueError):
    """Something is not given that a file cannot be read without; the message says what."""


@dataclasses.dataclass(frozen=True)
class Topic:
    """Columns of n rows by full name (`/imu.angular_velocity.z`), and units as far as the file states them.

    first_line: the line of the file, from 1, where the rows begin; clock: the column of the rows' times, where the
    format says which one it is (else ""); known: quantities of the log (`latitude`, `course`) by the columns that the
    format says hold them; left_out: why, by name, of what the file holds and no column can; frame: of the format's
    signals (`ned`), where it says so.
    """

    name: str
    table: pd.DataFrame
    units: Mapping[str, str] = dataclasses.field(default_factory=dict)
    first_line: int = 2
    clock: str = ""
    known: Mapping[str, str] = dataclasses.field(default_factory=dict)
    left_out: Mapping[str, str] = dataclasses.field(default_factory=dict)
    frame: str = ""


def topics_of_messages(messages: Iterable[tuple[str, int, Any]]) -> list[Topic]:
    """The topics of messages: nested fields by dots, arrays by indices, a stamp in seconds.

    Args:
        messages: name of the topic, when it was logged [ns], and what it says: objects, mappings or numbers, nested.
    """
    rows: dict[str, list[dict[str, Any]]] = {}
    for name, time, message in messages:
        row: dict[str, Any] = {f"{name}.log_time": PIECE * time}
        _flatten(row, name, message)
        rows.setdefault(name, []).append(row)
    return [Topic(name, pd.DataFrame(rows[name]), {f"{name}.log_time": "s"}) for name in sorted(rows)]


def with_yaw(table: pd.DataFrame) -> pd.DataFrame:
    """The table with the yaw angle [rad] (about z) of each quaternion that it holds as `.x`, `.y`, `.z`, `.w`."""
    yaws = {}
    for column in table.columns:
        prefix = str(column).removesuffix(".w")
        parts = [f"{prefix}.{part}" for part in "xyzw"]
        if prefix != column and set(parts) <= set(table.columns) and all(map(is_numeric_dtype, table[parts].dtypes)):
            yaws[f"{prefix}.yaw"] = yaw_of(*(table[part].to_numpy(dtype=float) for part in parts))
    return table.assign(**yaws)


def yaw_of(x: np.ndarray, y: np.ndarray, z: np.ndarray, w: np.ndarray) -> np.ndarray:
    """Yaw angles [n] [rad] of quaternions."""
    return np.asarray(np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y**2 + z**2)))


def _flatten(row: dict[str, Any], name: str, value: Any) -> None:
    fields = _fields(value)
    if fields is not None:
        if any(set(fields) == names for names in STAMP):
            seconds, piece = fields.values()
            row[name] = float(seconds) + PIECE * float(piece)
            return
        for key, part in fields.items():
            _flatten(row, f"{name}.{key}", part)
    elif isinstance(value, (list, tuple, np.ndarray)):
        if len(value) <= LONGEST_ARRAY:
            for index, part in enumerate(value):
                _flatten(row, f"{name}[{index}]", part)
    elif isinstance(value, (bool, int, float, np.number, np.bool_)):
        row[name] = value


def _fields(value: Any) -> dict[str, Any] | None:
    """Fields of a nested message by name, None of a plain value."""
    if isinstance(value, Mapping):
        return {str(key): part for key, part in value.items()}
    if isinstance(value, (str, bytes, list, tuple, np.ndarray, np.generic, bool, int, float)) or value is None:
        return None
    if hasattr(value, "__slots__") and value.__slots__:
        return {name: getattr(value, name) for name in value.__slots__ if not name.startswith("_")}
    names = dataclasses.fields(value) if dataclasses.is_dataclass(value) else ()
    return {field.name: getattr(value, field.name) for field in names if not field.name.startswith("_")}


def read_mcap(path: Path) -> list[Topic]:
    """All topics whose messages can be decoded.

    Raises:
        ValueError: no message can be; ImportError: `mcap` is not installed; OSError.
    """
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    factory = DecoderFactory()  # type: ignore[no-untyped-call]
    decoders: dict[int, Any] = {}
    messages: list[tuple[str, int, Any]] = []
    unread: set[str] = set()
    with path.open("rb") as stream:
        for schema, channel, message in make_reader(stream).iter_messages():
            if channel.id not in decoders:
                json_read = channel.message_encoding == "json"
                decoders[channel.id] = (
                    json.loads if json_read else factory.decoder_for(channel.message_encoding, schema)
                )
            decode = decoders[channel.id]
            if decode is None:
                unread.add(f"{channel.topic} ({channel.message_encoding})")
                continue
            messages.append((channel.topic, message.log_time, decode(message.data)))
    if not messages:
        found = f"; its topics are {', '.join(sorted(unread))}" if unread else ""
        raise ValueError(f"holds no messages of ROS 2 (cdr) or JSON{found}")
    return topics_of_messages(messages)


def read_bag(path: Path) -> list[Topic]:
    """All topics whose message types are known.

    Raises:
        ValueError: no bag, or no message that can be read; ImportError: `rosbags` is not installed; OSError.
    """
    from rosbags.highlevel import AnyReader, AnyReaderError
    from rosbags.typesys import Stores, get_typestore

    try:
        # Of a ROS 2 bag one of the files in its folder may be given.
        bag = path.parent if path.suffix == ".db3" else path
        with AnyReader([bag], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
            known = [item for item in reader.connections if item.msgtype in reader.typestore.fielddefs]
            topics = topics_of_messages(
                (connection.topic, time, reader.deserialize(data, connection.msgtype))
                for connection, time, data in reader.messages(known)
            )
    except AnyReaderError as error:
        raise ValueError(str(error)) from None
    if not topics:
        raise ValueError("holds no messages of a known type; record the bag with its message definitions (MCAP)")
    return topics
