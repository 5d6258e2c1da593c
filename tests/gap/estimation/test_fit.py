"""Joint fits: derivatives, recovery of the truth, Laplace's evidence."""

import numpy as np
import pytest
from scipy.integrate import quad

from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.car.parameters import VehicleParameters
from drift_drake.gap.estimation.filtered import filter_case
from drift_drake.gap.estimation.fit import MAGNITUDE_STEP, laplace_terms, last_derivative, sensitivity
from drift_drake.gap.estimation.make_problem import make_problem
from drift_drake.gap.estimation.observed import observe_case
from drift_drake.gap.estimation.prior import NO_GAP, bounds, is_gap, log_density, starts
from drift_drake.gap.estimation.problem import NUISANCES
from drift_drake.gap.estimation.variants import Variant
from tests.gap.fits import fit

NAMES = ("rear_stiffness_error", "steering_lag")


@pytest.fixture(scope="module")
def problem(stiffness_case):
    return make_problem(stiffness_case[1], VehicleParameters())


def coarse(problem, gains, theta):
    """Innovations that count by one Runge-Kutta step a row."""
    return observe_case(problem, gains, [Variant(theta, NAMES)], substeps=1)[0]


def test_derivatives_agree_with_central_differences(problem):
    theta = np.zeros(problem.nuisances + 2)
    theta[-2:] = -0.2, 0.05
    gains = filter_case(problem, theta, NAMES)
    jacobian = sensitivity(problem, gains, theta, NAMES).dense()
    for column, step in ((0, 0.02), (8, 0.02), (len(NUISANCES), 0.02), (len(theta) - 2, 1e-3), (len(theta) - 1, 1e-4)):
        up, down = theta.copy(), theta.copy()
        up[column] += step
        down[column] -= step
        ends = observe_case(problem, gains, [Variant(up, NAMES), Variant(down, NAMES)])
        central = ends[0] - ends[1]
        central /= 2.0 * step
        assert np.linalg.norm(jacobian[:, column] - central) < 0.03 * np.linalg.norm(central)


def test_derivatives_are_those_of_all_runs_together(problem):
    """Each run's block is the dense matrix's, zero off the blocks; coarser steps in time change them little."""
    theta = np.append(np.linspace(-0.3, 0.3, problem.nuisances), [-0.2, 0.05])
    gains = filter_case(problem, theta, NAMES)
    dense = sensitivity(problem, gains, theta, NAMES).dense()
    base = observe_case(problem, gains, [Variant(theta, NAMES)])[0]
    steps = [problem.step] * problem.nuisances + [MAGNITUDE_STEP * problem.unit_of(name) for name in NAMES]
    for column, step in enumerate(steps):
        moved = theta.copy()
        moved[column] += step
        expected = (coarse(problem, gains, moved) - coarse(problem, gains, theta)) / step
        np.testing.assert_allclose(dense[:, column], expected, rtol=1e-9, atol=1e-9)
        fine = (observe_case(problem, gains, [Variant(moved, NAMES)])[0] - base) / step
        assert np.linalg.norm(dense[:, column] - fine) <= 0.02 * np.linalg.norm(fine)
    np.testing.assert_allclose(last_derivative(problem, gains, theta, NAMES), dense[:, -1], rtol=1e-9, atol=1e-9)


def test_a_joint_fit_recovers_the_truth(stiffness_case, problem):
    truth, _ = stiffness_case
    for start in starts("rear_stiffness_error"):
        found = fit(problem, ("rear_stiffness_error",), np.append(np.zeros(problem.nuisances), start))
        error = found.magnitudes["rear_stiffness_error"] - truth.effects["rear_stiffness_error"]
        assert abs(error) < 3.0 * found.deviations["rear_stiffness_error"]
        torque = found.theta[NUISANCES.index("torque")] * problem.vehicle.tolerance.torque
        assert torque == pytest.approx(truth.deviations["torque"], abs=0.03)
    nothing = fit(problem, (), np.zeros(problem.nuisances))
    assert found.log_evidence > nothing.log_evidence + 5.0


@pytest.mark.parametrize("peak", [0.02, 0.4, 2.9])
def test_laplace_evidence_is_the_integral_of_a_gaussian(peak):
    # One nuisance n ~ N(0, 1) and one magnitude q, uniform within its bounds: cost 0.5 |J (n, q) - e|^2 + 0.5 n^2.
    name = "aero_drag"
    low, high = bounds(name)
    jacobian = np.array([[1.5, 0.4], [0.2, 3.0], [0.5, 0.5]])
    target = jacobian @ np.array([0.3, peak])

    def cost(n, q):
        e = jacobian @ np.array([n, q]) - target
        return 0.5 * e @ e + 0.5 * n * n

    hessian = jacobian.T @ jacobian + np.diag([1.0, 0.0])
    mode = np.linalg.solve(hessian, jacobian.T @ target)
    theta = mode.copy()
    if not low < mode[1] < high:
        theta[1] = np.clip(mode[1], low, high)
        theta[0] = (jacobian.T @ target - hessian[:, 1] * theta[1])[0] / hessian[0, 0]
    covariance = np.linalg.inv(hessian)
    got = -cost(*theta) + laplace_terms(hessian, covariance, theta, mode, (name,))

    def over_n(q):
        return quad(lambda n: np.exp(-cost(n, q)) / np.sqrt(2.0 * np.pi), -9.0, 9.0)[0]

    expected = np.log(quad(over_n, low, high)[0]) + log_density(name)
    assert got == pytest.approx(expected, abs=1e-6)


def test_starts_lie_within_bounds():
    for name in CATALOGUE:
        low, high = bounds(name)
        assert all(low < q < high for q in starts(name))


def test_a_deviation_within_tolerance_is_no_gap(problem):
    tolerance = VehicleParameters().tolerance
    assert not is_gap("mass_error", 0.9 * NO_GAP * tolerance.mass, tolerance)
    assert is_gap("mass_error", -1.1 * NO_GAP * tolerance.mass, tolerance)
    assert is_gap("gyro_bias", 1e-6, tolerance)
    start = np.append(np.zeros(problem.nuisances), 0.5 * tolerance.yaw_inertia)
    assert fit(problem, ("yaw_inertia_error",), start, iterations=0).log_evidence == -np.inf
