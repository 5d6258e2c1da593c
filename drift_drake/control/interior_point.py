"""An interior-point method for the OCP's quadratic programs, which uses their stages.

Mehrotra's predictor-corrector method (Nocedal and Wright, algorithm 16.4), each Newton step by a Riccati recursion
(`riccati`). The number of iterations hardly depends on how far the car is from the model or on which bounds hold, so
that the time of a QP is bounded. Nothing is kept between two solves.
"""

import numpy as np
from numpy.typing import NDArray

from drift_drake.compilation import compiled
from drift_drake.control.riccati import LATERAL, costates, factorise, substitute

Array = NDArray[np.float64]

TO_THE_BOUNDARY = 0.995  # share of the way to it that a step takes
# (least distance from a bound, complementarity, iterations): near the solution as a rule, else from far within.
STARTS = ((1e-2, 1e-2, 12), (1e2, 1e4, 40))
FIRST_ATTEMPT = STARTS[0][2]  # iterations, of which a solution with more has taken the second start
ROWS = 7  # inequalities of a stage: two of each input, the lane's two edges, no negative slack


@compiled
def _values(x: Array, u: Array, slack: Array, low: Array, high: Array, lane: Array, out: Array) -> None:
    """The inequalities' left sides [N, 7], zero or above where they hold."""
    for k in range(out.shape[0]):
        e, s = x[k + 1, LATERAL], slack[k]
        out[k, 0], out[k, 1] = u[k + 1, 0] - low[k, 0], high[k, 0] - u[k + 1, 0]
        out[k, 2], out[k, 3] = u[k + 1, 1] - low[k, 1], high[k, 1] - u[k + 1, 1]
        out[k, 4], out[k, 5], out[k, 6] = e + s - lane[k, 0], lane[k, 1] - e + s, s


@compiled
def _start(x: Array, lane: Array, u: Array, low: Array, high: Array, penalty: Array, start: tuple[float, float, int],
           values: Array, slack: Array, room: Array, multipliers: Array) -> None:  # fmt: skip
    """Slacks, distances from the bounds and multipliers to begin with; an infinite bound has no multiplier."""
    least, barrier, _ = start
    for k in range(values.shape[0]):
        slack[k] = max(0.0, lane[k, 0] - x[k + 1, LATERAL], x[k + 1, LATERAL] - lane[k, 1])
    _values(x, u, slack, low, high, lane, values)
    for k in range(values.shape[0]):
        for i in range(ROWS):
            room[k, i] = max(values[k, i], least)
            multipliers[k, i] = barrier / room[k, i] if np.isfinite(room[k, i]) else 0.0
        # Far from the lane's edges it is the slack's own multiplier that balances the penalty.
        multipliers[k, 6] = max(penalty[k] - multipliers[k, 4] - multipliers[k, 5], barrier)
        room[k, 6] = barrier / multipliers[k, 6]
        slack[k] = max(slack[k], room[k, 6])


@compiled
def _gradients(f: Array, hessian: Array, gx: Array, gu: Array, target: Array, x: Array, u: Array,
               linear: Array, defect: Array) -> None:  # fmt: skip
    """The cost's gradient by stages [N, n+4] and the defect F_k z_k - x_{k+1} - target_k [N, n]."""
    count, n = f.shape[0], f.shape[1]
    z = np.empty(n + 4)
    for k in range(count):
        z[:n], z[n : n + 2], z[n + 2 :] = x[k], u[k], u[k + 1]
        for i in range(n + 4):
            total = 0.0
            for j in range(n + 4):
                total += hessian[k, i, j] * z[j]
            linear[k, i] = total
        for i in range(n):
            linear[k, i] += gx[k, i]
            total = -x[k + 1, i] - target[k, i]
            for j in range(n + 4):
                total += f[k, i, j] * z[j]
            defect[k, i] = total
        linear[k, n] += gu[k, 0]
        linear[k, n + 1] += gu[k, 1]


@compiled
def _condense(multipliers: Array, room: Array, values: Array, centre: Array, penalty: Array, curvature: Array,
              barrier: Array, terms: Array) -> None:  # fmt: skip
    """The inequalities' part of the Newton system, with slacks eliminated.

    Args:
        centre: [N, 7], what multiplier times room is to become, but for the step's own product.
        curvature, barrier: [N, 3] in (e, delta, tau); terms: [N, 2], the slack's step is terms_0 + terms_1 de.
    """
    for k in range(multipliers.shape[0]):
        d = multipliers[k] / room[k]
        m = np.empty(ROWS)
        for i in range(ROWS):
            m[i] = centre[k, i] / room[k, i] - d[i] * (values[k, i] - room[k, i]) if multipliers[k, i] > 0.0 else 0.0
        whole = d[4] + d[5] + d[6]
        by_slack = penalty[k] - m[4] - m[5] - m[6]
        coupling = d[4] - d[5]
        curvature[k, 0] = (4.0 * d[4] * d[5] + d[6] * (d[4] + d[5])) / whole
        curvature[k, 1], curvature[k, 2] = d[0] + d[1], d[2] + d[3]
        barrier[k, 0] = m[5] - m[4] - coupling * by_slack / whole
        barrier[k, 1], barrier[k, 2] = m[1] - m[0], m[3] - m[2]
        terms[k, 0], terms[k, 1] = -by_slack / whole, -coupling / whole


@compiled
def _bound_steps(step: Array, terms: Array, multipliers: Array, room: Array, values: Array, centre: Array,
                 slack_step: Array, room_step: Array, multiplier_step: Array) -> float:  # fmt: skip
    """Steps of slacks, rooms and multipliers; returns the longest share of the step that keeps all above zero."""
    n = step.shape[1] - 2
    longest = 1.0
    for k in range(multipliers.shape[0]):
        e, delta, tau = step[k + 1, LATERAL], step[k + 1, n], step[k + 1, n + 1]
        s = slack_step[k] = terms[k, 0] + terms[k, 1] * e
        room_step[k, 0], room_step[k, 1], room_step[k, 2], room_step[k, 3] = delta, -delta, tau, -tau
        room_step[k, 4], room_step[k, 5], room_step[k, 6] = e + s, s - e, s
        for i in range(ROWS):
            if multipliers[k, i] <= 0.0:
                room_step[k, i] = multiplier_step[k, i] = 0.0
                continue
            t, y = room[k, i], multipliers[k, i]
            dt = room_step[k, i] = room_step[k, i] + values[k, i] - t
            dy = multiplier_step[k, i] = (centre[k, i] - y * dt) / t - y
            if dt < 0.0:
                longest = min(longest, -t / dt)
            if dy < 0.0:
                longest = min(longest, -y / dy)
    return longest


@compiled
def _dual_residual(f: Array, linear: Array, gx: Array, gu: Array, penalty: Array, costate: Array,
                   multipliers: Array) -> float:  # fmt: skip
    """The largest entry of the Lagrangian's gradient."""
    count, n = f.shape[0], f.shape[1]
    largest = 0.0
    u_part = np.zeros(2)
    for k in range(count + 1):
        for i in range(n):
            if k == 0:
                break
            total = -costate[k, i] + (linear[k, i] if k < count else gx[k, i])
            if i == LATERAL:
                total += multipliers[k - 1, 5] - multipliers[k - 1, 4]
            if k < count:
                for m in range(n):
                    total += f[k, m, i] * costate[k + 1, m]
            largest = max(largest, abs(total))
        for i in range(2):
            if k > 0:
                total = u_part[i] + multipliers[k - 1, 2 * i + 1] - multipliers[k - 1, 2 * i]
                if k < count:
                    total += linear[k, n + i]
                    for m in range(n):
                        total += f[k, m, n + i] * costate[k + 1, m]
                else:
                    total += gu[k, i]
                largest = max(largest, abs(total))
            if k < count:
                u_part[i] = linear[k, n + 2 + i]
                for m in range(n):
                    u_part[i] += f[k, m, n + 2 + i] * costate[k + 1, m]
        if k > 0:
            over = penalty[k - 1] - multipliers[k - 1, 4] - multipliers[k - 1, 5] - multipliers[k - 1, 6]
            largest = max(largest, abs(over))
    return largest


@compiled
def _gap(multipliers: Array, room: Array, values: Array) -> tuple[float, float, float]:
    """(mean complementarity, largest difference of rooms and values, largest multiplier) of the finite bounds."""
    total, apart, largest, active = 0.0, 0.0, 0.0, 0
    for k in range(multipliers.shape[0]):
        for i in range(ROWS):
            if multipliers[k, i] > 0.0:
                total += room[k, i] * multipliers[k, i]
                apart = max(apart, abs(values[k, i] - room[k, i]))
                largest = max(largest, multipliers[k, i])
                active += 1
    return total / active, apart, largest


@compiled
def _centred(multipliers: Array, room: Array, length: float, room_step: Array, multiplier_step: Array,
             complementarity: float, centre: Array) -> None:  # fmt: skip
    """Mehrotra's centring and second-order correction, from the predictor's steps, which reach `length` far."""
    after, active = 0.0, 0
    for k in range(centre.shape[0]):
        for i in range(ROWS):
            if multipliers[k, i] > 0.0:
                t = room[k, i] + length * room_step[k, i]
                after += t * (multipliers[k, i] + length * multiplier_step[k, i])
                active += 1
    target = (after / active / complementarity) ** 3 * complementarity
    for k in range(centre.shape[0]):
        for i in range(ROWS):
            centre[k, i] = target - room_step[k, i] * multiplier_step[k, i]


@compiled
def _attempt(f: Array, hessian: Array, gx: Array, gu: Array, penalty: Array, target: Array, low: Array, high: Array,
             lane: Array, tolerance: float, start: tuple[float, float, int], x: Array, u: Array, slack: Array,
             costate: Array, multipliers: Array) -> tuple[int, bool]:  # fmt: skip
    """`interior_point` from one of the `STARTS`."""
    count, n = f.shape[0], f.shape[1]
    room, values = np.empty((count, ROWS)), np.empty((count, ROWS))
    centre, room_step, multiplier_step = np.empty_like(room), np.empty_like(room), np.empty_like(room)
    linear, defect, end = np.empty((count, n + 4)), np.empty((count, n)), np.concatenate((gx[count], gu[count]))
    curvature, barrier, terms = np.empty((count, 3)), np.empty((count, 3)), np.empty((count, 2))
    p, gain, inverse = np.empty((count + 1, n + 2, n + 2)), np.empty((count, 2, n + 2)), np.empty((count, 3))
    q, ahead, step = np.empty((count + 1, n + 2)), np.empty((count, 2)), np.empty((count + 1, n + 2))
    slack_step, next_costate = np.empty(count), np.empty_like(costate)
    _start(x, lane, u, low, high, penalty, start, values, slack, room, multipliers)
    costate[:] = 0.0
    iteration, limit = 0, start[2]
    while True:
        _values(x, u, slack, low, high, lane, values)
        _gradients(f, hessian, gx, gu, target, x, u, linear, defect)
        complementarity, apart, size = _gap(multipliers, room, values)
        primal = max(np.abs(defect).max(), apart)
        if not np.isfinite(primal + complementarity):
            return iteration, False
        if iteration > 0 and max(primal, complementarity) <= tolerance:
            size = max(1.0, size, np.abs(costate).max())
            if _dual_residual(f, linear, gx, gu, penalty, costate, multipliers) <= tolerance * size:
                return iteration, True
        if iteration == limit:
            return iteration, False
        centre[:] = 0.0
        _condense(multipliers, room, values, centre, penalty, curvature, barrier, terms)
        if not factorise(f, hessian, curvature, p, gain, inverse):
            return iteration, False
        substitute(f, linear, end, barrier, defect, p, gain, inverse, q, ahead, step)
        length = _bound_steps(step, terms, multipliers, room, values, centre, slack_step, room_step, multiplier_step)
        _centred(multipliers, room, length, room_step, multiplier_step, complementarity, centre)
        _condense(multipliers, room, values, centre, penalty, curvature, barrier, terms)
        substitute(f, linear, end, barrier, defect, p, gain, inverse, q, ahead, step)
        costates(p, q, step, next_costate)
        length = _bound_steps(step, terms, multipliers, room, values, centre, slack_step, room_step, multiplier_step)
        length = min(1.0, TO_THE_BOUNDARY * length)
        for k in range(count + 1):
            x[k] += length * step[k, :n]
            u[k] += length * step[k, n:]
            costate[k] += length * (next_costate[k] - costate[k])
        slack += length * slack_step
        room += length * room_step
        multipliers += length * multiplier_step
        iteration += 1


@compiled
def interior_point(f: Array, hessian: Array, gx: Array, gu: Array, penalty: Array, target: Array, low: Array,
                   high: Array, lane: Array, tolerance: float, x: Array, u: Array, slack: Array, costate: Array,
                   multipliers: Array) -> tuple[int, bool]:  # fmt: skip
    """Writes the solution into the last five arguments; x and u start it, their first rows are the given ones.

    See `stagewise_qp.StagewiseProblem` for the others.

    Returns:
        (iterations, whether it is solved).
    """
    first_x, first_u = x.copy(), u.copy()
    total = 0
    for start in STARTS:
        x[:], u[:] = first_x, first_u
        iterations, solved = _attempt(
            f, hessian, gx, gu, penalty, target, low, high, lane, tolerance, start, x, u, slack, costate, multipliers
        )
        total += iterations
        if solved:
            return total, True
    return total, False
