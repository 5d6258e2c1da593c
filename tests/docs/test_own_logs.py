"""A task by the page on own logs: recordings as MCAP and .mat, looked at, mapped, imported and diagnosed."""

import json

import numpy as np
import pandas as pd
import pytest

from drift_drake.car.effects.magnitudes import make_effects
from drift_drake.car.log.table import read_case
from drift_drake.car.vehicle_file import read_vehicle, write_vehicle
from drift_drake.cli.main import main

EPOCH = 1.7e9  # [s]
RATIO = 14.5
LAG = 0.1  # [s]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with the vehicle file and a drive of a car whose steering lags."""
    folder = tmp_path_factory.mktemp("stranger")
    assert main(["init", str(folder / "car.yaml")]) == 0
    write_vehicle(folder / "real.yaml", read_vehicle(folder / "car.yaml")[0], make_effects({"steering_lag": LAG}))
    drive = ["simulate", "slalom", "--vehicle", str(folder / "real.yaml"), "--out", str(folder / "truth.csv")]
    assert main([*drive, "--duration", "6"]) == 0
    return folder


def write_mcap(table, path):
    """An inertial unit at 100 Hz, and at 50 Hz the rest in the units of a car's bus."""
    writer_of = pytest.importorskip("mcap.writer", reason="MCAP is an extra: pip install 'drift_drake[formats]'").Writer
    with path.open("wb") as stream:
        writer = writer_of(stream)
        writer.start()
        channels = {}
        for topic in ("/imu", "/vehicle"):
            schema = writer.register_schema(name=topic, encoding="jsonschema", data=b'{"type": "object"}')
            channels[topic] = writer.register_channel(topic=topic, message_encoding="json", schema_id=schema)
        for index, row in enumerate(table.itertuples()):
            stamp = int((EPOCH + row.t) * 1e9)
            rates = {"angular_velocity": {"z": row.r}, "linear_acceleration": {"x": row.ax, "y": row.ay}}
            slow = {"speed_kmh": 3.6 * row.v, "slip_angle": row.beta, "rear_wheel_speed": row.omega_r,
                    "steering_wheel_deg": np.degrees(row.delta_cmd) * RATIO, "torque": row.tau_cmd}  # fmt: skip
            for topic, message in (("/imu", rates), ("/vehicle", slow))[: 2 - index % 2]:
                data = json.dumps(message).encode()
                writer.add_message(channels[topic], log_time=stamp, publish_time=stamp, data=data)
        writer.finish()


def write_mat(table, path):
    """A struct of arrays, angles in degrees."""
    pytest.importorskip("pymatreader", reason=".mat is an extra: pip install 'drift_drake[formats]'")
    from scipy.io import savemat

    log = {"time": table["t"], "yaw_rate_dps": np.degrees(table["r"]), "speed_kmh": 3.6 * table["v"],
           "sideslip_deg": np.degrees(table["beta"]), "wheel_speed_rear": table["omega_r"], "ay": table["ay"],
           "steering_angle_deg": np.degrees(table["delta_cmd"]), "torque": table["tau_cmd"]}  # fmt: skip
    savemat(path, {"log": {name: values.to_numpy() for name, values in log.items()}})


@pytest.fixture(scope="module", params=["mcap", pytest.param("mat", marks=pytest.mark.slow)])
def case(request, folder):
    """The recording's runs, imported by the mapping that the first look prints, corrected where it asks for it."""
    recording, mapping = folder / f"lap.{request.param}", folder / f"{request.param}.yaml"
    {"mcap": write_mcap, "mat": write_mat}[request.param](pd.read_csv(folder / "truth.csv"), recording)
    with pytest.MonkeyPatch.context() as patch:
        printed = []
        patch.setattr("builtins.print", lambda *words, **_: printed.append(words[0]))
        assert main(["import", "--look", str(recording)]) == 0
    text = printed[0]
    if "looks like the steering wheel's" in text:
        line = next(line for line in text.splitlines() if line.strip().startswith("delta_cmd:"))
        text = text.replace(line, line.replace("}", f", scale: {1.0 / RATIO}}}"))
    mapping.write_text(text)
    case = folder / request.param
    assert main(["import", str(recording), "--mapping", str(mapping), "--out", str(case)]) == 0
    return case


def test_the_runs_are_those_that_were_driven(case, folder):
    (run,), truth = read_case(case), pd.read_csv(folder / "truth.csv")
    for name, most in {"r": 1e-6, "delta_cmd": 2e-3, "v": 0.1, "beta": 0.02}.items():
        np.testing.assert_allclose(run.column(name), np.interp(run.t, truth["t"], truth[name]), atol=most)


def test_the_diagnosis_finds_what_the_simulator_lacks(case, folder, tmp_path):
    answer = tmp_path / "answer.json"
    command = ["diagnose", str(case), "--vehicle", str(folder / "car.yaml"), "--json", str(answer), "--quiet"]
    assert main([*command, "--effects", "steering_lag", "steering_delay", "mass_error"]) == 0
    data = json.loads(answer.read_text())
    assert data["causes"] == ["steering_lag"]
    assert data["magnitudes"]["steering_lag"]["estimate"] == pytest.approx(LAG, rel=0.05)
