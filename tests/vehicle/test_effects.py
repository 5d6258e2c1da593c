"""The physical meaning of every effect of the catalogue, seen through Drake plants."""

import math

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import LogVectorOutput, TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from drift_drake.simulation.car import Car
from drift_drake.simulation.sensors import LOG_ROW, MEASURED_STATE, NoiseLevels
from drift_drake.vehicle.catalogue import CATALOGUE
from drift_drake.vehicle.effects import RATE_LIMIT_TIME, Effects, make_effects
from drift_drake.vehicle.parameters import VehicleParameters
from drift_drake.vehicle.path_plant import PLANT_STATES
from drift_drake.vehicle.plant import VehiclePlant

P = VehicleParameters()
WHEELBASE = P.front_axle_distance + P.rear_axle_distance
WEIGHT = P.mass * P.gravity
ROLLING_MASS = P.mass + P.rear_axle_inertia / P.wheel_radius**2  # the rear wheels' inertia moves along

# Speeds chosen so that nothing is at a floor.
COASTING = (0.0, 12.0, 0.0, 12.0, 0.0, 0.0)  # straight on, wheels rolling freely
WHEELSPIN = (0.0, 10.0, 0.0, 25.0, 0.0, 0.0)  # the rear axle slides forwards, the front rolls freely
SIDEWAYS = (0.0, 10.0, 0.5 * math.pi, 0.0, 0.0, 0.5 * math.pi)  # rear wheels locked: both axles slide to the left
DRIFTING = (0.7, 12.7, -0.6, 17.5, 0.0, 0.0)
HEAVY = P.replace(mass=1e9, yaw_inertia=1e9)  # a car on rails: forces show, motion does not change


def plant_of(effects, parameters=P):
    return VehiclePlant(parameters, make_effects(effects))


def at_rest_of(plant, state, actuation=(0.0, 0.0), wrench=None, memory=None, pose=None):
    """A Context of the plant in a state, its memory settled or as given."""
    context = plant.CreateDefaultContext()
    plant.set_initial(context, state, pose=pose, actuation=actuation)
    plant.GetInputPort("actuation").FixValue(context, np.array(actuation, dtype=float))
    if wrench is not None:
        plant.GetInputPort("disturbance").FixValue(context, np.array(wrench))
    for name, value in (memory or {}).items():
        context.get_mutable_continuous_state_vector()[plant.state_names.index(name)] = value
    return context


def rates_of(effects, state, actuation=(0.0, 0.0), parameters=P, **keywords):
    plant = plant_of(effects, parameters)
    context = at_rest_of(plant, state, actuation, **keywords)
    return plant.state_view(plant.EvalTimeDerivatives(context).CopyToVector())


def acceleration_of(effects, state, actuation=(0.0, 0.0), parameters=P, **keywords):
    plant = plant_of(effects, parameters)
    return plant.GetOutputPort("acceleration").Eval(at_rest_of(plant, state, actuation, **keywords))


def simulate(effects, state, duration, actuation=(0.0, 0.0), parameters=P, settled=None, **keywords):
    """(state, a_x, a_y) after `duration` under a constant actuation, the memory settled at `settled` before."""
    plant = plant_of(effects, parameters)
    context = at_rest_of(plant, state, actuation if settled is None else settled, **keywords)
    plant.GetInputPort("actuation").FixValue(context, np.array(actuation, dtype=float))
    simulator = Simulator(plant, context)
    simulator.get_mutable_integrator().set_target_accuracy(1e-8)
    simulator.AdvanceTo(duration)
    view = plant.state_view(context.get_continuous_state_vector().CopyToVector())
    return view, *plant.GetOutputPort("acceleration").Eval(context)


def driven_car(effects, commands, duration):
    """Logs at 100 Hz of a noiseless car: truth rows (full_state) and measured columns, under (t, delta, tau) rows."""
    builder = DiagramBuilder()
    car = builder.AddNamedSystem("car", Car(P, make_effects(effects), noise=NoiseLevels.none()))
    times, *columns = np.array(commands, dtype=float).T
    source = builder.AddNamedSystem("command", TrajectorySource(PiecewisePolynomial.FirstOrderHold(times, columns)))
    builder.Connect(source.get_output_port(), car.GetInputPort("command"))
    names = ("measured_state", "log_row", "state", "pose", "path_position", "acceleration")
    logs = {name: LogVectorOutput(car.GetOutputPort(name), builder, 0.001) for name in names}
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    car.plant.set_initial(car.plant.GetMyMutableContextFromRoot(context), COASTING)
    simulator = Simulator(diagram, context)
    simulator.get_mutable_integrator().set_target_accuracy(1e-9)
    simulator.AdvanceTo(duration)
    return {name: log.FindLog(context).data() for name, log in logs.items()}


def test_every_effect_has_its_test():
    assert tuple(CATALOGUE) == Effects._fields
    missing = [name for name in CATALOGUE if f"test_{name}" not in globals()]
    assert not missing


def test_names_that_are_not_in_the_catalogue():
    with pytest.raises(ValueError, match=r"unknown effect wind; the catalogue has friction_level, .*sensor_latency$"):
        make_effects({"wind": 1.0})


@pytest.mark.parametrize("coupling", [0.0, 0.7])
@pytest.mark.parametrize("state", [COASTING, WHEELSPIN, SIDEWAYS, DRIFTING])
def test_without_effects_it_is_the_nominal_car(state, coupling):
    car = VehicleParameters(front_coupling=coupling)
    bare, plant = VehiclePlant(car), VehiclePlant(car, make_effects({"mass_error": 0.1}))
    nominal = bare.EvalTimeDerivatives(at_rest_of(bare, state, (0.1, 120.0))).CopyToVector()
    context = at_rest_of(plant, state, (0.1, 120.0))
    context.get_mutable_numeric_parameter(1).SetFromVector(Effects())
    switched_off = plant.EvalTimeDerivatives(context).CopyToVector()[: len(PLANT_STATES)]
    np.testing.assert_allclose(switched_off, nominal[:], rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("name", CATALOGUE)
def test_a_small_magnitude_changes_little(name):
    """No effect jumps as it is switched on; those of the sensors and the delay leave the motion alone."""
    nominal = simulate({}, COASTING, 1.0, (0.05, 100.0))[0][:10]
    tiny = simulate({name: 1e-3 * CATALOGUE[name].high}, COASTING, 1.0, (0.05, 100.0))[0][:10]
    if name == "steering_rate_limit":  # a tiny rate limit is a stuck steering
        tiny = simulate({name: 1e4}, COASTING, 1.0, (0.05, 100.0))[0][:10]
    np.testing.assert_allclose(tiny, nominal, atol=0.02)


@pytest.mark.parametrize("q", [-0.3, 0.15])
def test_friction_level(q):
    """A car that slides sideways slows down by mu (1 + q) g."""
    view, _, a_y = simulate({"friction_level": q}, SIDEWAYS, 0.5)
    assert a_y == pytest.approx(-(1.0 + q) * P.gravity, rel=1e-9)
    assert view.v == pytest.approx(10.0 - 0.5 * (1.0 + q) * P.gravity, rel=1e-6)


@pytest.mark.parametrize("q", [-0.2, 0.1])
def test_front_rear_friction_split(q):
    """Sliding sideways, the axle with less grip runs ahead: a yaw moment -2 q mu m g a b / (a + b)."""
    rates = rates_of({"front_rear_friction_split": q}, SIDEWAYS)
    lever = 2.0 * P.front_axle_distance * P.rear_axle_distance / WHEELBASE
    assert rates.r == pytest.approx(-q * WEIGHT * lever / P.yaw_inertia, rel=1e-6)


@pytest.mark.parametrize("q", [-0.4, 0.4])
def test_front_stiffness_error(q):
    """A slight steering angle makes the force C_f (1 + q) delta."""
    _, a_y = acceleration_of({"front_stiffness_error": q}, COASTING, (1e-6, 0.0))
    assert a_y == pytest.approx(P.front_stiffness * (1.0 + q) * 1e-6 / P.mass, rel=1e-3)


@pytest.mark.parametrize("q", [-0.4, 0.4])
def test_rear_stiffness_error(q):
    """At a slight sideslip that the front wheels follow, only the rear axle makes a force."""
    state = (0.0, 12.0, 1e-6, 12.0, 0.0, 0.0)
    _, a_y = acceleration_of({"rear_stiffness_error": q}, state, (1e-6, 0.0))
    assert a_y == pytest.approx(-P.rear_stiffness * (1.0 + q) * 1e-6 / P.mass, rel=1e-3)


@pytest.mark.parametrize("v", [6.0, 18.0])
@pytest.mark.parametrize("distance", [0.3, 1.0])
def test_tyre_relaxation(v, distance):
    """After a step of steering the side force grows with the distance rolled, not with time: 1 - exp(-distance / q)."""
    q, delta = 0.6, 0.01
    state = (0.0, v, 0.0, v, 0.0, 0.0)
    rolled = distance / (v * math.cos(delta))
    _, _, a_y = simulate({"tyre_relaxation": q}, state, rolled, (delta, 0.0), HEAVY, settled=(0.0, 0.0))
    _, steady = acceleration_of({}, state, (delta, 0.0), HEAVY)
    assert a_y / steady == pytest.approx(1.0 - math.exp(-distance / q), rel=1e-4)


@pytest.mark.parametrize("v", [0.8, 9.0])
def test_tyre_relaxation_rolls_each_axle_at_its_own_speed(v):
    """d(slip)/dt = max(V_x, 1) / q * (slip of the contact - slip): steered and sliding, the axles' V_x differ."""
    q, beta, delta, omega_r = 0.6, 0.3, 0.5, 9.0
    rates = rates_of({"tyre_relaxation": q}, (0.0, v, beta, omega_r, 0.0, 0.0), (delta, 0.0),
                     memory={"front_slip": 0.0, "rear_slip": 0.0})  # fmt: skip
    front_slip = math.sin(beta - delta) / math.cos(beta - delta)
    assert rates.front_slip == pytest.approx(max(v * math.cos(beta - delta), 1.0) / q * front_slip, rel=1e-9)
    assert rates.rear_slip == pytest.approx(max(v * math.cos(beta), 1.0) / q * v * math.sin(beta) / omega_r, rel=1e-9)


def test_tyre_relaxation_leaves_longitudinal_slip_alone():
    state = (0.0, 12.0, 0.0, 12.5, 0.0, 0.0)
    a_x, _ = acceleration_of({"tyre_relaxation": 0.6}, state)
    assert a_x == pytest.approx(acceleration_of({}, state)[0], rel=1e-12)


@pytest.mark.parametrize("v", [1.5, 3.0, 10.0])
def test_sliding_friction_drop(v):
    """The faster a contact slides, the less it holds: by q (1 - 1/e) at 3 m/s."""
    q = 0.3
    state = (0.0, v, 0.5 * math.pi, 0.0, 0.0, 0.5 * math.pi)
    _, a_y = acceleration_of({"sliding_friction_drop": q}, state)
    assert a_y == pytest.approx(-P.gravity * (1.0 - q * (1.0 - math.exp(-v / 3.0))), rel=1e-9)


def test_tyre_thermal_fade():
    """Sliding turns kinetic energy into heat, heat takes grip, and is lost with a time constant of 12 s."""
    q = 0.4
    view, _, a_y = simulate({"tyre_thermal_fade": q}, SIDEWAYS, 0.2)
    lost = 0.5 * P.mass * (10.0**2 - view.v**2)
    heat = view.front_heat + view.rear_heat
    assert heat == pytest.approx(lost / 1e5, rel=0.2 / 12.0)
    assert heat < lost / 1e5
    grip = (
        P.rear_axle_distance * (1.0 - q * view.front_heat) + P.front_axle_distance * (1.0 - q * view.rear_heat)
    ) / WHEELBASE
    assert a_y == pytest.approx(-P.gravity * grip, rel=1e-6)

    cooled, _, _ = simulate({"tyre_thermal_fade": q}, COASTING, 6.0, memory={"front_heat": 1.0, "rear_heat": 0.5})
    assert cooled.front_heat == pytest.approx(math.exp(-6.0 / 12.0), rel=1e-6)
    assert cooled.rear_heat == pytest.approx(0.5 * math.exp(-6.0 / 12.0), rel=1e-6)


def test_longitudinal_load_transfer():
    """Under wheelspin the car accelerates by mu F_zr / m; a height q of the centre of gravity loads the rear axle."""
    q = 0.5
    _, a_x, _ = simulate({"longitudinal_load_transfer": q}, WHEELSPIN, 10.0 * 0.05, (0.0, 450.0))
    assert a_x == pytest.approx(P.gravity * P.front_axle_distance / (WHEELBASE - q), rel=1e-4)


def test_longitudinal_load_transfer_takes_load_off_the_front_axle():
    """While the car accelerates, the limit of the front axle is lower by m q a_x / (a + b)."""
    q, a_x = 0.5, 4.0
    state = (0.0, 10.0, 0.0, 10.0, 0.0, 0.0)
    # Steered to 1.2 rad the front slides at its limit; the rear axle rolls freely.
    forces = []
    for acceleration in (0.0, a_x):
        body = acceleration_of({"longitudinal_load_transfer": q}, state, (1.2, 0.0), memory={"a_x": acceleration})
        forces.append(P.mass * math.hypot(*body))
    assert forces[0] == pytest.approx(WEIGHT * P.rear_axle_distance / WHEELBASE, rel=1e-9)
    assert forces[0] - forces[1] == pytest.approx(P.mass * q * a_x / WHEELBASE, rel=1e-9)


def test_load_transfer_follows_the_accelerations_within_a_twentieth_of_a_second():
    """The filtered accelerations reach 1 - 1/e of a step after 0.05 s."""
    view, a_x, _ = simulate({"longitudinal_load_transfer": 0.01}, WHEELSPIN, 0.05, memory={"a_x": 0.0, "a_y": 0.0})
    assert view.a_x / a_x == pytest.approx(1.0 - math.exp(-1.0), rel=0.01)


def test_lateral_load_transfer():
    """Sliding sideways at y = |a_y| / g, the car holds mu (1 - q y^2)."""
    q = 0.25
    _, _, a_y = simulate({"lateral_load_transfer": q}, SIDEWAYS, 12.0 * 0.05)
    y = (math.sqrt(1.0 + 4.0 * q) - 1.0) / (2.0 * q)  # y = 1 - q y^2
    assert a_y == pytest.approx(-P.gravity * y, rel=1e-4)


@pytest.mark.parametrize("q", [-0.12, 0.2])
def test_mass_error(q):
    """A push on the body accelerates it by F / (m (1 + q))."""
    a_x, _ = acceleration_of({"mass_error": q}, COASTING, wrench=(1000.0, 0.0, 0.0))
    assert a_x == pytest.approx(1000.0 / (P.mass * (1.0 + q)), rel=1e-9)


@pytest.mark.parametrize("q", [-0.3, 0.4])
def test_yaw_inertia_error(q):
    """A moment on the body turns it by M / (I_z (1 + q))."""
    r_dot = rates_of({"yaw_inertia_error": q}, COASTING, wrench=(0.0, 0.0, 500.0)).r
    assert r_dot == pytest.approx(500.0 / (P.yaw_inertia * (1.0 + q)), rel=1e-9)


@pytest.mark.parametrize("q", [-0.12, 0.12])
def test_cg_shift(q):
    """The centre of gravity moves back: the rear axle carries more, and the front axle's lever grows."""
    a_x, _ = acceleration_of({"cg_shift": q}, WHEELSPIN)
    assert a_x == pytest.approx(P.gravity * (P.front_axle_distance + q) / WHEELBASE, rel=1e-9)
    r_dot = rates_of({"cg_shift": q}, COASTING, (1e-6, 0.0)).r
    lever = P.front_axle_distance + q
    assert r_dot == pytest.approx(lever * P.front_stiffness * 1e-6 / P.yaw_inertia, rel=1e-3)


@pytest.mark.parametrize("t", [0.05, 0.1, 0.3])
def test_steering_lag(t):
    """After a step of the command the road wheels, and the side force with them, follow as 1 - exp(-t / q)."""
    q, delta = 0.1, 0.02
    view, _, a_y = simulate({"steering_lag": q}, COASTING, t, (delta, 0.0), HEAVY, settled=(0.0, 0.0))
    reached = delta * (1.0 - math.exp(-t / q))
    assert view.steering == pytest.approx(reached, rel=1e-6)
    assert a_y == pytest.approx(acceleration_of({}, COASTING, (reached, 0.0), HEAVY)[1], rel=1e-4)


@pytest.mark.parametrize("q", [0.02, 0.033, 0.15])
def test_steering_delay(q):
    """From steady coasting, everything happens later by exactly q."""
    steering = [(0.0, 0.0, 0.0), (0.3, 0.0, 0.0), (0.4, 0.06, 0.0), (0.9, -0.03, 0.0), (2.0, 0.0, 0.0)]
    prompt = driven_car({}, steering, 1.4)["state"]
    late = driven_car({"steering_delay": q}, steering, 1.4)["state"]
    shift = round(q / 0.001)
    np.testing.assert_allclose(late[:4, shift:], prompt[:4, :-shift], atol=1e-6)
    assert np.abs(late[:4] - prompt[:4]).max() > 0.01


def test_steering_delay_leaves_the_torque_alone():
    driving = [(0.0, 0.0, 0.0), (0.3, 0.0, 200.0), (2.0, 0.0, 100.0)]
    prompt, late = (driven_car(effects, driving, 0.8)["state"] for effects in ({}, {"steering_delay": 0.1}))
    np.testing.assert_allclose(late, prompt, atol=1e-9)


def test_steering_rate_limit():
    """After a large step the road wheels turn at the rate q, then they stand where the command is."""
    q = 0.5
    effects = {"steering_rate_limit": q}
    for t in (0.1, 0.3, 0.5):
        view, _, _ = simulate(effects, COASTING, t, (0.3, 0.0), HEAVY, settled=(0.0, 0.0))
        assert view.steering == pytest.approx(q * t, rel=1e-6)
        view, _, _ = simulate(effects, COASTING, t, (-0.3, 0.0), HEAVY, settled=(0.0, 0.0))
        assert view.steering == pytest.approx(-q * t, rel=1e-6)
    view, _, _ = simulate(effects, COASTING, 0.6 + 10.0 * RATE_LIMIT_TIME, (0.3, 0.0), HEAVY, settled=(0.0, 0.0))
    assert view.steering == pytest.approx(0.3, abs=1e-4)


def test_steering_rate_limit_with_a_lag():
    """Both together: the lag's rate, held within the limit."""
    effects = {"steering_rate_limit": 0.5, "steering_lag": 0.1}
    assert rates_of(effects, COASTING, (0.3, 0.0), memory={"steering": 0.0}).steering == pytest.approx(0.5)
    assert rates_of(effects, COASTING, (0.3, 0.0), memory={"steering": 0.29}).steering == pytest.approx(0.1)


@pytest.mark.parametrize("q", [-0.03, 0.03])
def test_steering_offset(q):
    """The car drives as a straight one whose steering is turned by q."""
    crooked, _, _ = simulate({"steering_offset": q}, COASTING, 1.0, (0.01, 50.0))
    straight, _, _ = simulate({}, COASTING, 1.0, (0.01 + q, 50.0))
    np.testing.assert_allclose(crooked[:10], straight[:10], atol=1e-6)


@pytest.mark.parametrize("t", [0.1, 0.2, 0.6])
def test_torque_lag(t):
    """After a step of the command the engine's torque follows as 1 - exp(-t / q)."""
    q = 0.2
    plant_view, _, _ = simulate({"torque_lag": q}, COASTING, t, (0.0, 100.0), settled=(0.0, 0.0))
    reached = 100.0 * (1.0 - math.exp(-t / q))
    assert plant_view.torque == pytest.approx(reached, rel=1e-6)
    rates = rates_of({"torque_lag": q}, COASTING, (0.0, 100.0), memory={"torque": reached})
    assert rates.omega_r == pytest.approx(rates_of({}, COASTING, (0.0, reached)).omega_r, rel=1e-12)


@pytest.mark.parametrize("q", [-0.3, 0.2])
def test_torque_gain_error(q):
    """The car accelerates as if the torque were (1 + q) times what was commanded."""
    weak, _, _ = simulate({"torque_gain_error": q}, COASTING, 1.0, (0.02, 100.0))
    nominal, _, _ = simulate({}, COASTING, 1.0, (0.02, 100.0 * (1.0 + q)))
    np.testing.assert_allclose(weak[:10], nominal[:10], atol=1e-6)


@pytest.mark.parametrize("q", [-0.4, 0.8])
def test_drivetrain_inertia_error(q):
    """The freely rolling axle spins up by G tau / (I_w (1 + q))."""
    rim = rates_of({"drivetrain_inertia_error": q}, COASTING, (0.0, 100.0)).omega_r
    expected = P.gear_ratio * 100.0 / (P.rear_axle_inertia * (1.0 + q)) * P.wheel_radius
    assert rim == pytest.approx(expected, rel=1e-9)


def test_drivetrain_friction():
    """Coasting, the car and its wheels slow down together by q / R_w over their mass."""
    q = 200.0
    view, _, _ = simulate({"drivetrain_friction": q}, COASTING, 2.0)
    assert 12.0 - view.v == pytest.approx(2.0 * q / P.wheel_radius / ROLLING_MASS, rel=0.01)


def test_aero_drag():
    """Coasting, 1/v grows by q / m each second; in a drift the force opposes the course, not the body."""
    q = 2.0
    view, _, _ = simulate({"aero_drag": q}, COASTING, 3.0)
    assert 1.0 / view.v - 1.0 / 12.0 == pytest.approx(3.0 * q / ROLLING_MASS, rel=0.01)
    dragged, free = rates_of({"aero_drag": q}, DRIFTING), rates_of({}, DRIFTING)
    assert dragged.v - free.v == pytest.approx(-q * 12.7**2 / P.mass, rel=1e-9)
    assert dragged.beta == pytest.approx(free.beta, rel=1e-12)


def test_rolling_resistance():
    """The body is held back by q g, whatever its sideslip."""
    q = 0.04
    for state in (COASTING, DRIFTING):
        held, free = acceleration_of({"rolling_resistance": q}, state), acceleration_of({}, state)
        np.testing.assert_allclose(held - free, [-q * P.gravity, 0.0], rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("psi", [0.0, 1.0, math.pi, -2.0])
def test_road_grade(psi):
    """A coasting car loses g sin(q) along the fixed x axis, wherever it heads."""
    q = 0.05
    uphill, flat = (acceleration_of(effects, DRIFTING, pose=(0.0, 0.0, psi)) for effects in ({"road_grade": q}, {}))
    body = uphill - flat
    along_x = math.cos(psi) * body[0] - math.sin(psi) * body[1]
    along_y = math.sin(psi) * body[0] + math.cos(psi) * body[1]
    assert along_x == pytest.approx(-P.gravity * math.sin(q), rel=1e-9)
    assert along_y == pytest.approx(0.0, abs=1e-12)


def test_road_grade_slows_a_coasting_car():
    view, _, _ = simulate({"road_grade": 0.05}, COASTING, 2.0)
    assert 12.0 - view.v == pytest.approx(2.0 * P.gravity * math.sin(0.05) * P.mass / ROLLING_MASS, rel=0.01)


def test_differential_yaw_moment():
    """A moment -q r v resists turning."""
    q = 200.0
    locked, free = rates_of({"differential_yaw_moment": q}, DRIFTING), rates_of({}, DRIFTING)
    assert locked.r - free.r == pytest.approx(-q * 0.7 * 12.7 / P.yaw_inertia, rel=1e-9)
    assert locked.v == free.v


SLALOM = [(0.0, 0.0, 50.0), (0.2, 0.08, 150.0), (0.6, -0.08, 0.0), (1.0, 0.05, 100.0)]


def sensed(effects):
    """(measured - true) signals at the sampling times of a slalom, by name, and the true motion."""
    logs = driven_car(effects, SLALOM, 0.8)
    every = slice(0, None, 10)
    state, row = logs["measured_state"][:, every], logs["log_row"][:, every]
    truth = np.concatenate([logs["state"], logs["path_position"]])[:, every]
    pose, acceleration = logs["pose"][:, every], logs["acceleration"][:, every]
    row_truth = np.concatenate([pose, logs["state"][:4, every], acceleration])
    by_state = dict(zip(MEASURED_STATE, state - truth, strict=True))
    by_row = dict(zip(LOG_ROW[1:], row[1:] - row_truth, strict=True))
    return by_state, by_row, truth


def check_bias(effect, biased):
    by_state, by_row, truth = sensed({effect: 0.03})
    np.testing.assert_array_equal(truth, sensed({})[2])
    for errors in (by_state, by_row):
        for name, error in errors.items():
            np.testing.assert_allclose(error, 0.03 if name in biased else 0.0, atol=1e-12, err_msg=name)


def test_gyro_bias():
    check_bias("gyro_bias", {"r"})


def test_sideslip_bias():
    """The course that a car measures is its heading plus its sideslip, so it is biased too."""
    check_bias("sideslip_bias", {"beta", "dphi"})


def test_wheel_radius_error():
    by_state, by_row, truth = sensed({"wheel_radius_error": -0.04})
    np.testing.assert_array_equal(truth, sensed({})[2])
    for errors in (by_state, by_row):
        for name, error in errors.items():
            expected = -0.04 * truth[3] if name == "omega_r" else 0.0 * truth[3]
            np.testing.assert_allclose(error, expected, atol=1e-12, err_msg=name)


@pytest.mark.parametrize("q", [0.02, 0.037, 0.12])
def test_sensor_latency(q):
    """Every measured column at a sampling time is what was true q before; before the start, it stood still."""
    logs = driven_car({"sensor_latency": q}, SLALOM, 0.8)
    np.testing.assert_allclose(logs["state"], driven_car({}, SLALOM, 0.8)["state"], atol=1e-7)
    shift = round(q / 0.001)
    sampled = np.arange(0, logs["log_row"].shape[1], 10)
    came_from = np.maximum(sampled - shift, 0)
    truth = np.concatenate([logs["pose"], logs["state"][:4], logs["acceleration"]])[:, came_from]
    np.testing.assert_allclose(logs["log_row"][1:, sampled], truth, atol=1e-6)
    np.testing.assert_allclose(logs["log_row"][0, sampled], 0.001 * sampled, atol=1e-12)
    state = np.concatenate([logs["state"], logs["path_position"]])[:, came_from]
    np.testing.assert_allclose(logs["measured_state"][:, sampled], state, atol=1e-6)
