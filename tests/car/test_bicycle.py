"""The single-track car against its specification's runs, the paper's Appendix A typed out, and the laws of motion."""

import math
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from pydrake.autodiffutils import ExtractGradient, ExtractValue, InitializeAutoDiff
from pydrake.symbolic import Expression, MakeVectorVariable

from drift_drake.car.compilation import compiled
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.single_track.motion import (
    derivatives,
    front_contact_velocity,
    front_slip,
    linearize,
    motion,
    path_rates,
    static_loads,
    world_rates,
)
from drift_drake.car.tyre import tyre_force

P = VehicleParameters().constants()
COUPLED = VehicleParameters(front_coupling=0.7).constants()
SPEC = Path(__file__).resolve().parents[3] / "shared" / "spec"

# (r, v, beta, omega_r, e, dphi), (delta, tau), curvature
POINTS = {
    "straight": ((0.0, 12.0, 0.0, 12.0, 0.0, 0.0), (0.0, 0.0), 0.0),
    "gripping": ((0.3, 11.0, -0.05, 11.2, 0.4, 0.1), (0.08, 60.0), 0.03),
    "drifting": ((0.71, 12.7, -0.6, 17.5, -0.3, -0.2), (-0.46, 168.0), 0.055),
    "braking": ((-0.5, 15.0, 0.2, 12.0, 1.0, 0.3), (-0.1, -50.0), -0.02),
    "spinning": ((2.0, 9.0, 1.3, 3.0, 0.2, 0.9), (0.6, 450.0), 0.05),
    "front slower than its floor": ((0.1, 0.4, 0.3, 2.0, 0.1, 0.1), (0.2, 30.0), 0.05),
    "rear slower than its floor": ((0.1, 3.0, 0.1, 0.2, 0.1, 0.1), (0.2, 30.0), 0.05),
    "all but standing": ((0.05, 0.06, 0.4, 0.1, 0.1, 0.1), (0.1, 5.0), 0.02),
}


def random_points(count, seed=0):
    rng = np.random.default_rng(seed)
    low, high = np.array([-1.5, 3.0, -1.0, 1.0, -2.0, -1.0]), np.array([1.5, 22.0, 1.0, 25.0, 2.0, 1.0])
    x = rng.uniform(low, high, (count, 6))
    u = rng.uniform([-0.66, -50.0], [0.66, 450.0], (count, 2))
    return x, u, rng.uniform(-0.06, 0.06, count)


def appendix_a(x, u, curvature):
    """Appendix A as printed (omega_r's row times R_w), with its own tyre."""
    p = VehicleParameters()
    a, b, m = p.front_axle_distance, p.rear_axle_distance, p.mass
    r, v, beta, omega_r, e, dphi = x
    delta, tau = u
    u_x, u_y = v * math.cos(beta), v * math.sin(beta)
    v_x = u_x * math.cos(delta) + (u_y + a * r) * math.sin(delta)
    v_y = -u_x * math.sin(delta) + (u_y + a * r) * math.cos(delta)

    def fiala(sigma_x, sigma_y, stiffness, load):
        sigma = math.hypot(sigma_x, sigma_y)
        if sigma == 0.0:
            return 0.0, 0.0
        q, limit = stiffness * sigma, p.friction * load
        force = q - q**2 / (3 * limit) + q**3 / (27 * limit**2) if q < 3 * limit else limit
        return force * sigma_x / sigma, -force * sigma_y / sigma

    weight = m * p.gravity
    _, f_yf = fiala(0.0, v_y / max(v_x, 0.5), p.front_stiffness, weight * b / (a + b))
    rolling = max(omega_r, 0.5)
    f_xr, f_yr = fiala((omega_r - u_x) / rolling, (u_y - b * r) / rolling, p.rear_stiffness, weight * a / (a + b))
    v_floor = max(v, 0.1)
    beta_dot = -r + (f_yf * math.cos(delta - beta) + f_yr * math.cos(beta) - f_xr * math.sin(beta)) / (m * v_floor)
    return [
        (a * f_yf * math.cos(delta) - b * f_yr) / p.yaw_inertia,
        (-f_yf * math.sin(delta - beta) + f_yr * math.sin(beta) + f_xr * math.cos(beta)) / m,
        beta_dot,
        (p.gear_ratio * tau - f_xr * p.wheel_radius) / p.rear_axle_inertia * p.wheel_radius,
        v * math.sin(dphi),
        beta_dot + r - curvature * v * math.cos(dphi) / (1 - curvature * e),
    ]


@pytest.mark.parametrize("name", POINTS)
def test_equations_are_appendix_a(name):
    x, u, curvature = POINTS[name]
    np.testing.assert_allclose(derivatives(x, u, curvature, P), appendix_a(x, u, curvature), rtol=1e-9, atol=1e-9)


def test_equations_are_appendix_a_at_random_points():
    x, u, curvature = random_points(300)
    expected = [appendix_a(*point) for point in zip(x, u, curvature, strict=True)]
    np.testing.assert_allclose(derivatives(x, u, curvature, P), expected, rtol=1e-9, atol=1e-9)


def test_a_coupled_front_axle_pulls_and_turns_with_the_rear_one():
    """Rims of one shaft on a straight: both axles slip alike, and the shaft bears both forces."""
    p = P._replace(front_coupling=1.0)
    v, omega_r, tau = 12.0, 12.5, 100.0
    load_front, load_rear = static_loads(p)
    slip = (omega_r - v) / omega_r
    front, _ = tyre_force(slip, 0.0, p.front_stiffness, p.friction * load_front, 0.0)
    rear, _ = tyre_force(slip, 0.0, p.rear_stiffness, p.friction * load_rear, 0.0)
    rates = motion(0.0, v, 0.0, omega_r, 0.0, tau, p)
    assert rates.a_x == pytest.approx((front + rear) / p.mass)
    wheel = (p.gear_ratio * tau - (front + rear) * p.wheel_radius) / p.rear_axle_inertia * p.wheel_radius
    assert rates.omega_r_dot == pytest.approx(wheel)


def test_without_coupling_the_front_rolls_freely_to_the_bit():
    x, u, _ = random_points(300, seed=6)
    v_x, v_y = front_contact_velocity(*x.T[:3], u.T[0], P.front_axle_distance)
    sigma_x, sigma_y = front_slip(v_x, v_y, x.T[3], P.front_coupling)
    assert not np.any(sigma_x)
    np.testing.assert_array_equal(sigma_y, v_y / np.maximum(v_x, 0.5))


def test_momentum_is_conserved_in_the_fixed_frame():
    """Newton's and Euler's laws for the tyre forces at the contact points, all written in world coordinates."""
    x, u, _ = random_points(100, seed=1)
    r, v, beta, omega_r = x.T[:4]
    delta, tau = u.T
    psi = np.linspace(-3.0, 3.0, 100)
    rates = motion(r, v, beta, omega_r, delta, tau, P)

    def rotated(angle, along, across):
        return np.array([np.cos(angle) * along - np.sin(angle) * across,
                         np.sin(angle) * along + np.cos(angle) * across])  # fmt: skip

    lever_front = rotated(psi, P.front_axle_distance, 0.0)
    lever_rear = rotated(psi, -P.rear_axle_distance, 0.0)
    velocity = rotated(psi + beta, v, 0.0)

    def contact_velocity(lever):
        return velocity + r * np.array([-lever[1], lever[0]])

    def in_frame(angle, vector):
        return rotated(-angle, *vector)

    front, rear = in_frame(psi + delta, contact_velocity(lever_front)), in_frame(psi, contact_velocity(lever_rear))
    load_front, load_rear = static_loads(P)
    f_front = tyre_force(0.0 * v, front[1] / np.maximum(front[0], 0.5), P.front_stiffness, P.friction * load_front, 0.0)
    rolling = np.maximum(omega_r, 0.5)
    f_rear = tyre_force((omega_r - rear[0]) / rolling, rear[1] / rolling, P.rear_stiffness, P.friction * load_rear, 0.0)
    force_front, force_rear = rotated(psi + delta, 0.0, f_front[1]), rotated(psi, *f_rear)

    acceleration = rotated(psi + beta, rates.v_dot, v * (rates.beta_dot + r))
    np.testing.assert_allclose(P.mass * acceleration, force_front + force_rear, rtol=1e-9, atol=1e-6)
    np.testing.assert_allclose(acceleration, rotated(psi, rates.a_x, rates.a_y), rtol=1e-9, atol=1e-9)
    moment = sum(
        lever[0] * force[1] - lever[1] * force[0]
        for lever, force in ((lever_front, force_front), (lever_rear, force_rear))
    )
    np.testing.assert_allclose(P.yaw_inertia * rates.r_dot, moment, rtol=1e-9, atol=1e-6)


@pytest.mark.parametrize("p", [P, COUPLED])
def test_energy_only_leaves_through_sliding_contact(p):
    x, u, _ = random_points(300, seed=2)
    r, v, beta, omega_r = x.T[:4]
    delta, tau = u.T
    rates = motion(r, v, beta, omega_r, delta, tau, p)
    omega, omega_dot = omega_r / p.wheel_radius, rates.omega_r_dot / p.wheel_radius
    body_power = p.mass * v * rates.v_dot + p.yaw_inertia * r * rates.r_dot
    lost = p.gear_ratio * tau * omega - body_power - p.rear_axle_inertia * omega * omega_dot
    # With floors out of play, a force opposes its contact's sliding, so it can only take energy.
    forwards = v * np.cos(beta - delta) + p.front_axle_distance * r * np.sin(delta) > 0.5
    assert forwards.sum() > 200
    assert np.all(lost[forwards] > 0.0)


def test_disturbance_is_a_force_in_the_body_frame():
    x, u, _ = POINTS["gripping"]
    free, disturbed = motion(*x[:4], *u, P), motion(*x[:4], *u, P, force_x=1650.0, force_y=-3300.0, moment=2350.0)
    assert disturbed.a_x - free.a_x == pytest.approx(1.0)
    assert disturbed.a_y - free.a_y == pytest.approx(-2.0)
    assert disturbed.r_dot - free.r_dot == pytest.approx(1.0)
    assert disturbed.omega_r_dot == free.omega_r_dot


def test_left_and_right_are_alike():
    x, u, curvature = random_points(50, seed=3)
    mirror_x, mirror_u = np.array([-1.0, 1.0, -1.0, 1.0, -1.0, -1.0]), np.array([-1.0, 1.0])
    mirrored = derivatives(x * mirror_x, u * mirror_u, -curvature, P)
    np.testing.assert_allclose(mirrored, derivatives(x, u, curvature, P) * mirror_x, rtol=1e-12, atol=1e-12)


def test_path_coordinates_are_those_of_a_circle():
    """On a circle of 20 m, s and e are the angle and the radius of the world position."""
    radius, psi, beta, v, r = 20.0, 0.4, -0.3, 10.0, 0.5
    angle, e = 0.9, 1.5  # the centre at the origin, driven counter-clockwise: e to the left is inward
    heading = angle + 0.5 * math.pi
    dphi = psi + beta - heading
    x_dot, y_dot, psi_dot = world_rates(r, v, beta, psi)
    e_dot, _, s_dot = path_rates(r, v, 0.0, e, dphi, 1.0 / radius)
    assert e_dot == pytest.approx(-(x_dot * math.cos(angle) + y_dot * math.sin(angle)))
    tangential = -x_dot * math.sin(angle) + y_dot * math.cos(angle)
    assert s_dot == pytest.approx(radius * tangential / (radius - e))
    assert psi_dot == r


@pytest.mark.parametrize("p", [P, COUPLED], ids=["rear driven", "both driven"])
@pytest.mark.parametrize("name", POINTS)
def test_analytic_jacobians_match_drakes(name, p):
    x, u, curvature = POINTS[name]
    x_dot, a, b = linearize(np.array(x), np.array(u), curvature, p)
    point = InitializeAutoDiff(np.concatenate([x, u])).ravel()
    drake = derivatives(point[:6], point[6:], curvature, p)
    gradient = ExtractGradient(drake)
    np.testing.assert_allclose(x_dot, ExtractValue(drake).ravel(), rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(a, gradient[:, :6], rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(b, gradient[:, 6:], rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("p", [P, COUPLED], ids=["rear driven", "both driven"])
def test_analytic_jacobians_match_the_complex_step_over_a_batch(p):
    x, u, curvature = random_points(400, seed=4)
    x_dot, a, b = linearize(x, u, curvature, p)
    np.testing.assert_allclose(x_dot, derivatives(x, u, curvature, p), rtol=1e-12, atol=1e-12)
    for j in range(8):
        step = np.zeros(8, dtype=complex)
        step[j] = 1e-30j
        column = derivatives(x + step[:6], u + step[6:], curvature, p).imag / 1e-30
        np.testing.assert_allclose(a[..., j] if j < 6 else b[..., j - 6], column, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("name", POINTS)
def test_expression_evaluates_to_the_same(name):
    x, u, curvature = POINTS[name]
    variables = MakeVectorVariable(8, "z")
    symbols = np.array([Expression(variable) for variable in variables])
    environment = dict(zip(variables, (*x, *u), strict=True))
    symbolic = [f.Evaluate(environment) for f in derivatives(symbols[:6], symbols[6:], curvature, P)]
    np.testing.assert_allclose(symbolic, derivatives(x, u, curvature, P), rtol=1e-12, atol=1e-12)


def test_compiled_functions_are_the_same_source():
    @compiled
    def run(r, v, beta, omega_r, delta, tau, p):
        return motion(r, v, beta, omega_r, delta, tau, p)

    for x, u, _ in POINTS.values():
        np.testing.assert_allclose(run(*x[:4], *u, P), motion(*x[:4], *u, P), rtol=1e-12, atol=1e-12)


def test_leading_axes_broadcast():
    x, u, curvature = random_points(24, seed=5)
    x, u = x.reshape(4, 6, 6), u[:6]
    x_dot, a, b = linearize(x, u, 0.01, P)
    assert x_dot.shape == (4, 6, 6)
    assert a.shape == (4, 6, 6, 6)
    assert b.shape == (4, 6, 6, 2)
    plain = derivatives(x, u, 0.01, P)
    np.testing.assert_allclose(x_dot, plain, rtol=1e-12, atol=1e-12)
    for i, j in ((0, 0), (3, 5)):
        np.testing.assert_allclose(plain[i, j], derivatives(x[i, j], u[j], 0.01, P), rtol=1e-12, atol=1e-12)
    assert derivatives(x, u, curvature[:6], P).shape == (4, 6, 6)


@pytest.mark.parametrize("name", ["nominal_check_grip.csv", "nominal_check_drift.csv"])
def test_restarted_at_any_row_of_the_specification_it_reaches_the_next(name):
    if not (SPEC / name).exists():
        pytest.skip(f"{SPEC / name} is not here")
    table = pd.read_csv(SPEC / name)
    state = table[["r", "v", "beta", "omega_r"]].to_numpy()
    command = table[["delta_cmd", "tau_cmd"]].to_numpy()
    x = np.concatenate([state[:-1], np.zeros((len(state) - 1, 2))], axis=1)
    step, count = 1e-3, 10

    def rate(x, part):
        return derivatives(x, command[:-1] + part * (command[1:] - command[:-1]), 0.0, P)

    for i in range(count):
        k1 = rate(x, i / count)
        k2 = rate(x + 0.5 * step * k1, (i + 0.5) / count)
        k3 = rate(x + 0.5 * step * k2, (i + 0.5) / count)
        k4 = rate(x + step * k3, (i + 1) / count)
        x = x + step / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    assert np.abs(x[:, :4] - state[1:]).max() < 1e-6
    rates = motion(*state.T, *command.T, P)
    np.testing.assert_allclose(np.stack([rates.a_x, rates.a_y], axis=1), table[["ax", "ay"]], rtol=1e-6, atol=1e-6)
