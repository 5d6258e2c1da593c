"""Tables in long format, a row for each reading: a look maps them, and the drive comes back."""

import numpy as np
import pytest
from table_dialects import drive

from drift_drake.gap.logs.importing.formats.files import read_topics
from drift_drake.gap.logs.importing.importer import import_recordings
from drift_drake.gap.logs.importing.look import look
from drift_drake.gap.logs.importing.mapping import mapping_from_dict


@pytest.mark.parametrize("order", ["row by row", "signal by signal", "at their own times"])
@pytest.mark.parametrize("stated", ["column", "name"])
def test_a_row_for_each_reading(tmp_path, order, stated):
    """Long format: time, signal, value."""
    columns = drive()
    late = {"yaw_rate": 0.0, "speed": 0.003, "steering_angle": 0.006} if order == "at their own times" else {}
    readings = [
        (t + late.get(name, 0.0), name, unit, size * value)
        for name, key, unit, size in (
            ("yaw_rate", "r", "deg/s", np.degrees(1.0)),
            ("speed", "v", "km/h", 3.6),
            ("steering_angle", "delta_cmd", "rad", 1.0),
        )
        for t, value in zip(columns["t"], columns[key], strict=True)
    ]
    if order != "signal by signal":
        readings.sort(key=lambda reading: reading[0])
    texts = [
        f"{t:.3f};{name};{unit};{value:.7f}" if stated == "column" else f"{t:.3f};{name} [{unit}];;{value:.7f}"
        for t, name, unit, value in readings
    ]
    path = tmp_path / "long.csv"
    path.write_text("\n".join(["Timestamp;Signal;Unit;Value", *texts, "1.0;Gear;;D", "1.0;Timestamp;;1.0", ""]))
    found = look(path).mapping
    assert {key: line["unit"] for key, line in found["signals"].items()} == {
        "r": "deg/s",
        "v": "km/h",
        "delta_cmd": "rad",
    }
    (run,), _ = import_recordings([path], mapping_from_dict(found))
    inside = slice(50, -50)
    expected = np.interp(run.t + columns["t"][0], columns["t"], columns["r"])
    np.testing.assert_allclose(run.r[inside], expected[inside], atol=0.02)


def test_a_wide_table_with_a_column_of_texts_stays_as_it_is(tmp_path):
    columns = drive()
    lines = ["time,speed,gear,message"] + [
        f"{t:.2f},{v:.4f},D,ok" for t, v in zip(columns["t"], columns["v"], strict=True)
    ]
    (tmp_path / "wide.csv").write_text("\n".join(lines) + "\n")
    (topic,) = read_topics(tmp_path / "wide.csv")
    assert list(topic.table.columns) == ["time", "speed", "gear", "message"]
