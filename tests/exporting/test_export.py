"""Exports read back by the tools that they are for, and the command's words."""

import math

import numpy as np
import pytest
import yaml

from drift_drake.cli import main
from drift_drake.exporting.vehicles import commonroad_data, mjcf
from drift_drake.logs.importing.formats.files import read_topics
from drift_drake.logs.table import read_run, write_run
from drift_drake.vehicle.effects import Effects, make_effects
from drift_drake.vehicle.parameters import VehicleParameters
from drift_drake.vehicle.vehicle_file import write_vehicle


@pytest.fixture
def folder(stiffness_case, tmp_path):
    for index, run in enumerate(stiffness_case[1][:2]):
        write_run(run, tmp_path / "logs" / f"run_{index}.csv")
    return tmp_path


def test_parquet_comes_back_with_its_units(folder):
    pq = pytest.importorskip("pyarrow.parquet", reason="Parquet is an extra: pip install 'drift_drake[parquet]'")
    assert main(["export", str(folder / "logs"), "--format", "parquet", "--out", str(folder / "out")]) == 0
    before, after = (read_run(folder / name) for name in ("logs/run_1.csv", "out/run_1.parquet"))
    np.testing.assert_array_equal(after.r, before.r)
    assert pq.read_schema(folder / "out" / "run_1.parquet").field("r").metadata == {b"unit": b"rad/s"}


def test_mcap_comes_back_and_its_pose_turns_with_the_car(folder):
    pytest.importorskip("mcap", reason="MCAP is an extra: pip install 'drift_drake[ros]'")
    out = folder / "run.mcap"
    assert main(["export", str(folder / "logs" / "run_0.csv"), "--format", "mcap", "--out", str(out)]) == 0
    run = read_run(folder / "logs" / "run_0.csv")
    topics = {topic.name: topic.table for topic in read_topics(out)}
    assert set(topics) == {"/state", "/command", "/pose"}
    np.testing.assert_array_equal(topics["/state"]["/state.r"], run.r)
    np.testing.assert_array_equal(topics["/command"]["/command.delta_cmd"], run.delta_cmd)
    half = [topics["/pose"][f"/pose.pose.orientation.{axis}"] for axis in "zw"]
    np.testing.assert_allclose(2.0 * np.arctan2(*half), run.psi, atol=1e-9)


def test_commonroad_reads_the_file_and_turns_alike(tmp_path):
    pytest.importorskip("vehiclemodels", reason="CommonRoad's models are an extra: pip install 'drift_drake[worlds]'")
    from omegaconf import OmegaConf
    from vehiclemodels.vehicle_dynamics_st import vehicle_dynamics_st
    from vehiclemodels.vehicle_parameters import VehicleParameters as CommonRoad

    car = VehicleParameters()
    path = tmp_path / "commonroad.yaml"
    write_vehicle(tmp_path / "car.yaml", car, make_effects({"mass_error": 0.1}))
    assert main(["export", str(tmp_path / "car.yaml"), "--format", "commonroad", "--out", str(path)]) == 0
    read = OmegaConf.to_object(OmegaConf.merge(OmegaConf.structured(CommonRoad), OmegaConf.load(path)))
    assert read.m == pytest.approx(1.1 * car.mass)
    assert yaml.safe_load(path.read_text())["I_z"] == car.yaw_inertia
    # A car with as much stiffness per load at both axles: its yaw acceleration at a small steering angle.
    balanced = car.replace(front_stiffness=car.rear_axle_distance * 1e5, rear_stiffness=car.front_axle_distance * 1e5)
    same = OmegaConf.to_object(
        OmegaConf.merge(OmegaConf.structured(CommonRoad), OmegaConf.create(commonroad_data(balanced, Effects())))
    )
    same.steering.v_min = same.steering.v_max = 0.0
    same.longitudinal.v_min, same.longitudinal.v_max, same.longitudinal.v_switch = -10.0, 50.0, 50.0
    rates = vehicle_dynamics_st([0.0, 0.0, 0.01, 15.0, 0.0, 0.0, 0.0], [0.0, 0.0], same)
    expected = balanced.front_axle_distance * balanced.front_stiffness * 0.01 / balanced.yaw_inertia
    assert rates[5] == pytest.approx(expected, rel=1e-6)


def test_mujoco_loads_the_model_which_weighs_and_drives_as_the_file_says():
    mujoco = pytest.importorskip("mujoco", reason="no MuJoCo on this machine: pip install mujoco")
    car = VehicleParameters()
    model = mujoco.MjModel.from_xml_string(mjcf(car, Effects()))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    body = model.body("car").id
    assert model.body_subtreemass[body] == pytest.approx(car.mass)
    np.testing.assert_allclose(data.subtree_com[body][:2], 0.0, atol=1e-9)
    yaw = 0.0
    for i in range(body, model.nbody):
        frame = data.ximat[i].reshape(3, 3)
        yaw += (frame @ np.diag(model.body_inertia[i]) @ frame.T)[2, 2]
        yaw += model.body_mass[i] * float(np.sum(data.xipos[i, :2] ** 2))
    assert yaw == pytest.approx(car.yaw_inertia, rel=1e-6)
    data.ctrl[:] = [0.05, 100.0]
    for _ in range(1000):
        mujoco.mj_step(model, data)
    # Forward by the engine's torque, rotating parts taken along; to the left by the steering.
    rolling = (
        car.mass + (car.rear_axle_inertia + 2.0 * 0.5 * 0.015 * car.mass * car.wheel_radius**2) / car.wheel_radius**2
    )
    assert math.hypot(*data.qvel[:2]) == pytest.approx(
        2.0 * 100.0 * car.gear_ratio / car.wheel_radius / rolling, rel=0.1
    )
    assert data.qvel[5] > 0.05


def test_the_command_says_what_it_leaves_out_and_what_is_wrong(folder, capsys):
    car = folder / "car.yaml"
    write_vehicle(car, VehicleParameters(), make_effects({"steering_delay": 0.05, "mass_error": 0.1}))
    assert main(["export", str(car), "--format", "mujoco", "--out", str(folder / "car.xml")]) == 0
    assert "mujoco has no place for steering_delay, left out" in capsys.readouterr().out
    assert main(["export", str(car), "--format", "mcap", "--out", str(folder / "a.mcap")]) == 2
    assert "is for logs" in capsys.readouterr().err
    assert main(["export", str(folder / "logs"), "--format", "mujoco", "--out", str(folder / "a.xml")]) == 2
    assert "is for a vehicle file" in capsys.readouterr().err
