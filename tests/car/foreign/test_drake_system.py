"""A Drake Diagram as a simulator: the example's, against Drake's own simulation of it."""

import sys
from pathlib import Path

import numpy as np
import pytest
import yaml
from pydrake.systems.analysis import Simulator

from drift_drake.car.car_file import read_car
from drift_drake.car.foreign.asked import job_of, motion_of
from drift_drake.car.foreign.check import check_simulator
from drift_drake.car.foreign.pool import end_workers, roll_all
from drift_drake.car.foreign.rollouts import SimulatorError
from drift_drake.car.foreign.simulator_car import SimulatorCar

EXAMPLES = Path(__file__).parents[3] / "examples" / "simulators"


@pytest.fixture(scope="module", autouse=True)
def _ended():
    yield
    end_workers()


def example(name: str = "drake_car") -> SimulatorCar:
    car, _ = read_car(EXAMPLES / f"{name}.yaml")
    assert isinstance(car, SimulatorCar)
    return car


def test_it_moves_as_drake_moves_it() -> None:
    sys.path.insert(0, str(EXAMPLES))
    from drake_car import make, set_state

    car = example()
    t, start = 0.01 * np.arange(51), np.array([[0.1, 13.0, 0.0, 13.1, 0.0]])
    steering, torque = 0.04 * np.sin(3.0 * t), 50.0 + 0.0 * t
    (got,) = roll_all([job_of(car.constants(), 0.01, start, {"steering": steering[None], "torque": torque[None]})])
    found = motion_of(car.simulator, got, 0.01)[0]
    system = make(**car.constants().by_name())
    simulator = Simulator(system)
    context = simulator.get_mutable_context()
    system.GetInputPort("wrench").FixValue(context, np.zeros(3))
    for row in range(51):
        after = min(row + 1, 50)
        middle = [0.5 * (steering[row] + steering[after]), 50.0]
        system.GetInputPort("commands").FixValue(context, middle)
        if row == 0:
            set_state(system, context, dict(zip(("r", "v", "beta", "omega_r"), start[0], strict=False)))
            simulator.Initialize()
        own = system.GetOutputPort("state").Eval(context)[:4]
        assert np.allclose(found[row, :4], own, atol=1e-6)
        simulator.AdvanceTo(t[after])


def test_nothing_is_wrong_with_it() -> None:
    assert [one.sentence for one in check_simulator(example()).findings if one.grade != "good"] == []


OF_STATE = {"v": "state[1]", "beta": "state[2]"}
MISTAKES = {
    "no input": ({"inputs": {"steering": "steer", "torque": "commands[1]"}}, r"has no input port steer; it has"),
    "no output": ({"outputs": OF_STATE | {"r": "yaw"}}, r"has no output port yaw; it has state, pose"),
    "no element": ({"outputs": OF_STATE | {"r": "state[9]"}}, r"output port state has 6 numbers, and none at 9"),
    "no state": ({"set_state": ""}, r"start value \w+ is no state; give continuous\[i\] or discrete\[i\]"),
    "no parameter": ({"parameters": {"weight": 1.0}, "meaning": {}, "unknown": {}}, r"unexpected keyword argument"),
    "no system": ({"drake": "drake_car:set_state"}, r"cannot be made with these parameters|no Drake System"),
}  # fmt: skip


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_in_its_file_is_one_sentence(tmp_path: Path, mistake: str) -> None:
    changes, said = MISTAKES[mistake]
    data = yaml.safe_load((EXAMPLES / "drake_car.yaml").read_text())
    data["simulator"] |= {"folder": str(EXAMPLES)} | changes
    path = tmp_path / "simulator.yaml"
    path.write_text(yaml.safe_dump(data))
    car, _ = read_car(path)
    assert isinstance(car, SimulatorCar)
    with pytest.raises(SimulatorError, match=said):
        check_simulator(car)


def test_states_are_set_by_their_place(tmp_path: Path) -> None:
    """A system without a `set_state`: the car alone, its state's first four numbers."""
    (tmp_path / "plain.py").write_text(
        "from drift_drake.car.parameters import VehicleParameters\n"
        "from drift_drake.car.single_track.plant import VehiclePlant\n\n\n"
        "def make(mass):\n    return VehiclePlant(VehicleParameters(mass=mass))\n"
    )
    data = yaml.safe_load((EXAMPLES / "drake_car.yaml").read_text())
    names = {"r": 0, "v": 1, "beta": 2, "omega_r": 3}
    data["simulator"] = {
        "drake": "plain:make", "inputs": {"steering": "actuation[0]", "torque": "actuation[1]"},
        "outputs": {name: f"state[{i}]" for name, i in names.items()}, "parameters": {"mass": 1650.0},
        "start": {name: f"continuous[{i}]" for name, i in names.items()}, "meaning": {"mass": "mass"},
    }  # fmt: skip
    path = tmp_path / "simulator.yaml"
    path.write_text(yaml.safe_dump(data))
    found = check_simulator(read_car(path)[0])  # type: ignore[arg-type]
    assert [one.sentence for one in found.findings if one.grade != "good"] == []


@pytest.mark.parametrize("name", ["four_wheels", "mujoco_car", pytest.param("commonroad_car", marks=pytest.mark.slow)])
def test_nothing_is_wrong_with_the_other_examples(name: str) -> None:
    needs = {"mujoco_car": "mujoco", "commonroad_car": "vehiclemodels"}
    if name in needs:
        pytest.importorskip(needs[name])
    assert [one.sentence for one in check_simulator(example(name)).findings if one.grade != "good"] == []
