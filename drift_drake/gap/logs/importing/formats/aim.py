"""AiM's .xrk and .xrz: channels that share their times are one topic."""

import contextlib
import io
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from drift_drake.gap.logs.importing.formats.topics import Topic

MILLISECOND = 1e-3  # [s]
KNOWN = {"GPS Latitude": "latitude", "GPS Longitude": "longitude", "GPS Speed": "v"}
# The reader differentiates course and speed for these: no sensor measured them.
DERIVED = ("GPS_InlineAcc", "GPS_LateralAcc", "GPS_Yaw_Rate")


def read_xrk(path: Path) -> list[Topic]:
    """All channels that hold numbers.

    Raises:
        ValueError: no such file, or no numbers; ImportError: `libxrk` is not installed; OSError.
    """
    from libxrk import ChannelMetadata

    log = _log(path)
    groups: dict[bytes, tuple[np.ndarray, dict[str, np.ndarray], dict[str, str]]] = {}
    left_out: dict[str, str] = {}
    for name, table in log.channels.items():
        times = table.column("timecodes").to_numpy()
        values = table.column(name).to_numpy()
        if name in DERIVED and "GPS Speed" in log.channels:
            left_out[name] = "derived from course and speed, not measured"
            continue
        if values.dtype.kind not in "biuf" or len(values) < 2:
            left_out[name] = "text" if len(values) else "no samples"
            continue
        _, columns, units = groups.setdefault(times.tobytes(), (times, {}, {}))
        columns[name] = values
        units[name] = ChannelMetadata.from_channel_table(table).units
    if not groups:
        raise ValueError("holds no channels with numbers")
    topics: list[Topic] = []
    for times, columns, units in groups.values():
        rate = f"aim_{1.0 / (MILLISECOND * max(float(np.median(np.diff(times))), 1.0)):.4g}Hz"
        same = sum(topic.name.split("#")[0] == rate for topic in topics)
        name = f"{rate}#{same + 1}" if same else rate
        clock = f"{name}.time"
        table = pd.DataFrame({clock: MILLISECOND * times.astype(float)} | columns)
        known = {column: KNOWN[column] for column in columns if column in KNOWN}
        topics.append(
            Topic(name, table, units | {clock: "s"}, clock=clock, known=known, left_out={} if topics else left_out)
        )
    return topics


def _log(path: Path) -> Any:
    """The log as `libxrk` reads it, whose notes on units that it does not know are no output of ours."""
    from libxrk import aim_xrk

    data = path.read_bytes()
    with contextlib.redirect_stdout(io.StringIO()):
        try:
            return aim_xrk(data)
        except ValueError:  # its older parser reads no file without satellites
            from libxrk._aim_xrk_rs import aim_xrk as parse

            return parse(data)
