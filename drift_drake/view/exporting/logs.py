"""A run as Parquet with units, or as MCAP with JSON messages that Foxglove shows."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from drift_drake.car.log.table import COLUMNS, UNITS, Run
from drift_drake.common.safe_files import replacing

COMMANDS = ("delta_cmd", "tau_cmd")
NANOSECONDS = 1e9
NUMBER = {"type": "number"}
POSE = {  # foxglove.PoseInFrame
    "type": "object",
    "properties": {
        "timestamp": {"type": "object", "properties": {"sec": {"type": "integer"}, "nsec": {"type": "integer"}}},
        "frame_id": {"type": "string"},
        "pose": {
            "type": "object",
            "properties": {
                "position": {"type": "object", "properties": dict.fromkeys("xyz", NUMBER)},
                "orientation": {"type": "object", "properties": dict.fromkeys("xyzw", NUMBER)},
            },
        },
    },
}


def columns_of(run: Run) -> dict[str, np.ndarray]:
    """The columns that the run has, in the log format's order."""
    return {name: values for name in COLUMNS if (values := run.column(name)) is not None}


def write_parquet(run: Run, path: Path) -> None:
    """The run as a Parquet table; `drift-drake` reads it back, and each column's unit is in its metadata.

    Raises:
        ImportError: pyarrow is not installed.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    table = pa.Table.from_pandas(pd.DataFrame(columns_of(run)), preserve_index=False)
    fields = [field.with_metadata({"unit": UNITS[field.name]}) for field in table.schema]
    with replacing(path) as part:
        pq.write_table(table.cast(pa.schema(fields, table.schema.metadata)), part)


def write_mcap(run: Run, path: Path) -> None:
    """The run as MCAP: /state and /command in SI units, and /pose where positions and heading are known.

    Raises:
        ImportError: mcap is not installed.
    """
    from mcap.writer import Writer

    columns = columns_of(run)
    topics = {
        "/state": [name for name in columns if name not in ("t", *COMMANDS)],
        "/command": [name for name in COMMANDS if name in columns],
    }
    stamps = np.round(run.t * NANOSECONDS).astype(np.int64)
    with replacing(path) as part, part.open("wb") as stream:
        writer = Writer(stream)
        writer.start(profile="", library="drift_drake")
        channels = {topic: _channel(writer, topic, _schema(names)) for topic, names in topics.items()}
        posed = {"x", "y", "psi"} <= set(columns)
        if posed:
            channels["/pose"] = _channel(writer, "/pose", POSE, "foxglove.PoseInFrame")
        for row, stamp in enumerate(stamps):
            messages = {topic: {name: float(columns[name][row]) for name in names} for topic, names in topics.items()}
            if posed:
                messages["/pose"] = _pose(int(stamp), *(float(columns[name][row]) for name in ("x", "y", "psi")))
            for topic, message in messages.items():
                data = json.dumps(message).encode()
                writer.add_message(channels[topic], log_time=int(stamp), data=data, publish_time=int(stamp))
        writer.finish()


def _channel(writer: Any, topic: str, schema: dict[str, Any], name: str = "") -> int:
    number = writer.register_schema(
        name=name or f"drift_drake{topic.replace('/', '.')}", encoding="jsonschema", data=json.dumps(schema).encode()
    )
    return int(writer.register_channel(topic=topic, message_encoding="json", schema_id=number))


def _schema(names: list[str]) -> dict[str, Any]:
    return {"type": "object", "properties": {name: NUMBER | {"description": UNITS[name]} for name in names}}


def _pose(stamp: int, x: float, y: float, psi: float) -> dict[str, Any]:
    seconds, nanoseconds = divmod(stamp, int(NANOSECONDS))
    return {
        "timestamp": {"sec": seconds, "nsec": nanoseconds},
        "frame_id": "world",
        "pose": {
            "position": {"x": x, "y": y, "z": 0.0},
            "orientation": {"x": 0.0, "y": 0.0, "z": math.sin(0.5 * psi), "w": math.cos(0.5 * psi)},
        },
    }
