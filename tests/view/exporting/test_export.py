"""Exports read back by the tools that they are for, and the command's words."""

import math
import re

import numpy as np
import pytest
import yaml

from drift_drake.car.effects.magnitudes import Effects, make_effects
from drift_drake.car.log.table import read_run, write_run
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.vehicle_file import write_vehicle
from drift_drake.cli.main import main
from drift_drake.gap.logs.importing.formats.files import read_topics
from drift_drake.view.exporting.vehicles import commonroad_data, mjcf, write_commonroad


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
    for name in ("x", "y"):
        np.testing.assert_array_equal(topics["/pose"][f"/pose.pose.position.{name}"], getattr(run, name))
    assert not np.any(topics["/pose"]["/pose.pose.position.z"])
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


def test_commonroads_numbers_are_the_files():
    """By the names' definitions: the whole car's stiffness per load, acceleration by the weaker of engine and tyres."""
    car = VehicleParameters()
    weight = 1650.0 * 9.81
    stiffness = (1.4e5 + 2.2e5) / weight
    assert commonroad_data(car, Effects()) == {
        "l": pytest.approx(1.23 + 1.24 + 0.92 + 0.84), "w": pytest.approx(1.84),
        "steering": {"min": -0.66, "max": 0.66},
        "longitudinal": {"a_max": pytest.approx(450.0 * 10.6 / 0.337 / 1650.0)},
        "m": 1650.0, "a": 1.23, "b": 1.24, "I_z": 2350.0, "I_y_w": pytest.approx(10.0), "R_w": 0.337, "h_s": 0.0,
        "tire": {"p_dx1": 1.0, "p_dy1": 1.0, "p_kx1": pytest.approx(stiffness), "p_ky1": pytest.approx(-stiffness)},
    }  # fmt: skip
    strong = commonroad_data(car.replace(torque_max=2000.0, friction=0.7), Effects())
    assert strong["longitudinal"]["a_max"] == pytest.approx(0.7 * 9.81)


def test_commonroads_file_says_each_axles_stiffness_per_load_and_keeps_the_order(tmp_path):
    write_commonroad(VehicleParameters(), Effects(), tmp_path / "car.yaml")
    text = (tmp_path / "car.yaml").read_text()
    front, rear = (float(word) for word in re.findall(r"(\d+\.\d+)\s+at the", text))
    weight = 1650.0 * 9.81
    assert front == pytest.approx(1.4e5 / (weight * 1.24 / 2.47), rel=1e-3)
    assert rear == pytest.approx(2.2e5 / (weight * 1.23 / 2.47), rel=1e-3)
    assert [*yaml.safe_load(text)][:3] == ["l", "w", "steering"]


def test_mujocos_wheels_are_where_the_axles_are_and_spin_with_the_axles_inertia():
    mujoco = pytest.importorskip("mujoco", reason="no MuJoCo on this machine: pip install mujoco")
    car = VehicleParameters()
    model = mujoco.MjModel.from_xml_string(mjcf(car, Effects()))
    places = {name: model.body(name).pos for name in ("front_left", "front_right", "rear_left", "rear_right")}
    expected = {"front_left": (1.23, 0.78), "front_right": (1.23, -0.78), "rear_left": (-1.24, 0.78),
                "rear_right": (-1.24, -0.78)}  # fmt: skip
    for name, (x, y) in expected.items():
        # The centre of gravity is at one and a half wheel radii, a wheel's centre at one.
        np.testing.assert_allclose(places[name], [x, y, -0.5 * 0.337], atol=1e-6)
        assert model.body(name).mass[0] == pytest.approx(0.015 * 1650.0)
        spin = model.body(name).inertia
        disc = 0.5 * 0.015 * 1650.0 * 0.337**2
        assert spin == pytest.approx([0.6 * disc, disc, 0.6 * disc])
    axle = sum(model.dof_armature[model.joint(f"rear_{side}_spin").dofadr[0]] + disc for side in ("left", "right"))
    assert axle == pytest.approx(car.rear_axle_inertia, rel=1e-6)
    assert model.dof_armature[model.joint("front_left_spin").dofadr[0]] == 0.0
    np.testing.assert_allclose(model.actuator_ctrlrange, [[-0.66, 0.66], [-50.0, 450.0]])
    assert model.actuator("tau").gear[0] == 10.6
    body = model.body("car").inertia
    # A rigid body's, longer than wide, wider than high: none of the three is larger than the two others together.
    assert body[0] < body[1] < body[2] < body[0] + body[1]
    shell = model.geom("shell")
    np.testing.assert_allclose(2.0 * shell.size[:2], [1.23 + 1.24 + 0.92 + 0.84, 1.84], atol=1e-5)
    assert shell.pos[0] == pytest.approx(0.5 * (1.23 + 0.92 - 1.24 - 0.84))
    # The steering's servo turns a wheel alone at 105 rad/s, critically damped, whatever the car's size.
    servo = model.actuator("delta")
    assert -servo.biasprm[2] == pytest.approx(2.0 * np.sqrt(servo.gainprm[0] * 0.6 * disc), rel=1e-4)
    assert np.sqrt(servo.gainprm[0] / (0.6 * disc)) == pytest.approx(105.4, abs=0.1)
    flat = mujoco.MjModel.from_xml_string(mjcf(car.replace(friction=0.4), Effects()))
    assert flat.geom("ground").friction[0] == flat.geom("rear_left").friction[0] == 0.4


@pytest.mark.parametrize("car", [VehicleParameters(), VehicleParameters(front_axle_distance=1.7, yaw_inertia=2900.0)])
def test_mujoco_loads_the_model_which_weighs_and_drives_as_the_file_says(car):
    mujoco = pytest.importorskip("mujoco", reason="no MuJoCo on this machine: pip install mujoco")
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
