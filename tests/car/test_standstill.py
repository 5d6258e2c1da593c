"""A car that starts, stops and backs up: its speed is negative then, and its rates are smooth through zero."""

import numpy as np
import pytest
from plant_bench import simulated
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import LogVectorOutput, TrajectorySource
from pydrake.trajectories import PiecewisePolynomial
from scipy.integrate import solve_ivp

from drift_drake.car.brush.parameters import BrushParameters
from drift_drake.car.double_track.parameters import DoubleTrackParameters
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.equations_plant import EquationsPlant
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.single_track.motion import INPUTS, STATES, derivatives, linearize
from drift_drake.car.single_track.plant import VehiclePlant

STEERING = 0.1
TIMES = [0.0, 2.0, 4.5, 9.0]  # [s]
TORQUES = [60.0, 60.0, -60.0, -60.0]  # [N m]: starts, comes to a stop, backs up
ONE, TWO, BRUSH = VehicleParameters(), DoubleTrackParameters(), BrushParameters()


def there_and_back(plant):
    """States [12, rows] at 100 Hz of a car that starts from rest, stops and backs up in a turn."""
    builder = DiagramBuilder()
    builder.AddNamedSystem("plant", plant)
    commands = PiecewisePolynomial.FirstOrderHold(TIMES, np.array([[STEERING] * 4, TORQUES]))
    source = builder.AddNamedSystem("command", TrajectorySource(commands))
    builder.Connect(source.get_output_port(), plant.GetInputPort("actuation"))
    log = LogVectorOutput(plant.GetOutputPort("full_state"), builder, 0.01)
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    plant.set_initial(plant.GetMyMutableContextFromRoot(context), np.zeros(6), actuation=(STEERING, TORQUES[0]))
    simulated(diagram, context, TIMES[-1])
    return log.FindLog(context).data()


@pytest.mark.parametrize("plant", [VehiclePlant(ONE), VehiclePlant(ONE, Effects(tyre_relaxation=0.3)),
                                   EquationsPlant(TWO), EquationsPlant(BRUSH.replace(relaxation=0.1))],
                         ids=["nominal", "relaxing", "double track", "brush"])  # fmt: skip
def test_a_car_starts_stops_and_backs_up_on_one_circle(plant):
    states = there_and_back(plant)
    r, v, beta, omega_r = states[:4]
    assert np.isfinite(states).all()
    assert v.max() > 1.5
    assert v.min() < -1.5
    # Slowly, it turns as its geometry says, to either side of a standstill.
    slow = (np.abs(v) > 0.3) & (np.abs(v) < 1.5)
    assert np.unique(np.sign(v[slow])).tolist() == [-1.0, 1.0]
    wheelbase = ONE.front_axle_distance + ONE.rear_axle_distance
    np.testing.assert_allclose(r[slow] / v[slow], np.tan(STEERING) / wheelbase, rtol=0.1)
    assert np.abs(beta).max() < 0.2
    np.testing.assert_allclose(omega_r[slow], v[slow], atol=0.15)


def test_what_resists_the_motion_stops_a_car_that_rolls_either_way():
    effects = Effects(rolling_resistance=0.03, aero_drag=1.0, differential_yaw_moment=100.0)
    for sign in (1.0, -1.0):
        plant = VehiclePlant(ONE, effects)
        context = plant.CreateDefaultContext()
        plant.set_initial(context, [0.1, sign * 8.0, 0.0, sign * 8.0, 0.0, 0.0], actuation=(0.0, 0.0))
        plant.GetInputPort("actuation").FixValue(context, [0.0, 0.0])
        rates = plant.EvalTimeDerivatives(context).CopyToVector()
        assert rates[1] * sign == pytest.approx(-0.03 * ONE.gravity - 64.0 / ONE.mass, rel=0.02)
        assert rates[0] < 0.0


def test_motion_in_reverse_is_that_of_velocities_along_and_across_the_body():
    """An independent form of the same car: u_x, u_y in place of v and beta, which no standstill troubles."""

    def slips(u_x, u_y, r, omega_r):
        f_x = u_x * np.cos(STEERING) + (u_y + ONE.front_axle_distance * r) * np.sin(STEERING)
        f_y = -u_x * np.sin(STEERING) + (u_y + ONE.front_axle_distance * r) * np.cos(STEERING)
        rim = max(abs(omega_r), 0.5)
        return (0.0, f_y / max(abs(f_x), 0.5)), ((omega_r - u_x) / rim, (u_y - ONE.rear_axle_distance * r) / rim)

    def force(sigma, stiffness, load):
        length, peak = np.hypot(*sigma), ONE.friction * load
        if length < 1e-12:
            return 0.0, 0.0
        q = stiffness * length
        total = q - q**2 / (3 * peak) + q**3 / (27 * peak**2) if q < 3 * peak else peak
        return total * sigma[0] / length, -total * sigma[1] / length

    wheelbase = ONE.front_axle_distance + ONE.rear_axle_distance
    weight = ONE.mass * ONE.gravity

    def rates(t, z):
        r, u_x, u_y, omega_r = z
        front, rear = slips(u_x, u_y, r, omega_r)
        _, f_f = force(front, ONE.front_stiffness, weight * ONE.rear_axle_distance / wheelbase)
        f_x, f_r = force(rear, ONE.rear_stiffness, weight * ONE.front_axle_distance / wheelbase)
        torque = np.interp(t, TIMES, TORQUES)
        lateral = f_f * np.cos(STEERING)
        rim = (ONE.gear_ratio * torque - f_x * ONE.wheel_radius) * ONE.wheel_radius / ONE.rear_axle_inertia
        turn = (ONE.front_axle_distance * lateral - ONE.rear_axle_distance * f_r) / ONE.yaw_inertia
        return turn, (f_x - f_f * np.sin(STEERING)) / ONE.mass + r * u_y, (lateral + f_r) / ONE.mass - r * u_x, rim

    states = there_and_back(VehiclePlant(ONE))
    t = 0.01 * np.arange(states.shape[1])
    other = solve_ivp(rates, (0.0, t[-1]), np.zeros(4), "LSODA", t, rtol=1e-8, atol=1e-9).y
    r, v, beta, omega_r = states[:4]
    np.testing.assert_allclose(r, other[0], atol=2e-3)
    np.testing.assert_allclose(v * np.cos(beta), other[1], atol=2e-3)
    np.testing.assert_allclose(v * np.sin(beta), other[2], atol=2e-3)
    np.testing.assert_allclose(omega_r, other[3], atol=2e-3)


def test_jacobians_hold_in_reverse():
    x = np.array([-0.2, -3.0, 0.05, -3.2, 0.1, 0.02])
    u = np.array([0.1, -40.0])
    p = ONE.constants()
    _, a, b = linearize(x, u, 0.01, p)
    step = 1e-20j
    for j in range(len(STATES)):
        np.testing.assert_allclose(a[:, j], derivatives(x + step * np.eye(6)[j], u, 0.01, p).imag * 1e20, atol=1e-9)
    for j in range(len(INPUTS)):
        np.testing.assert_allclose(b[:, j], derivatives(x, u + step * np.eye(2)[j], 0.01, p).imag * 1e20, atol=1e-9)
