"""A short recording in every format that is installed: files of a few kilobytes, most of them structure."""

import json
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pandas as pd

ROWS = 60


def columns() -> dict[str, np.ndarray]:
    t = 0.02 * np.arange(ROWS)
    return {"time": t, "yaw_rate": 0.3 * np.sin(3.0 * t), "speed": 10.0 + t, "steering_angle": 0.05 * np.cos(t)}


def _csv(path: Path) -> None:
    pd.DataFrame(columns()).to_csv(path, index=False)


def _parquet(path: Path) -> None:
    pd.DataFrame(columns()).to_parquet(path)


def _npz(path: Path) -> None:
    np.savez(path, **columns())


def _mat(path: Path) -> None:
    import scipy.io

    scipy.io.savemat(path, {"imu": columns()})


def _hdf5(path: Path) -> None:
    import h5py

    with h5py.File(path, "w") as file:
        for name, values in columns().items():
            file[f"imu/{name}"] = values


def _mdf(path: Path) -> None:
    from asammdf import MDF, Signal

    t, *_ = signals = list(columns().values())
    with MDF(version="4.10") as file:
        file.append([Signal(v, t, name=name) for name, v in zip(columns(), signals, strict=True)], acq_name="imu")
        file.save(path)


def _mcap(path: Path) -> None:
    from mcap.writer import Writer

    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        schema = writer.register_schema(name="imu", encoding="jsonschema", data=b'{"type": "object"}')
        channel = writer.register_channel(topic="/imu", message_encoding="json", schema_id=schema)
        for row in pd.DataFrame(columns()).to_dict("records"):
            stamp = round(1e9 * row["time"])
            writer.add_message(channel, log_time=stamp, publish_time=stamp, data=json.dumps(row).encode())
        writer.finish()


def _bag(folder: Path) -> None:
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    typestore = get_typestore(Stores.ROS2_JAZZY)
    kind = "std_msgs/msg/Float64"
    with Writer(folder, version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        connection = writer.add_connection("/yaw_rate", kind, typestore=typestore)
        for t, r in zip(columns()["time"], columns()["yaw_rate"], strict=True):
            writer.write(connection, round(1e9 * t), typestore.serialize_cdr(typestore.types[kind](data=r), kind))


WRITERS = {"csv": ("", _csv), "parquet": ("pyarrow", _parquet), "npz": ("", _npz), "mat": ("pymatreader", _mat),
           "h5": ("h5py", _hdf5), "mf4": ("asammdf", _mdf), "mcap": ("mcap", _mcap)}  # fmt: skip


def small_recordings(folder: Path) -> dict[Path, bytes]:
    """Files in a folder, one of each format, and their content."""
    out = {}
    for ending, (package, write) in WRITERS.items():
        if not package or find_spec(package):
            write(folder / f"drive.{ending}")
            out[folder / f"drive.{ending}"] = (folder / f"drive.{ending}").read_bytes()
    if find_spec("rosbags"):
        _bag(folder / "bag")
        out |= {path: path.read_bytes() for path in (folder / "bag").iterdir()}
    return out
