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


def test_the_first_gain_is_the_best_of_all_corrections_along_a_changing_plan() -> None:
    """Least squares over all corrections at once, about a plan whose commands differ from knot to knot."""
    steps, model, rng = 3, NominalStepModel(PARAMETERS), np.random.default_rng(2)
    x, _ = trajectory(steps)
    x = x + rng.normal(size=x.shape) * [0.2, 0.5, 0.05, 0.5, 0.3, 0.05]
    u = rng.normal(size=(steps + 1, 2)) * [0.2, 80.0]
    curvature, scale = rng.normal(size=steps) * 0.02, np.array([1e-5] * 6 + [1e-5, 1e-2])
    q, r = np.sqrt(STATE_WEIGHT), np.sqrt(INPUT_WEIGHT)
    # d_k = start_k d_0 + by_k (du_0, du_1, ...), each correction held over its step, by differences of the car's step.
    start, by, rows, right = np.eye(6), np.zeros((6, 2 * steps)), [], []

    def moved(k: int, shift: np.ndarray) -> np.ndarray:
        state, held = x[k] + shift[:6], shift[6:]
        return model.step(state[None], u[k : k + 1] + held, u[k + 1 : k + 2] + held, curvature[k : k + 1])[0]

    for k in range(steps):
        a_b = np.stack([(moved(k, d) - moved(k, -d)) / (2.0 * d.sum()) for d in np.diag(scale)], axis=1)
        start, by = a_b[:, :6] @ start, a_b[:, :6] @ by
        by[:, 2 * k : 2 * k + 2] += a_b[:, 6:]
        rows.append(q[:, None] * by)
        right.append(-q[:, None] * start)
    whole = np.vstack([*rows, np.kron(np.eye(steps), np.diag(r))])
    best = np.linalg.lstsq(whole, np.vstack([*right, np.zeros((2 * steps, 6))]), rcond=None)[0]
    np.testing.assert_allclose(tracking_gains(model, x, u, curvature)[0], best[:2], rtol=1e-5, atol=1e-5)


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


def test_what_the_actuators_have_made_of_commands_follows_by_their_lags_and_the_rate_limit() -> None:
    """Under a constant command the rest falls off exponentially, the steering's no faster than its limit."""
    lag, rate, n = np.array([0.08, 0.25]), 0.5, 12
    x, u, gains = np.zeros((3, 8)), np.tile([0.4, 90.0], (3, 1)), np.zeros((2, 2, 8))
    for limit in (np.inf, rate):
        system = TrackingController(x, u, gains, lag, limit)
        context = system.CreateDefaultContext()
        system.get_input_port().FixValue(context, np.zeros(7))
        np.testing.assert_array_equal(context.get_discrete_state(0).value(), u[0])
        context.get_mutable_discrete_state(0).SetFromVector([0.0, 0.0])
        for _ in range(n):
            system.CalcForcedDiscreteVariableUpdate(context, context.get_mutable_discrete_state())
        steering, torque = context.get_discrete_state(0).value()
        assert torque == pytest.approx(90.0 * (1.0 - np.exp(-0.01 * n / 0.25)))
        assert steering == pytest.approx(0.01 * n * rate if limit == rate else 0.4 * (1.0 - np.exp(-0.01 * n / 0.08)))


def test_what_the_actuators_have_made_of_commands_is_fed_back() -> None:
    rng = np.random.default_rng(1)
    x, u, gains = rng.normal(size=(4, 8)), rng.normal(size=(4, 2)), rng.normal(size=(3, 2, 8))
    system = TrackingController(x, u, gains, np.array([0.1, 0.2]), 0.6)
    context = system.CreateDefaultContext()
    context.SetTime(0.1)
    state, actual = rng.normal(size=6), rng.normal(size=2)
    system.get_input_port().FixValue(context, np.append(state, 3.0))
    context.get_mutable_discrete_state(0).SetFromVector(actual)
    correction = gains[1] @ (np.append(state, actual) - x[1])
    plan = system.get_output_port().Eval(context)
    np.testing.assert_allclose(plan[1:], [*(u[1] + correction), *(u[2] + correction)], atol=1e-12)


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
