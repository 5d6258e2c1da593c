"""The physical meaning of effects on tyres and axle loads, seen through Drake plants."""

import math

import pytest
from effect_cars import (
    COASTING,
    HEAVY,
    SIDEWAYS,
    WEIGHT,
    WHEELBASE,
    WHEELSPIN,
    P,
    acceleration_of,
    rates_of,
    simulate,
)


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


@pytest.mark.parametrize("q", [-0.5, 1.0])
def test_longitudinal_stiffness_error(q):
    """A slight slip of the rim makes the force C_r (1 + q) slip; a slight sideslip the one that it makes without q."""
    slip = 1e-6
    a_x, _ = acceleration_of({"longitudinal_stiffness_error": q}, (0.0, 12.0, 0.0, 12.0 * (1.0 + slip), 0.0, 0.0))
    assert a_x == pytest.approx(P.rear_stiffness * (1.0 + q) * slip / P.mass, rel=1e-3)
    sideways = (0.0, 12.0, slip, 12.0, 0.0, 0.0)
    _, a_y = acceleration_of({"longitudinal_stiffness_error": q}, sideways, (slip, 0.0))
    assert a_y == pytest.approx(-P.rear_stiffness * slip / P.mass, rel=1e-3)


def test_longitudinal_stiffness_leaves_the_grip_as_it_is():
    spinning = [acceleration_of({"longitudinal_stiffness_error": q}, WHEELSPIN)[0] for q in (0.0, 1.0)]
    assert spinning[1] == pytest.approx(spinning[0], rel=0.05)


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
                     internal={"front_slip": 0.0, "rear_slip": 0.0})  # fmt: skip
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

    cooled, _, _ = simulate({"tyre_thermal_fade": q}, COASTING, 6.0, internal={"front_heat": 1.0, "rear_heat": 0.5})
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
        body = acceleration_of({"longitudinal_load_transfer": q}, state, (1.2, 0.0), internal={"a_x": acceleration})
        forces.append(P.mass * math.hypot(*body))
    assert forces[0] == pytest.approx(WEIGHT * P.rear_axle_distance / WHEELBASE, rel=1e-9)
    assert forces[0] - forces[1] == pytest.approx(P.mass * q * a_x / WHEELBASE, rel=1e-9)


def test_load_transfer_follows_the_accelerations_within_a_twentieth_of_a_second():
    """The filtered accelerations reach 1 - 1/e of a step after 0.05 s."""
    view, a_x, _ = simulate({"longitudinal_load_transfer": 0.01}, WHEELSPIN, 0.05, internal={"a_x": 0.0, "a_y": 0.0})
    assert view.a_x / a_x == pytest.approx(1.0 - math.exp(-1.0), rel=0.01)


def test_lateral_load_transfer():
    """Sliding sideways at y = |a_y| / g, the car holds mu (1 - q y^2)."""
    q = 0.25
    _, _, a_y = simulate({"lateral_load_transfer": q}, SIDEWAYS, 12.0 * 0.05)
    y = (math.sqrt(1.0 + 4.0 * q) - 1.0) / (2.0 * q)  # y = 1 - q y^2
    assert a_y == pytest.approx(-P.gravity * y, rel=1e-4)
