"""PX4's .ulg: each message a topic, its instances too. North-east-down, angles and rates positive to the right."""

from pathlib import Path

import numpy as np
import pandas as pd

from drift_drake.gap.logs.importing.formats.topics import Topic, yaw_of

STAMP = "timestamp"
# Whole numbers of these fields are parts of a degree.
PARTS = {"lat": 1e-7, "lon": 1e-7}
POSITION = {"lat": "latitude", "lon": "longitude", "latitude_deg": "latitude", "longitude_deg": "longitude"}


def read_ulog(path: Path) -> list[Topic]:
    """All messages with two rows or more.

    Raises:
        ValueError: no ULog, or no messages; ImportError: `pyulog` is not installed; OSError.
    """
    from pyulog import ULog

    with path.open("rb") as stream:
        content = ULog(stream)
    several = {part.name for part in content.data_list if part.multi_id > 0}
    topics = []
    for part in content.data_list:
        if len(part.data.get(STAMP, ())) < 2:
            continue
        name = f"{part.name}_{part.multi_id}" if part.name in several else part.name
        columns, units, known = _columns(name, part.data)
        clock = f"{name}.{STAMP}"
        topics.append(Topic(name, pd.DataFrame(columns), units | {clock: "us"}, clock=clock, known=known, frame="ned"))
    if not topics:
        raise ValueError("holds no messages with rows")
    return topics


def _columns(name: str, data: dict[str, np.ndarray]) -> tuple[dict[str, np.ndarray], dict[str, str], dict[str, str]]:
    """Columns of a message by full name, their units, and which are positions."""
    columns, units, known = {}, {}, {}
    for field, values in data.items():
        full = f"{name}.{field}"
        columns[full] = values
        if field in POSITION:
            units[full], known[full] = "deg", POSITION[field]
            if values.dtype.kind in "iu":
                columns[full] = PARTS.get(field, 1.0) * values.astype(float)
    q = [data.get(f"q[{i}]") for i in range(4)]  # of the attitude: w, x, y, z
    if all(part is not None for part in q):
        w, x, y, z = (np.asarray(part, dtype=float) for part in q)
        columns[f"{name}.yaw"] = yaw_of(x, y, z, w)
        units[f"{name}.yaw"] = "rad"
    return columns, units, known
