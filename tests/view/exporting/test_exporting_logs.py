"""Runs of made-up rows as Parquet and MCAP: columns, units, topics, stamps and poses."""

import json
from pathlib import Path

import numpy as np
import pytest

from drift_drake.car.log.table import COLUMNS, UNITS, Run
from drift_drake.view.exporting.logs import columns_of, write_mcap, write_parquet

ROWS = 60


def run_of(*left_out: str) -> Run:
    """From 1.26 s on at 100 Hz, every column another number; the heading turns past half a turn."""
    columns = {name: 0.05 * i + 0.01 * np.arange(ROWS) for i, name in enumerate(COLUMNS) if name not in left_out}
    columns |= {"t": 1.26 + 0.01 * np.arange(ROWS), "psi": 0.1 * np.arange(ROWS)} | (
        {"tau_cmd": np.full(ROWS, 90.0)} if "tau_cmd" not in left_out else {}
    )
    return Run("run_0", **{name: values for name, values in columns.items() if name not in left_out})


def test_columns_keep_the_formats_order_without_those_that_are_missing() -> None:
    run = run_of("beta", "x")
    assert [*columns_of(run)] == [name for name in COLUMNS if name not in ("beta", "x")]
    np.testing.assert_array_equal(columns_of(run)["r"], run.r)


def test_parquets_columns_have_their_units(tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet", reason="Parquet is an extra: pip install 'drift_drake[parquet]'")
    run = run_of("beta")
    write_parquet(run, tmp_path / "run.parquet")
    table = parquet.read_table(tmp_path / "run.parquet")
    assert table.column_names == [*columns_of(run)]
    for field in table.schema:
        assert field.metadata == {b"unit": UNITS[field.name].encode()}
        np.testing.assert_array_equal(table[field.name].to_numpy(), run.column(field.name))


@pytest.mark.parametrize("left_out", [(), ("psi", "tau_cmd"), ("x",)])
def test_mcap_has_a_message_of_each_topic_a_row(tmp_path: Path, left_out: tuple[str, ...]) -> None:
    """Positions without a heading, or the other way round, are no pose."""
    reader = pytest.importorskip("mcap.reader", reason="MCAP is an extra: pip install 'drift_drake[ros]'")
    run, found = run_of(*left_out), {}
    write_mcap(run, tmp_path / "run.mcap")
    with (tmp_path / "run.mcap").open("rb") as stream:
        for schema, channel, message in reader.make_reader(stream).iter_messages():
            assert message.log_time == message.publish_time
            found.setdefault(channel.topic, []).append((schema, message.log_time, json.loads(message.data)))
    assert set(found) == {"/state", "/command"} | ({"/pose"} if not left_out else set())
    stamps = [1_260_000_000 + 10_000_000 * row for row in range(ROWS)]
    for messages in found.values():
        assert [stamp for _, stamp, _ in messages] == stamps
    commands = [name for name in ("delta_cmd", "tau_cmd") if name not in left_out]
    states = [name for name in COLUMNS if name not in ("t", "delta_cmd", "tau_cmd", *left_out)]
    for topic, names in (("/state", states), ("/command", commands)):
        for row, (_, _, message) in enumerate(found[topic]):
            assert message == {name: run.column(name)[row] for name in names}
        schema = found[topic][0][0]
        properties = json.loads(schema.data)["properties"]
        assert {name: said["description"] for name, said in properties.items()} == {name: UNITS[name] for name in names}
        assert {said["type"] for said in properties.values()} == {"number"}
        assert schema.name == f"drift_drake{topic.replace('/', '.')}"


def test_a_pose_is_the_heading_as_a_quaternion_about_the_vertical(tmp_path: Path) -> None:
    reader = pytest.importorskip("mcap.reader", reason="MCAP is an extra: pip install 'drift_drake[ros]'")
    run = run_of()
    write_mcap(run, tmp_path / "run.mcap")
    with (tmp_path / "run.mcap").open("rb") as stream:
        poses = [(schema.name, json.loads(message.data))
                 for schema, _, message in reader.make_reader(stream).iter_messages(["/pose"])]  # fmt: skip
    for row, (name, pose) in enumerate(poses):
        assert name == "foxglove.PoseInFrame"
        assert pose["timestamp"] == {"sec": 1, "nsec": 260_000_000 + 10_000_000 * row}
        assert pose["frame_id"] == "world"
        assert pose["pose"]["position"] == {"x": run.x[row], "y": run.y[row], "z": 0.0}
        x, y, z, w = (pose["pose"]["orientation"][axis] for axis in "xyzw")
        assert (x, y) == (0.0, 0.0)
        # The first column of the rotation that a quaternion stands for: where the car's nose points.
        ahead = (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + z * w))
        assert ahead == pytest.approx((np.cos(run.psi[row]), np.sin(run.psi[row])))
    assert len(poses) == ROWS
