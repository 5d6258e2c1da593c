"""The brush car behind a simulator file: the same motion as its own rows have, and forces that act as they should."""

from pathlib import Path

import numpy as np
import pytest

from drift_drake.car.car_file import read_simulator_car
from drift_drake.car.effects.magnitudes import Effects
from experiments.benchmarks.rows import advance, row_states
from experiments.other_worlds.brush_cars import BRUSH_CARS
from experiments.simulators.brush import FORCES, BrushFile, main, simulate

ROWS = 51
TURN = {"small": 0.05, "truck": 0.02, "electric": 0.02}


def rolled(name: str, torque: float, steering: float, **forces: float) -> dict[str, np.ndarray]:
    car = BRUSH_CARS[name]
    speed = 9.0 * np.sqrt((car.front_axle_distance + car.rear_axle_distance) / 2.5)
    inputs = {key: np.full((1, ROWS), forces.get(key, 0.0)) for key in FORCES}
    inputs |= {"steering": np.full((1, ROWS), steering), "torque": np.full((1, ROWS), torque)}
    start = {"r": np.zeros(1), "v_x": np.full(1, speed), "v_y": np.zeros(1), "omega_r": np.full(1, speed)}
    return {key: values[0] for key, values in simulate(start, inputs, 0.01, car.constants()._asdict()).items()}


@pytest.mark.parametrize("name", BRUSH_CARS)
def test_a_roll_out_is_the_motion_of_the_cars_own_rows(name: str) -> None:
    car, torque, steering = BRUSH_CARS[name], 0.3 * BRUSH_CARS[name].torque_max, TURN[name]
    found = rolled(name, torque, steering)
    names = row_states(car.constants())
    z = np.zeros(len(names))
    z[[1, 3]], z[names.index("front_slip")] = found["v_x"][0], -steering  # straight on, its wheels turned
    delta, tau = np.full(ROWS, steering), np.full(ROWS, torque)
    for row in range(ROWS - 1):
        z, _ = advance(z, row, delta, tau, car.constants(), Effects())
    last = np.array([found[key][-1] for key in ("v_x", "v_y", "r", "psi", "omega_r")])
    expected = [z[1] * np.cos(z[2]), z[1] * np.sin(z[2]), z[0], z[4], z[3]]
    np.testing.assert_allclose(last, expected, rtol=1e-4, atol=1e-6)


def test_forces_and_a_moment_act_on_the_body() -> None:
    car, plain = BRUSH_CARS["truck"], rolled("truck", 0.0, 0.0)
    pulled = rolled("truck", 0.0, 0.0, force_x=9000.0)
    effective = car.mass + car.rear_axle_inertia / car.wheel_radius**2
    assert pulled["v_x"][-1] - plain["v_x"][-1] == pytest.approx(0.5 * 9000.0 / effective, rel=0.03)
    time = 0.02  # before the tyres answer
    shoved = rolled("truck", 0.0, 0.0, force_y=3000.0)["v_y"]
    assert shoved[2] == pytest.approx(time * 3000.0 / car.mass, rel=0.1)
    turned = rolled("truck", 0.0, 0.0, yaw_moment=9000.0)["r"]
    assert turned[2] == pytest.approx(time * 9000.0 / car.yaw_inertia, rel=0.1)


def test_its_file_is_read_and_says_what_the_car_cannot_have(tmp_path: Path) -> None:
    main(BrushFile("small", tmp_path / "small.yaml"))
    car = read_simulator_car(tmp_path / "small.yaml")
    assert car.constants().by_name()["mass"] == BRUSH_CARS["small"].mass
    assert {"friction_level", "aero_drag", "gyro_bias"}.isdisjoint(car.simulator.lacking)
