"""An interior-point method for the OCP's quadratic programs, which uses their stages.

Mehrotra's predictor-corrector method (Nocedal and Wright, algorithm 16.4), each Newton step by a Riccati recursion
(`riccati`): what an inequality of one stage adds to the Newton system stays within that stage. The number of iterations
hardly depends on how far the car is from the model or on which inequalities hold, so that the time of a QP is bounded.
Nothing is kept between two solves.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from drift_drake.car.compilation import compiled, copied, inlined
from drift_drake.car.scalar import jitable
from drift_drake.common.arrays import Array
from drift_drake.drive.qp.products import largest
from drift_drake.drive.qp.riccati import costates, factorise, substitute

TO_THE_BOUNDARY = 0.995  # share of the way to it that a step takes
FLOOR = 0.1  # of the tolerance: the least complementarity that is aimed at
# (least distance from a bound, complementarity, iterations): near the solution as a rule, else from far within.
STARTS = ((1e-2, 1e-2, 10), (1e2, 1e4, 40))
FIRST_ATTEMPT = STARTS[0][2]  # iterations, of which a solution with more has taken the second start


class Inequalities(NamedTuple):
    """Inequalities row (x_k, u_k) + softness slack_k >= bound, M in all, those of stages k = 1..N one after the other.

    Those of a stage end with its slack's own: a row of zeros, a softness above zero.
    """

    row: Array  # [M, n+2]
    softness: Array  # [M]
    bound: Array  # [M], finite
    first: NDArray[np.intp]  # [N+1], where the rows of a stage begin; in the end M


@compiled
def _values(x: Array, u: Array, slack: Array, rows: Inequalities, out: Array) -> None:
    """By how much the inequalities hold [M]."""
    n = x.shape[1]
    row, softness, bound, first = rows
    for k in range(slack.size):
        for r in range(first[k], first[k + 1]):
            total = softness[r] * slack[k] - bound[r] + row[r, n] * u[k + 1, 0] + row[r, n + 1] * u[k + 1, 1]
            for i in range(n):
                total += row[r, i] * x[k + 1, i]
            out[r] = total


@compiled
def _start(x: Array, u: Array, rows: Inequalities, penalty: Array, start: tuple[float, float, int],
           values: Array, slack: Array, margin: Array, multipliers: Array) -> None:  # fmt: skip
    """Slacks, distances from the bounds and multipliers to begin with."""
    least, barrier, _ = start
    slack[:] = 0.0
    _values(x, u, slack, rows, values)
    for k in range(slack.size):
        here, own = range(rows.first[k], rows.first[k + 1]), rows.first[k + 1] - 1
        for r in here:
            if rows.softness[r] > 0.0:
                slack[k] = max(slack[k], -values[r] / rows.softness[r])
        # Where no soft bound is near, it is the slack's own multiplier that balances the penalty.
        rest = penalty[k]
        for r in here:
            margin[r] = max(values[r] + rows.softness[r] * slack[k], least)
            multipliers[r] = barrier / margin[r]
            if r != own:
                rest -= rows.softness[r] * multipliers[r]
        multipliers[own] = max(rest / rows.softness[own], barrier)
        margin[own] = barrier / multipliers[own]
        slack[k] = max(slack[k], (margin[own] + rows.bound[own]) / rows.softness[own])


@compiled
def _gradients(f: Array, hessian: Array, gx: Array, gu: Array, target: Array, x: Array, u: Array,
               linear: Array, defect: Array) -> None:  # fmt: skip
    """The cost's gradient by stages [N, n+4] and the defect F_k z_k - x_{k+1} - target_k [N, n]."""
    count, n = f.shape[0], f.shape[1]
    z = np.empty(n + 4)
    for k in range(count):
        copied(x[k], z[:n])
        copied(u[k], z[n : n + 2])
        copied(u[k + 1], z[n + 2 :])
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


class _Condensed(NamedTuple):
    """The inequalities' part of the Newton system, with the slacks eliminated.

    A slack's step is that of t_k = ds_k + lead_k (dx_k, du_k), less the rest: measured from the bound that holds it
    most, so that eliminating it loses no digits where two bounds are about to hold.
    """

    shifted: Array  # [M, n+2], the rows by (x, u) at fixed t
    span: NDArray[np.intp]  # [M, 2], where the entries of these that are not zero begin and end
    lead: Array  # [N, n+2]
    coupling: Array  # [N, n+2], second derivatives by (x, u) and t
    weight: Array  # [N], by t
    curvature: Array  # [N, n+2, n+2], by (x, u)


@compiled
def _condense(rows: Inequalities, multipliers: Array, margin: Array, out: _Condensed) -> None:
    """The second derivatives."""
    row, softness, _, first = rows
    shifted, span, lead, coupling, weight, curvature = out
    size = row.shape[1]
    coupling[:], curvature[:], weight[:] = 0.0, 0.0, 0.0
    for k in range(weight.size):
        most = 0.0
        for r in range(first[k], first[k + 1]):
            by_slack = multipliers[r] / margin[r] * softness[r] ** 2
            weight[k] += by_slack
            if by_slack > most:
                most = by_slack
                for i in range(size):
                    lead[k, i] = row[r, i] / softness[r]
        for r in range(first[k], first[k + 1]):
            d, begin, end = multipliers[r] / margin[r], size, 0
            for i in range(size):
                shifted[r, i] = row[r, i] - softness[r] * lead[k, i]
                if shifted[r, i] != 0.0:
                    begin, end = min(begin, i), i + 1
            span[r, 0], span[r, 1] = begin, end
            for i in range(begin, end):
                coupling[k, i] += d * softness[r] * shifted[r, i]
                for j in range(begin, end):
                    curvature[k, i, j] += d * shifted[r, i] * shifted[r, j]
        for i in range(size):
            if coupling[k, i] != 0.0:
                for j in range(size):
                    curvature[k, i, j] -= coupling[k, i] * coupling[k, j] / weight[k]


@compiled
def _first_derivatives(rows: Inequalities, multipliers: Array, margin: Array, values: Array, centre: Array,
                       penalty: Array, condensed: _Condensed, barrier: Array, constant: Array) -> None:  # fmt: skip
    """Writes those by (x, u) [N, n+2], and the step of t at (dx, du) = 0 [N].

    `centre` [M]: what multiplier times margin is to become, but for the step's own product.
    """
    softness, first = rows.softness, rows.first
    shifted, span, lead, coupling, weight, _ = condensed
    size = barrier.shape[1]
    for k in range(constant.size):
        by_slack = penalty[k]
        for i in range(size):
            barrier[k, i] = -penalty[k] * lead[k, i]
        for r in range(first[k], first[k + 1]):
            m = (centre[r] - multipliers[r] * (values[r] - margin[r])) / margin[r]
            by_slack -= m * softness[r]
            for i in range(span[r, 0], span[r, 1]):
                barrier[k, i] -= m * shifted[r, i]
        constant[k] = -by_slack / weight[k]
        for i in range(size):
            barrier[k, i] += constant[k] * coupling[k, i]


@compiled
def _bound_steps(rows: Inequalities, step: Array, condensed: _Condensed, constant: Array, multipliers: Array,
                 margin: Array, values: Array, centre: Array, slack_step: Array, margin_step: Array,
                 multiplier_step: Array) -> float:  # fmt: skip
    """Steps of slacks, margins and multipliers; returns the longest share of the step that keeps all above zero."""
    softness, first = rows.softness, rows.first
    shifted, span, lead, coupling, weight, _ = condensed
    longest, size = 1.0, step.shape[1]
    for k in range(constant.size):
        t, ahead = constant[k], 0.0
        for i in range(size):
            t -= coupling[k, i] / weight[k] * step[k + 1, i]
            ahead += lead[k, i] * step[k + 1, i]
        slack_step[k] = t - ahead
        for r in range(first[k], first[k + 1]):
            change = softness[r] * t
            for i in range(span[r, 0], span[r, 1]):
                change += shifted[r, i] * step[k + 1, i]
            dt = margin_step[r] = change + values[r] - margin[r]
            dy = multiplier_step[r] = (centre[r] - multipliers[r] * dt) / margin[r] - multipliers[r]
            if dt < 0.0:
                longest = min(longest, -margin[r] / dt)
            if dy < 0.0:
                longest = min(longest, -multipliers[r] / dy)
    return longest


@compiled
def _dual_residual(f: Array, linear: Array, end: Array, penalty: Array, costate: Array, rows: Inequalities,
                   multipliers: Array) -> float:  # fmt: skip
    """The largest entry of the Lagrangian's gradient."""
    count, n = f.shape[0], f.shape[1]
    found, by_stage = 0.0, np.zeros(n + 2)
    before, by_input = np.zeros(2), np.zeros(2)  # of stage k-1 by u_k
    for k in range(count + 1):
        copied(end if k == count else linear[k, : n + 2], by_stage)
        copied(by_input, before)
        if k < count:
            for m in range(n):
                for i in range(n + 2):
                    by_stage[i] += f[k, m, i] * costate[k + 1, m]
            for i in range(2):
                by_input[i] = linear[k, n + 2 + i]
                for m in range(n):
                    by_input[i] += f[k, m, n + 2 + i] * costate[k + 1, m]
        if k == 0:
            continue
        for i in range(n):
            by_stage[i] -= costate[k, i]
        for i in range(2):
            by_stage[n + i] += before[i]
        over = penalty[k - 1]
        for r in range(rows.first[k - 1], rows.first[k]):
            over -= rows.softness[r] * multipliers[r]
            for i in range(n + 2):
                by_stage[i] -= rows.row[r, i] * multipliers[r]
        found = max(found, largest(by_stage), abs(over))
    return found


@compiled
def _centred(multipliers: Array, margin: Array, length: float, margin_step: Array, multiplier_step: Array,
             complementarity: float, least: float, centre: Array) -> None:  # fmt: skip
    """Mehrotra's centring and second-order correction, from the predictor's steps, which reach `length` far.

    The complementarity aimed at is no less than `least`: the nearer to zero, the stiffer is the Newton system.
    """
    after = 0.0
    for r in range(centre.size):
        after += (margin[r] + length * margin_step[r]) * (multipliers[r] + length * multiplier_step[r])
    target = max((after / centre.size / complementarity) ** 3 * complementarity, least)
    for r in range(centre.size):
        centre[r] = target - margin_step[r] * multiplier_step[r]


@jitable
def _add(factor: float, values: Array, out: Array) -> None:
    """out += factor * values, entry by entry: quick to compile."""
    for i in range(len(out)):
        out[i] += factor * values[i]


@inlined
def attempt(f: Array, hessian: Array, gx: Array, gu: Array, penalty: Array, target: Array, rows: Inequalities,
             tolerance: float, start: tuple[float, float, int], x: Array, u: Array, slack: Array, costate: Array,
             multipliers: Array) -> tuple[int, bool]:  # fmt: skip
    """`interior_point` from one of the `STARTS`."""
    count, n, inequalities = f.shape[0], f.shape[1], rows.bound.size
    margin, values, centre = np.empty(inequalities), np.empty(inequalities), np.empty(inequalities)
    margin_step, multiplier_step, slack_step = np.empty_like(margin), np.empty_like(margin), np.empty(count)
    linear, defect, end = np.empty((count, n + 4)), np.empty((count, n)), np.empty(n + 2)
    condensed = _Condensed(np.empty_like(rows.row), np.empty((inequalities, 2), np.intp), np.empty((count, n + 2)),
                           np.empty((count, n + 2)), np.empty(count), np.empty((count, n + 2, n + 2)))  # fmt: skip
    barrier, constant = np.empty((count, n + 2)), np.empty(count)
    p, gain, pivots = np.empty((count + 1, n + 2, n + 2)), np.empty((count, 2, n + 2)), np.empty((count, 3))
    q, ahead, step = np.empty((count + 1, n + 2)), np.empty((count, 2)), np.empty((count + 1, n + 2))
    next_costate = np.empty_like(costate)
    copied(gx[count], end[:n])
    copied(gu[count], end[n:])
    _start(x, u, rows, penalty, start, values, slack, margin, multipliers)
    costate[:] = 0.0
    iteration, limit = 0, start[2]
    while True:
        _values(x, u, slack, rows, values)
        _gradients(f, hessian, gx, gu, target, x, u, linear, defect)
        complementarity = float(margin @ multipliers) / inequalities
        primal = max(largest(defect.ravel()), largest(values - margin))
        if not np.isfinite(primal + complementarity):
            return iteration, False
        if iteration > 0 and max(primal, complementarity) <= tolerance:
            size = max(1.0, largest(multipliers), largest(costate.ravel()))
            if _dual_residual(f, linear, end, penalty, costate, rows, multipliers) <= tolerance * size:
                return iteration, True
        if iteration == limit:
            return iteration, False
        _condense(rows, multipliers, margin, condensed)
        if not factorise(f, hessian, condensed.curvature, p, gain, pivots):
            return iteration, False
        centre[:] = 0.0
        for predictor in (True, False):
            _first_derivatives(rows, multipliers, margin, values, centre, penalty, condensed, barrier, constant)
            substitute(f, linear, end, barrier, defect, p, gain, pivots, q, ahead, step)
            length = _bound_steps(rows, step, condensed, constant, multipliers, margin, values, centre, slack_step,
                                  margin_step, multiplier_step)  # fmt: skip
            if predictor:
                _centred(multipliers, margin, length, margin_step, multiplier_step, complementarity, FLOOR * tolerance,
                         centre)  # fmt: skip
        costates(p, q, step, next_costate)
        length = min(1.0, TO_THE_BOUNDARY * length)
        for k in range(count + 1):
            _add(length, step[k, :n], x[k])
            _add(length, step[k, n:], u[k])
            for i in range(n + 2):
                costate[k, i] += length * (next_costate[k, i] - costate[k, i])
        _add(length, slack_step, slack)
        _add(length, margin_step, margin)
        _add(length, multiplier_step, multipliers)
        iteration += 1


@inlined
def interior_point(f: Array, hessian: Array, gx: Array, gu: Array, penalty: Array, target: Array, rows: Inequalities,
                   tolerance: float, x: Array, u: Array, slack: Array, costate: Array,
                   multipliers: Array) -> tuple[int, bool]:  # fmt: skip
    """Writes the solution into the last five arguments; x and u start it, their first rows are the given ones.

        min sum_k 1/2 z_k' H_k z_k + linear terms + penalty sum_k slack_k,   z_k = (x_k, u_k, u_{k+1}), all scaled,
        s.t. F_k z_k - x_{k+1} = target_k, the first (x, u) given, and the inequalities of k = 1..N.

    Args:
        f: F_k [N, n, n+4]; hessian: H_k [N, n+4, n+4], positive semidefinite; gx [N+1, n], gu [N+1, 2]: the cost's
            gradient at zero; penalty: above zero [N]; target: [N, n]; rows: the inequalities.
        tolerance: see `stagewise_qp.solve_stages`.
        x: [N+1, n]; u: [N+1, 2]; slack: [N]; costate: of (x_k, u_k) [N+1, n+2], in x_k, k >= 1, the multipliers of the
            dynamics; multipliers: of the inequalities, zero or above [M].

    Returns:
        (iterations, whether it is solved).
    """
    first_x, first_u = x.copy(), u.copy()
    total = 0
    for start in STARTS:
        copied(first_x.ravel(), x.ravel())
        copied(first_u.ravel(), u.ravel())
        iterations, solved = attempt(
            f, hessian, gx, gu, penalty, target, rows, tolerance, start, x, u, slack, costate, multipliers
        )
        total += iterations
        if solved:
            return total, True
    return total, False
