"""The learnt OCP once more, in CasADi: a peer for IPOPT with exact second derivatives, and none of our equations' code.

The Bayesian model's step is written again from its weights and the nominal car's numbers: the rates of the nominal car,
what its tyres say of (x_k, u_k), the network's mean, the trapezoid of the path and the commands' lags. A test holds
values and Jacobians to `BayesianStepModel`'s. CasADi is an optional extra (`peers`).
"""

import contextlib
import importlib.util
from typing import Any

import numpy as np

from drift_drake.car.parameters import Constants
from drift_drake.car.single_track.motion import MIN_SLIP_SPEED, MIN_SPEED, static_loads
from drift_drake.car.step_model import INPUT_SCALE, STATE_SCALE
from drift_drake.common.arrays import Array
from drift_drake.drive.learnt.command_lag import TIME_STEP, lag_factors
from drift_drake.drive.learnt.features import Network
from drift_drake.drive.mpc.ocp import OcpData, OptimalControlProblem

with contextlib.suppress(ModuleNotFoundError):
    import casadi as ca

TINY = 1e-18  # under the root of the combined slip, as in `car.scalar.norm2`


def installed() -> bool:
    """Whether CasADi is there."""
    return importlib.util.find_spec("casadi") is not None


def learnt_step(network: Network, theta: Array, nominal: Constants) -> Any:
    """The Bayesian model's step as a function (x_k [8], u_k [2], u_{k+1} [2], curvature) -> x_{k+1} [8], in SI units.

    Args:
        network: one with the physical inputs; theta: [4, 16]; nominal: the car inside the step, on brush tyres.

    Raises:
        ValueError: a paper's network, or other tyres.
    """
    if network.nominal is None or nominal.tyre != 0.0 or network.nominal.tyre != 0.0:
        raise ValueError("the peer in CasADi knows networks with physical inputs and brush tyres alone")
    x, u, u_next, curvature = ca.MX.sym("x", 8), ca.MX.sym("u", 2), ca.MX.sym("u_next", 2), ca.MX.sym("curvature")
    lagged = ca.vertcat(*(ca.dot(factors, ca.vertcat(x[6 + i], u[i], u_next[i])) for i, factors in enumerate(_lags())))
    z = ca.vertcat(x[:4], u, u_next, x[6:])
    physical = ca.vertcat(_slips_and_forces(x, x[6], network.nominal), _front(x, lagged[0], network.nominal))
    mean = _network_mean(network, theta, ca.vertcat(z, physical))
    rates = _rates(x, u, nominal)
    body = ca.vertcat(x[:3] + TIME_STEP * rates, 0.0) + mean
    x_next = ca.vertcat(body, _path(x, body, curvature), lagged)
    return ca.Function("step", [x, u, u_next, curvature], [x_next])


def _lags() -> Array:
    """For steering and torque: the shares of the lagged command, of that now and of that at the step's end [2, 3]."""
    return np.stack(lag_factors(TIME_STEP), axis=1)


def _network_mean(network: Network, theta: Array, inputs: Any) -> Any:
    """theta^T phi [4]."""
    hidden = (inputs - network.input_offset) / network.input_scale
    for weights, bias in ((network.w1, network.b1), (network.w2, network.b2)):
        hidden = ca.tanh(ca.mtimes(ca.DM(weights.T), hidden) + ca.DM(bias))
    rows, offset = np.einsum("shf,sf->sh", network.w_out, theta), np.sum(network.b_out * theta, axis=1)
    return ca.mtimes(ca.DM(rows), hidden) + ca.DM(offset)


def _brush(slip: tuple[Any, Any], stiffness: float, peak: float) -> tuple[Any, Any]:
    """Force (F_x, F_y) [N] of one axle at slips (sigma_x, sigma_y)."""
    sigma = ca.sqrt(slip[0] ** 2 + slip[1] ** 2 + TINY)
    share = ca.fmin(stiffness * sigma / (3.0 * peak), 1.0)  # of the contact that slides
    force = peak * (1.0 - (1.0 - share) ** 3)
    return force / sigma * slip[0], -force / sigma * slip[1]


def _front_slip(x: Any, delta: Any, p: Constants) -> tuple[Any, Any]:
    r, v, beta, rim = x[0], x[1], x[2], x[3]
    along, across = v * ca.cos(beta), v * ca.sin(beta) + p.front_axle_distance * r
    v_x = along * ca.cos(delta) + across * ca.sin(delta)
    v_y = across * ca.cos(delta) - along * ca.sin(delta)
    rolling = ca.fmax(v_x + p.front_coupling * (rim - v_x), MIN_SLIP_SPEED)
    return p.front_coupling * (rim - v_x) / rolling, v_y / rolling


def _rear_slip(x: Any, p: Constants) -> tuple[Any, Any]:
    r, v, beta, rim = x[0], x[1], x[2], x[3]
    rolling = ca.fmax(rim, MIN_SLIP_SPEED)
    return (rim - v * ca.cos(beta)) / rolling, (v * ca.sin(beta) - p.rear_axle_distance * r) / rolling


def _peaks(p: Constants) -> tuple[float, float]:
    front, rear = static_loads(p)
    return p.friction * front, p.friction * rear


def _squashed(slip: Any) -> Any:
    return slip / ca.sqrt(1.0 + slip**2)


def _front(x: Any, delta: Any, p: Constants) -> Any:
    """The front's lateral slip, squashed, and force over its peak."""
    peak, slip = _peaks(p)[0], _front_slip(x, delta, p)
    return ca.vertcat(_squashed(slip[1]), _brush(slip, p.front_stiffness, peak)[1] / peak)


def _slips_and_forces(x: Any, delta: Any, p: Constants) -> Any:
    """The physical inputs at the start of the step: the front's two, the rear's slips and its forces."""
    peak, slip = _peaks(p)[1], _rear_slip(x, p)
    force = _brush(slip, p.rear_stiffness, peak)
    rear = _squashed(slip[0]), _squashed(slip[1]), force[0] / peak, force[1] / peak
    return ca.vertcat(_front(x, delta, p), *rear)


def _rates(x: Any, u: Any, p: Constants) -> Any:
    """(r_dot, v_dot, beta_dot) of the nominal car."""
    peaks, beta, delta = _peaks(p), x[2], u[0]
    front_x, front_y = _brush(_front_slip(x, delta, p), p.front_stiffness, peaks[0])
    rear_x, rear_y = _brush(_rear_slip(x, p), p.rear_stiffness, peaks[1])
    lateral = front_y * ca.cos(delta) + front_x * ca.sin(delta)
    a_x = (front_x * ca.cos(delta) - front_y * ca.sin(delta) + rear_x) / p.mass
    a_y = (lateral + rear_y) / p.mass
    turn = (a_y * ca.cos(beta) - a_x * ca.sin(beta)) / ca.fmax(x[1], MIN_SPEED) - x[0]
    moment = p.front_axle_distance * lateral - p.rear_axle_distance * rear_y
    return ca.vertcat(moment / p.yaw_inertia, a_x * ca.cos(beta) + a_y * ca.sin(beta), turn)


def _path(x: Any, body: Any, curvature: Any) -> Any:
    """(e, dphi) at the step's end, by the trapezoid of what the body does."""
    v, e, dphi = 0.5 * (x[1] + body[1]), x[4], x[5]
    turn = body[2] - x[2] + 0.5 * TIME_STEP * (x[0] + body[0])
    end = dphi + turn - TIME_STEP * curvature * v * ca.cos(dphi) / (1.0 - curvature * e)
    return ca.vertcat(e + TIME_STEP * v * ca.sin(0.5 * (dphi + end)), end)


class CasadiOcp:
    """The OCP of a step for one horizon, its data as parameters, solved by IPOPT with its own tolerances.

    The decision vector is `OptimalControlProblem`'s: the same variables, scaled alike, in the same order.
    """

    def __init__(self, step: Any, problem: OptimalControlProblem) -> None:
        """Args: step: `learnt_step`'s; problem: the OCP that is solved, for its horizon, weights and limits."""
        self._problem = problem
        count, layout, weights = problem.horizon, problem.layout, problem.weights
        z, x_ref, curvature = ca.MX.sym("z", problem.size), ca.MX.sym("x_ref", 6, count), ca.MX.sym("k", 1, count)
        states = layout.state_size * (count + 1)
        x = ca.reshape(z[:states], layout.state_size, count + 1)
        u = ca.reshape(z[states : states + 2 * (count + 1)], 2, count + 1)
        slack = z[-count:].T
        si_x, si_u = ca.mtimes(ca.diag(layout.state_scale), x), ca.mtimes(ca.diag(INPUT_SCALE), u)
        error, change = si_x[:6, :-1] - x_ref, si_u[:, 1:] - si_u[:, :-1]
        cost = ca.dot(weights.state(), ca.sum2(error**2)) + ca.dot(weights.input(), ca.sum2(change**2))
        after = step.map(count)(si_x[:, :-1], si_u[:, :-1], si_u[:, 1:], curvature)
        defect = ca.mtimes(ca.diag(1.0 / layout.state_scale), after) - x[:, 1:]
        lateral = STATE_SCALE[4] * x[4, 1:]
        rows = ca.vertcat(ca.vec(defect), (lateral + slack).T, (lateral - slack).T)
        program = {
            "x": z,
            "p": ca.veccat(x_ref, curvature),
            "f": cost + weights.lane_penalty * ca.sum2(slack),
            "g": rows,
        }
        quiet = {"print_time": False, "ipopt.print_level": 0, "ipopt.sb": "yes"}
        self._solver = ca.nlpsol("peer", "ipopt", program, quiet)

    def solve(self, data: OcpData, guess: Array) -> tuple[Array, float, bool]:
        """(decision vector, cost, whether IPOPT says it is solved) from a guess."""
        problem, count = self._problem, self._problem.horizon
        car, free, zero = problem.parameters, np.full(count, np.inf), np.zeros(problem.dynamics.size)
        x_init, u_init = data.x_init / problem.layout.state_scale, data.u_init / INPUT_SCALE
        low = np.array([-car.steering_limit, car.torque_min]) / INPUT_SCALE
        high = np.array([car.steering_limit, car.torque_max]) / INPUT_SCALE
        states = np.full(problem.layout.state_size * count, np.inf)
        found = self._solver(
            x0=guess,
            p=np.concatenate([data.x_ref[:-1].ravel(), data.curvature]),
            lbx=np.concatenate([x_init, -states, u_init, np.tile(low, count), np.zeros(count)]),
            ubx=np.concatenate([x_init, states, u_init, np.tile(high, count), free]),
            lbg=np.concatenate([zero, data.e_min[1:], -free]),
            ubg=np.concatenate([zero, free, data.e_max[1:]]),
        )
        return np.asarray(found["x"]).ravel(), float(found["f"]), bool(self._solver.stats()["success"])
