"""A simulator file: what it says, and one sentence for each mistake in it."""

from pathlib import Path

import numpy as np
import pytest

from drift_drake.car.car_file import read_car, read_plant
from drift_drake.car.effects.magnitudes import Effects, make_effects
from drift_drake.car.equations import folded_into, kind_of
from drift_drake.car.foreign.simulator_car import SimulatorCar
from drift_drake.car.parameters import InvalidVehicleError
from drift_drake.car.vehicle_file import read_vehicle, stated_tolerances, vehicle_hash, write_vehicle
from tests.car.foreign.bicycle import DATA, written


def car_of(path: Path) -> SimulatorCar:
    car, _ = read_car(path)
    assert isinstance(car, SimulatorCar)
    return car


def test_it_is_read_back_with_other_parameters_and_effects(tmp_path: Path) -> None:
    car = car_of(written(tmp_path))
    changed, rest = folded_into(car.constants(), make_effects({"mass_error": 0.1, "cg_shift": 0.05, "gyro_bias": 0.01,
                                                               "torque_gain_error": -0.2}))  # fmt: skip
    assert rest == Effects(gyro_bias=0.01)
    other = tmp_path / "elsewhere" / "found.yaml"
    other.parent.mkdir()
    write_vehicle(other, car.with_constants(changed), rest)
    again, effects = read_car(other)
    assert effects == rest
    assert isinstance(again, SimulatorCar)
    values = again.constants().by_name()
    assert values["m"] == pytest.approx(1595.0)
    assert (values["lf"], values["lr"]) == pytest.approx((1.25, 1.25))
    assert again.single_track().mass == pytest.approx(1595.0)
    assert again.simulator.inputs["torque"].own(100.0) == pytest.approx(640.0)
    assert again.simulator.folder == car.simulator.folder
    assert vehicle_hash(again, effects) != vehicle_hash(car, effects)
    assert stated_tolerances(other) >= {"friction", "mass"}


def test_another_version_of_the_simulator_is_another_vehicle(tmp_path: Path) -> None:
    path = written(tmp_path)
    path.write_text(path.read_text().replace(str(Path(__file__).parent), str(tmp_path)))
    hashes = set()
    for text in ("one", "two", "two"):
        (tmp_path / "bicycle.py").write_text(f"# {text}\n")
        hashes.add(vehicle_hash(car_of(path), Effects()))
    assert len(hashes) == 2


def test_units_signs_ratios_and_offsets(tmp_path: Path) -> None:
    inputs = DATA["simulator"]["inputs"] | {"steering": {"name": "steer", "unit": "deg", "ratio": 15, "sign": -1}}
    outputs = DATA["simulator"]["outputs"] | {"omega_r": {"name": "w", "unit": "rpm"},
                                              "r": {"name": "r", "unit": "deg/s", "offset": 0.5}}  # fmt: skip
    simulator = car_of(written(tmp_path, inputs=inputs, outputs=outputs)).simulator
    assert simulator.inputs["steering"].own(0.1) == pytest.approx(-15.0 * np.degrees(0.1))
    assert simulator.outputs["omega_r"].si(300.0) == pytest.approx(0.32 * 300.0 * np.pi / 30.0)
    assert simulator.outputs["r"].si(10.5) == pytest.approx(np.radians(10.0))


def test_what_it_cannot_have_is_said_with_the_reason(tmp_path: Path) -> None:
    lacking = car_of(written(tmp_path)).simulator.lacking
    assert "aero_drag" not in lacking
    assert lacking["tyre_thermal_fade"] == "it is inside the simulator's equations"
    inputs = {key: DATA["simulator"]["inputs"][key] for key in ("steering", "torque")}
    meaning = {"mass": "m", "front_friction": "mu"}
    outputs = {key: value for key, value in DATA["simulator"]["outputs"].items() if key != "omega_r"}
    lacking = car_of(written(tmp_path, inputs=inputs, meaning=meaning, outputs=outputs)).simulator.lacking
    assert lacking["aero_drag"] == "no input force_x and force_y"
    assert lacking["differential_yaw_moment"] == "no input yaw_moment"
    assert lacking["yaw_inertia_error"] == "no parameter is said to be yaw_inertia"
    assert lacking["front_rear_friction_split"] == "no parameter is said to be rear_friction"
    assert lacking["wheel_radius_error"] == "no output omega_r"
    assert {"mass_error", "friction_level", "steering_lag", "torque_gain_error", "gyro_bias"}.isdisjoint(lacking)


def test_unknown_parameters_move_by_their_standard_deviations(tmp_path: Path) -> None:
    car = car_of(written(tmp_path, unknown={"soft": 0.3, "mu": {"deviation": 0.1}}))
    kind, constants = kind_of(car.constants()), car.constants()
    assert list(kind.deviations) == ["soft", "mu"]
    moved = kind.deviated(constants, {"soft": 1.0, "mu": -2.0}, Effects()).by_name()
    assert moved["soft"] == pytest.approx(0.02 * np.exp(0.3))
    assert moved["mu"] == pytest.approx(0.8)


BAD = {
    "no simulator": ({"python": None}, r"names 0 simulators; give one of python: MODULE:FUNCTION"),
    "two": ({"fmu": "car.fmu"}, r"names 2 simulators"),
    "no function": ({"python": "bicycle"}, r"simulator\.python: is 'bicycle'; give MODULE:FUNCTION"),
    "unknown key": ({"output_names": {}}, r"unknown key 'simulator\.output_names'; known keys are"),
    "no steering": ({"inputs": {"torque": "t"}}, r"inputs: steering is missing"),
    "no torque": ({"inputs": {"steering": "s"}}, r"inputs: torque is missing"),
    "unknown quantity": ({"inputs": {"stering": "s"}}, r"inputs: unknown quantity 'stering'; did you mean steering"),
    "other unit": ({"outputs": {"r": {"name": "r", "unit": "km/h"}}}, r"outputs\.r\.unit: 'km/h' is none of r; give"),
    "sign": ({"outputs": {"r": {"name": "r", "sign": 2}}}, r"outputs\.r\.sign: is 2; give 1 or -1"),
    "no sideslip": ({"outputs": {"r": "r", "v": "v"}}, r"outputs: r with v and beta, or r with v_x and v_y"),
    "no speed to set": ({"start": {"r": "r"}}, r"start: a window starts at the measured speed"),
    "needs a lead-in": ({"start": {"v": "vx"}}, r"start: r and the sideslip .* cannot be set; give lead_in: 0\.3"),
    "lead-in": ({"lead_in": 60}, r"simulator\.lead_in: is 60; give seconds, up to 5"),
    "step": ({"step": 0}, r"simulator\.step: is 0; give seconds"),
    "value": ({"parameters": {"m": "heavy"}}, r"parameters\.m: is 'heavy'; give a finite number"),
    "an effect's name": (
        {"parameters": {"aero_drag": 1.0}, "meaning": {}, "unknown": {"aero_drag": 0.1}},
        r"unknown\.aero_drag: is the name of an effect",
    ),
    "no such parameter": ({"meaning": {"mass": "M"}}, r"meaning\.mass: no parameter 'M'; (did you mean|choose from)"),
    "no such meaning": ({"meaning": {"weight": "m"}}, r"meaning: unknown quantity 'weight'"),
    "friction twice": ({"meaning": {"friction": "mu", "front_friction": "mu"}}, r"friction is of both axles"),
    "no spread": ({"unknown": {"m": -1}}, r"unknown\.m: is -1; give a standard deviation"),
    "share of zero": ({"parameters": {"a": 0.0}, "meaning": {}, "unknown": {"a": 0.1}}, r"a share of 0 is none"),
    "windows": ({"windows": -3}, r"simulator\.windows: is -3; give a whole number"),
    "one force": ({"inputs": {"steering": "s", "torque": "t", "force_x": "f"}}, r"force_x and force_y belong together"),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD)
def test_a_mistake_is_said_in_one_sentence_with_the_file_and_the_fix(tmp_path: Path, case: str) -> None:
    changes, said = BAD[case]
    path = written(tmp_path, **changes)
    with pytest.raises(InvalidVehicleError, match=said) as error:
        read_car(path)
    assert str(error.value).startswith(str(path))
    assert "\n" not in str(error.value)


def test_a_drive_asks_for_a_vehicle_file(tmp_path: Path) -> None:
    path = written(tmp_path)
    for read in (read_plant, read_vehicle):
        with pytest.raises(InvalidVehicleError, match=r"holds a simulator of yours, .*; give a vehicle file here"):
            read(path)
    path.write_text(path.read_text() + "effects: {tyre_thermal_fade: 0.1}\n")
    with pytest.raises(InvalidVehicleError, match=r"effects\.tyre_thermal_fade: the simulator cannot have it"):
        read_car(path)
