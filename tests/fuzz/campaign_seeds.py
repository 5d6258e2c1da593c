"""Good inputs of every kind, which the campaign's trials spoil."""

import json
import shutil
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import yaml
from importing_bench import rows
from recorder_writers import DBC, write_frames, write_ulog, write_vbo, write_xrk
from small_recordings import small_recordings
from test_fuzz import ANSWER, CALIBRATION, CALIBRATION_BY_PREDICTION, MAPPING, NONE, UNKNOWN, VEHICLE

from drift_drake.car.double_track.parameters import CARS

LOG_ROWS = 450  # 4.5 s: enough to be judged
REPORT = {"mapping": {"trust": ["v"]}, "runs": [{"std": {"v": 0.1, "r": 0.01}}]}


def make_seeds(folder: Path) -> None:
    """Folders `recordings`, `mapping`, `report`, `log`, `vehicle`, `answer`, `calibration`, and two files."""
    structures = {
        "mapping": {
            "full": MAPPING,
            "small": {
                "clocks": {"logger": {"column": "time", "unit": "ms"}},
                "signals": {
                    "r": {"column": "yaw", "unit": "deg/s"},
                    "v": {"column": "speed", "unit": "km/h"},
                    "delta_cmd": {"column": "s", "unit": "mrad"},
                },
            },
        },
        "report": {"small": REPORT},
        "two_track": {
            "coupe": CARS["coupe"].to_dict(),
            "saloon": CARS["saloon"].to_dict() | {"effects": {"steering_lag": 0.05, "aero_drag": 0.2}},
        },
        "vehicle": {"coupe": VEHICLE, "plain": {k: v for k, v in VEHICLE.items() if k not in ("tyre", "effects")}},
    }  # fmt: skip
    for kind, found in structures.items():
        (folder / kind).mkdir(parents=True, exist_ok=True)
        for name, data in found.items():
            (folder / kind / f"{name}.yaml").write_text(yaml.safe_dump(data, sort_keys=False))
    for kind, answers in (
        ("answer", {"effect": ANSWER, "none": NONE, "unknown": UNKNOWN}),
        ("calibration", {"likelihood": CALIBRATION, "prediction": CALIBRATION_BY_PREDICTION}),
    ):
        (folder / kind).mkdir(exist_ok=True)
        for name, data in answers.items():
            (folder / kind / f"{name}.json").write_text(json.dumps(data))
    (folder / "log").mkdir(exist_ok=True)
    columns = {name: values[:LOG_ROWS] for name, values in rows(noise=1.0).items()}
    few = {name: columns[name] for name in ("t", "r", "v", "delta_cmd", "tau_cmd")}
    for name, table in (("full", columns), ("few", few)):
        text = np.column_stack(list(table.values()))
        np.savetxt(folder / "log" / f"{name}.csv", text, "%.6f", ",", header=",".join(table), comments="")
    lively = rows(noise=1.0)
    last = lively["t"][-1] + (lively["t"][1] - lively["t"][0])
    twice = {name: np.r_[values, values + (last if name == "t" else 0.0)] for name, values in lively.items()}
    text = np.column_stack(list(twice.values()))
    np.savetxt(folder / "log" / "long.csv", text, "%.6f", ",", header=",".join(twice), comments="")
    t = np.arange(0.0, 4.0, 0.02)
    wave = 30.0 * np.sin(3.0 * t)
    recording = np.column_stack([1e3 * t, wave, 40.0 + 0.0 * t, t, -np.deg2rad(wave), 10.0 * wave])
    np.savetxt(folder / "recording.csv", recording, "%.6f", ",", header="time,yaw,speed,stamp,g,s", comments="")
    _recordings(folder)


def _recordings(folder: Path) -> None:
    place = folder / "recordings"
    shutil.rmtree(place, ignore_errors=True)
    place.mkdir()
    small_recordings(place)
    t = 0.02 * np.arange(80)
    r, v, angle = 0.3 * np.sin(3.0 * t), 10.0 + t, 0.05 * np.cos(t)
    write_vbo(place / "lap.vbo", 36000.0 + t, 48.0 + 1e-5 * t, 11.0 + 1e-5 * t, v, 0.1 * t, r, angle)
    fields = {"timestamp": "uint64_t", "x": "float", "q": "float[4]"}
    write_ulog(
        place / "flight.ulg",
        {"rates": (fields, [(int(1e6 * a), b, 1.0, 0.0, 0.0, 0.0) for a, b in zip(t, r, strict=True)])},
    )
    write_xrk(place / "kart.xrk", [("Speed", 11, 20, [int(a) for a in v]), ("Yaw", 6, 20, [int(10 * a) for a in r])])
    (folder / "frames.dbc").write_text(DBC)
    if find_spec("can") and find_spec("cantools"):
        import cantools

        database = cantools.database.load_string(DBC)
        for name in ("frames.log", "frames.asc", "frames.blf", "frames.trc"):
            write_frames(place / name, database, 1.7e9 + t, np.degrees(r), 3.6 * v, np.degrees(angle))
    if find_spec("asammdf"):
        _mdf_of_texts(place / "texts.mf4", t)
    if find_spec("scipy"):
        import scipy.io

        signal = {"time": t, "signals": {"values": v, "dimensions": 1, "label": "speed"}}
        scipy.io.savemat(
            place / "simulink.mat", {"tout": t, "yout": np.column_stack([r, v]), "logs": {"speed": signal}}
        )
    (place / "refused.ld").write_bytes(b"\x40" + bytes(7) + b"\x01" * 8 + bytes(200))


def _mdf_of_texts(path: Path, t: np.ndarray) -> None:
    from asammdf import MDF, Signal

    raw = np.arange(len(t), dtype=np.uint16) * 100
    raw[5:8] = 65535
    states = {"val_0": 65535, "text_0": b"SNA", "default": None}
    with MDF(version="4.10") as file:
        file.append([
            Signal(raw, t, name="VehSpd", unit="km/h", conversion={**states, "default": {"a": 0.01, "b": 0.0}}),
            Signal(0.3 * np.sin(t), t, name="YawRate", unit="rad/s", invalidation_bits=raw % 500 == 0),
        ], acq_name="car")  # fmt: skip
        file.save(path)
