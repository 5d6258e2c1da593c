"""The tracking controller: its gains against an independent Riccati solver, its port, and what the feedback is for."""

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are

from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.step_model import NominalStepModel
from drift_drake.drive.loop.drive import Drive
from drift_drake.drive.mpc.tracking import (
    INPUT_WEIGHT,
    STATE_WEIGHT,
    TrackingController,
    lqr_gains,
    tracking_gains,
)
from drift_drake.drive.reference.trajectory import straight_line

PARAMETERS = VehicleParameters()
STEPS = 20


def trajectory(steps: int = STEPS, speed: float = 12.0) -> tuple[np.ndarray, np.ndarray]:
    x = np.tile([0.0, speed, 0.0, speed, 0.0, 0.0], (steps + 1, 1))
    return x, np.zeros((steps + 1, 2))


def test_gains_of_a_long_horizon_are_the_stationary_ones() -> None:
    x, u = trajectory(400)
    model = NominalStepModel(PARAMETERS)
    gains = tracking_gains(model, x, u, np.zeros(400))
    assert gains.shape == (400, 2, 6)
    _, a, b, b_next = model.linearize(x[:1], u[:1], u[1:2], np.zeros(1))
    a, b = a[0], b[0] + b_next[0]
    r = np.diag(INPUT_WEIGHT)
    value = solve_discrete_are(a, b, np.diag(STATE_WEIGHT), r)
    expected = -np.linalg.solve(r + b.T @ value @ b, b.T @ value @ a)
    np.testing.assert_allclose(gains[0], expected, rtol=1e-6, atol=1e-9)
    assert np.abs(np.linalg.eigvals(a + b @ gains[0])).max() < 1.0


def test_the_last_gain_is_one_step_of_least_squares() -> None:
    """The correction that minimises |x_N|_Q^2 + |du|_R^2 over a single step."""
    x, u = trajectory(1)
    model = NominalStepModel(PARAMETERS)
    gain = tracking_gains(model, x, u, np.zeros(1))[0]
    _, a, b, b_next = model.linearize(x[:1], u[:1], u[1:], np.zeros(1))
    error = np.array([0.1, 0.3, -0.05, 0.2, 0.4, 0.02])
    q, r = np.sqrt(STATE_WEIGHT)[:, None], np.sqrt(INPUT_WEIGHT)
    rows = np.concatenate([q * (b[0] + b_next[0]), np.diag(r)])
    least = np.linalg.lstsq(rows, np.concatenate([-np.sqrt(STATE_WEIGHT) * (a[0] @ error), np.zeros(2)]), rcond=None)[0]
    np.testing.assert_allclose(gain @ error, least, rtol=1e-9, atol=1e-12)


def test_further_states_have_no_weight_but_their_feedback() -> None:
    """Two more states: where they move nothing the gains know only the six, where they move the car they count."""
    rng = np.random.default_rng(1)
    a, b = np.zeros((5, 8, 8)), rng.normal(size=(5, 8, 2))
    a[:, :6, :6], a[:, 6:, 6:] = rng.normal(size=(5, 6, 6)), 0.5 * np.eye(2)
    gains = lqr_gains(a, b)
    assert gains.shape == (5, 2, 8)
    np.testing.assert_allclose(gains[..., :6], lqr_gains(a[:, :6, :6], b[:, :6]), rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(gains[..., 6:], 0.0, rtol=0, atol=1e-10)
    a[:, :6, 6:] = rng.normal(size=(5, 6, 2))
    assert np.abs(lqr_gains(a, b)[..., 6:]).max() > 0.1


def test_ports_and_values() -> None:
    rng = np.random.default_rng(0)
    x, u, gains = rng.normal(size=(4, 6)), rng.normal(size=(4, 2)), rng.normal(size=(3, 2, 6))
    system = TrackingController(x, u, gains)
    assert system.GetInputPort("measured_state").size() == 7
    assert system.GetOutputPort("plan").size() == 5
    assert system.HasDirectFeedthrough(0, 0)
    context = system.CreateDefaultContext()

    def plan(t: float, state: np.ndarray) -> np.ndarray:
        context.SetTime(t)
        system.get_input_port().FixValue(context, np.append(state, 3.0))
        return system.get_output_port().Eval(context).copy()

    on_plan = plan(0.1, x[1])
    np.testing.assert_allclose(on_plan, [0.1, *u[1], *u[2]], atol=1e-12)
    error = rng.normal(size=6)
    between = plan(0.15, 0.5 * (x[1] + x[2]) + error)
    correction = 0.5 * (gains[1] + gains[2]) @ error
    np.testing.assert_allclose(between[1:3], 0.5 * (u[1] + u[2]) + correction, atol=1e-12)
    np.testing.assert_allclose(between[3:], 0.5 * (u[2] + u[3]) + correction, atol=1e-12)
    np.testing.assert_allclose(plan(0.9, x[3])[1:], [*u[3], *u[3]], atol=1e-12)


def test_feedback_brings_the_car_back() -> None:
    x, u = trajectory(30)
    reference = straight_line(12.0, 12.0, 4.0, 3.0)
    start = np.array([0.1, 12.0, 0.0, 12.0, 0.8, 0.0])
    ends = []
    for gains in (tracking_gains(NominalStepModel(PARAMETERS), x, u, np.zeros(30)), np.zeros((30, 2, 6))):
        drive = Drive(PARAMETERS, TrackingController(x, u, gains), 1, 0.1, None, (0.0, 0.0),
                      reference=reference)  # fmt: skip
        table, ending = drive.run(start, 0.0, 3.0, 0)
        assert ending == "time"
        ends.append(abs(table["e"].iloc[-1]))
    assert ends[0] < 0.2
    assert ends[0] < 0.3 * ends[1]


def test_an_unstable_sideslip_needs_the_feedback() -> None:
    """About a drift the open loop runs away, and the closed one does not."""
    model = NominalStepModel(PARAMETERS)
    x = np.tile([0.75, 13.0, -0.5, 16.0, 0.0, 0.0], (41, 1))
    u = np.tile([-0.05, 150.0], (41, 1))
    _, a, b, b_next = model.linearize(x[:1], u[:1], u[1:2], np.full(1, 0.058))
    gain = tracking_gains(model, x, u, np.full(40, 0.058))[0]
    assert np.abs(np.linalg.eigvals(a[0])).max() > 1.02
    assert np.abs(np.linalg.eigvals(a[0] + (b[0] + b_next[0]) @ gain)).max() == pytest.approx(0.9, abs=0.1)
