"""The OCP in CasADi is the one that our solvers solve: the same step, its Jacobians, and the same cost."""

import numpy as np
import pytest

from drift_drake.drive.learnt.checkpoint import load_model
from drift_drake.drive.learnt.quality import step_model
from drift_drake.drive.mpc.ocp import OcpData, OptimalControlProblem
from drift_drake.drive.mpc.plan import DT
from drift_drake.drive.mpc.sqp import LineSearchSqp
from drift_drake.drive.reference.trajectory import figure_8
from experiments.drifting.casadi_ocp import CasadiOcp, learnt_step

ca = pytest.importorskip("casadi")
LEARNT = load_model()
OURS = step_model(LEARNT, LEARNT.prior())
CENTRE = np.array([0.5, 12.0, -0.3, 15.0, 0.1, 0.1, 0.05, 150.0])
OFF = np.array([0.02, 0.05, 0.01, 0.1, 0.02, 0.01])  # of the start, from the reference
SPREAD = np.array([0.5, 3.0, 0.3, 4.0, 1.0, 0.3, 0.3, 150.0])


@pytest.fixture(scope="module")
def peer() -> object:
    return learnt_step(LEARNT.network, LEARNT.prior().mean, LEARNT.vehicle.constants())


def test_its_step_and_jacobians_are_the_models(peer: ca.Function) -> None:
    rng = np.random.default_rng(1)
    x, u, u_next = CENTRE + SPREAD * rng.normal(size=(50, 8)), *(np.array([0.1, 150.0]) * rng.normal(size=(2, 50, 2)))
    x[0, 3] = 0.2  # a rim below the floor of the slip's speed
    curvature = 0.05 * rng.normal(size=50)
    ours = OURS.linearize(x, u, u_next, curvature)
    symbols = [ca.MX.sym(f"a{i}", size) for i, size in enumerate((8, 2, 2))]
    bend = ca.MX.sym("k")
    step = peer(*symbols, bend)
    both = ca.Function("both", [*symbols, bend], [step, *(ca.jacobian(step, symbol) for symbol in symbols)])
    for k in range(50):
        theirs = both(x[k], u[k], u_next[k], curvature[k])
        for given, wanted in zip(theirs, ours, strict=True):
            np.testing.assert_allclose(np.asarray(given).squeeze(), wanted[k], rtol=1e-9, atol=1e-9)


def test_ipopt_finds_the_cost_of_the_converged_sqp(peer: ca.Function) -> None:
    reference, horizon, s = figure_8(LEARNT.vehicle), 5, 40.0
    along, command = reference.horizon(s, DT, horizon), reference.input(s)
    start = np.append(reference.state(s) + OFF, command)
    problem = OptimalControlProblem(OURS, LEARNT.vehicle, horizon)
    data = OcpData(start, command, along.x_ref, along.curvature, along.e_min, along.e_max)
    problem.set(data)
    guess = problem.first_guess(data)
    z, cost, solved = CasadiOcp(peer, problem).solve(data, guess)
    ours = LineSearchSqp(problem).solve(guess)
    assert solved
    assert ours.status == "converged"
    assert cost == pytest.approx(ours.cost, abs=1e-5)
    np.testing.assert_allclose(z, ours.z, atol=1e-3)


def test_a_papers_network_is_refused() -> None:
    with pytest.raises(ValueError, match="physical inputs and brush tyres alone"):
        learnt_step(LEARNT.network._replace(nominal=None), LEARNT.prior().mean, LEARNT.vehicle.constants())
