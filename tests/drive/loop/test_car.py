"""The car as one diagram: its ports, and that it is its parts."""

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator

from drift_drake.car.double_track.parameters import CARS
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.equations_plant import EquationsPlant
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.sensors import NoiseLevels
from drift_drake.car.single_track.plant import VehiclePlant
from drift_drake.drive.loop.car import Car
from drift_drake.drive.reference.path import Path

PARAMETERS = VehicleParameters()
EFFECTS = Effects(friction_level=-0.1, steering_delay=0.035, sensor_latency=0.02, gyro_bias=0.01)


def driven(car, duration, seed=0, command=(0.03, 80.0), s=4.0):
    context = car.CreateDefaultContext()
    car.plant.set_initial(car.plant.GetMyMutableContextFromRoot(context), (0.0, 12.0, 0.0, 12.0, 0.2, 0.0), s=s)
    car.sensors.set_seed(context, seed)
    car.GetInputPort("command").FixValue(context, np.array(command))
    Simulator(car, context).AdvanceTo(duration)
    return context


@pytest.mark.parametrize("effects", [Effects(), EFFECTS])
def test_ports_are_named(effects):
    car = Car(PARAMETERS, effects)
    inputs = [car.get_input_port(i) for i in range(car.num_input_ports())]
    outputs = [car.get_output_port(i) for i in range(car.num_output_ports())]
    assert {port.get_name(): port.size() for port in inputs} == {"command": 2, "disturbance": 3, "curvature": 1}
    assert {port.get_name(): port.size() for port in outputs} == {
        "measured_state": 7, "log_row": 10, "state": 6, "path_position": 1, "pose": 3, "acceleration": 2}  # fmt: skip


def test_without_effects_its_motion_is_the_plants():
    path = Path([0.0, 10.0, 60.0], [0.0, 0.03, -0.02])
    car, plant = Car(PARAMETERS, path=path), VehiclePlant(PARAMETERS, path=path)
    context = plant.CreateDefaultContext()
    plant.set_initial(context, (0.0, 12.0, 0.0, 12.0, 0.2, 0.0), s=4.0)
    plant.GetInputPort("actuation").FixValue(context, np.array([0.03, 80.0]))
    Simulator(plant, context).AdvanceTo(1.0)
    driven_context = driven(car, 1.0)
    for name in ("state", "path_position", "pose", "acceleration"):
        np.testing.assert_allclose(
            car.GetOutputPort(name).Eval(driven_context), plant.GetOutputPort(name).Eval(context), atol=1e-3
        )


def test_a_run_replays_to_the_bit_from_its_seed():
    car = Car(PARAMETERS, EFFECTS)
    rows = [car.GetOutputPort("log_row").Eval(driven(car, 0.5, seed)) for seed in (4, 4, 5)]
    np.testing.assert_array_equal(rows[0], rows[1])
    assert not np.any(rows[0][1:] == rows[2][1:])


def test_disturbance_and_curvature_reach_the_plant():
    car = Car(PARAMETERS, noise=NoiseLevels.none())
    context = driven(car, 0.0, command=(0.0, 0.0))
    still = car.GetOutputPort("acceleration").Eval(context).copy()
    car.GetInputPort("disturbance").FixValue(context, np.array([PARAMETERS.mass, 0.0, 0.0]))
    car.GetInputPort("curvature").FixValue(context, np.array([0.05]))
    np.testing.assert_allclose(car.GetOutputPort("acceleration").Eval(context) - still, [1.0, 0.0], atol=1e-12)
    plant_context = car.plant.GetMyContextFromRoot(context)
    s_dot = car.plant.EvalTimeDerivatives(plant_context).CopyToVector()[6]
    assert s_dot == pytest.approx(12.0 / (1.0 - 0.05 * 0.2))


def test_measurements_do_not_feed_the_command_through_but_in_their_accelerations():
    """A controller may close the loop over the measured state as long as it holds its plan."""
    car = Car(PARAMETERS)
    command = car.GetInputPort("command").get_index()
    through = [
        car.get_output_port(i).get_name() for i in range(car.num_output_ports()) if car.HasDirectFeedthrough(command, i)
    ]
    assert "acceleration" in through
    assert "state" not in through
    assert "pose" not in through


@pytest.mark.parametrize("effect", ["steering_delay", "sensor_latency"])
def test_a_delay_cannot_be_negative(effect):
    with pytest.raises(ValueError, match=rf"effects\.{effect} is -0\.1 s; no vehicle's"):
        Car(PARAMETERS, Effects(**{effect: -0.1}))


def test_another_plant_has_the_same_sensors():
    belief, path = CARS["roadster"].single_track(), Path([0.0, 10.0, 60.0], [0.0, 0.03, -0.02])
    rows = []
    for effects in (Effects(), Effects(gyro_bias=0.1)):
        plant = EquationsPlant(CARS["roadster"], effects, path)
        car = Car(belief, effects, noise=NoiseLevels.none(), plant=plant)
        context = driven(car, 0.15)
        assert car.plant is plant
        rows.append(car.GetOutputPort("log_row").Eval(context))
    assert rows[1][4] - rows[0][4] == pytest.approx(0.1)
    np.testing.assert_array_equal(rows[1][5:], rows[0][5:])
