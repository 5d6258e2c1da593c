"""The Newton step of an OCP's quadratic program, by a Riccati recursion over its stages.

A stage holds (x_k, u_k, w_k) with w_k = u_{k+1}, [n+4]; what is carried to the next is (x, u), [n+2]:

    x_{k+1} = F_k (x_k, u_k, w_k) + d_k,    u_{k+1} = w_k,    x_0 = u_0 = 0.

Minimised is sum_k 1/2 (x, u, w)' H_k (x, u, w) + h_k' (x, u, w), and for k = 1..N a barrier's quadratic in (x_k, u_k)
separately. The work grows as N (n+4)^3 / 3, the solution is exact (Rao, Wright and Rawlings, 1998, section 3).
"""

import numpy as np

from drift_drake.car.compilation import compiled, copied
from drift_drake.common.arrays import Array


@compiled
def _eliminated(whole: Array, pivots: Array, gain: Array, here: Array) -> bool:
    """Takes w_k out of a stage's Hessian [n+4, n+4], one input after the other; False where it is not convex in them.

    One after the other as in Cholesky's factorisation, which is stable where barriers are stiff; by the inverse of
    their Hessian the cost to go would lose its convexity to rounding.
    """
    carried = here.shape[0]
    first, second = whole[carried], whole[carried + 1]
    a, ratio = first[carried], second[carried] / first[carried]
    b = second[carried + 1] - ratio * second[carried]
    if not (a > 0.0 and b > 0.0):
        return False
    pivots[0], pivots[1], pivots[2] = a, b, ratio
    for j in range(carried):
        gain[0, j] = -first[j] / a
        gain[1, j] = -(second[j] - ratio * first[j]) / b
    for i in range(carried):
        by_first, by_second = a * gain[0, i], b * gain[1, i]
        for j in range(carried):
            here[i, j] = whole[i, j] - by_first * gain[0, j] - by_second * gain[1, j]
    return True


@compiled
def factorise(f: Array, hessian: Array, curvature: Array, p: Array, gain: Array, pivots: Array) -> bool:
    """The backward recursion's matrices.

    Args:
        f: F_k [N, n, n+4]; hessian: H_k [N, n+4, n+4]; curvature: the barrier's, of (x_k, u_k) [N, n+2, n+2],
            k = 1..N.
        p: P_k [N+1, n+2, n+2]; gain [N, 2, n+2]: the second input of w_k by (x_k, u_k), the first one by these at a
            given second; pivots [N, 3]: the Hessian by the first, by the second, and what the first takes of the
            second's step; all are written.

    Returns:
        Whether every stage is convex in w_k.
    """
    count, n = f.shape[0], f.shape[1]
    carried, size = n + 2, n + 4
    top, whole = np.empty((n, size)), np.empty((size, size))
    last = p[count]
    last[:] = 0.0
    for k in range(count, -1, -1):
        here = p[k]
        if k < count:
            after, fk, hk = p[k + 1], f[k], hessian[k]
            for i in range(n):
                for j in range(size):
                    top[i, j] = 0.0
                for m in range(n):
                    factor = after[i, m]
                    for j in range(size):
                        top[i, j] += factor * fk[m, j]
                top[i, carried] += after[i, n]
                top[i, carried + 1] += after[i, n + 1]
            for i in range(size):
                for j in range(size):
                    whole[i, j] = hk[i, j]
                for m in range(n):
                    factor = fk[m, i]
                    for j in range(size):
                        whole[i, j] += factor * top[m, j]
            for i in range(2):
                for j in range(size):
                    value = 0.0
                    for m in range(n):
                        value += after[n + i, m] * fk[m, j]
                    whole[carried + i, j] += value
                for j in range(2):
                    whole[carried + i, carried + j] += after[n + i, n + j]
            if not _eliminated(whole, pivots[k], gain[k], here):
                return False
        if k > 0:
            here += curvature[k - 1]
    return True


@compiled
def substitute(f: Array, linear: Array, end: Array, barrier: Array, defect: Array, p: Array, gain: Array,
               pivots: Array, q: Array, ahead: Array, step: Array) -> None:  # fmt: skip
    """The step for given linear terms, with what `factorise` has written.

    Args:
        f: as there; linear: h_k [N, n+4], and end: that of (x_N, u_N) [n+2]; defect: d_k [N, n].
        barrier: its linear terms in (x_k, u_k) [N, n+2], k = 1..N.
        q: linear terms of the cost to go, [N+1, n+2], and ahead: [N, 2], scratch.
        step: (x_k, u_k) [N+1, n+2].
    """
    count, n = f.shape[0], f.shape[1]
    carried = n + 2
    value, whole = np.empty(carried), np.empty(n + 4)
    for k in range(count, -1, -1):
        here = q[k]
        if k == count:
            copied(end, here)
        else:
            after, fk, pk = q[k + 1], f[k], p[k + 1]
            for i in range(carried):
                value[i] = after[i]
                for j in range(n):
                    value[i] += pk[i, j] * defect[k, j]
            for j in range(n + 4):
                whole[j] = linear[k, j]
            for i in range(n):
                for j in range(n + 4):
                    whole[j] += value[i] * fk[i, j]
            first, second = whole[carried] + value[n], whole[carried + 1] + value[n + 1]
            second -= pivots[k, 2] * first
            ahead[k, 0], ahead[k, 1] = -first / pivots[k, 0], -second / pivots[k, 1]
            for j in range(carried):
                here[j] = whole[j] + gain[k, 0, j] * first + gain[k, 1, j] * second
        if k > 0:
            here += barrier[k - 1]
    step[0] = 0.0
    for k in range(count):
        now, after, fk = step[k], step[k + 1], f[k]
        for i in range(2):
            after[n + i] = ahead[k, i]
            for j in range(carried):
                after[n + i] += gain[k, i, j] * now[j]
        after[n] -= pivots[k, 2] * after[n + 1]
        for i in range(n):
            total = defect[k, i] + fk[i, carried] * after[n] + fk[i, carried + 1] * after[n + 1]
            for j in range(carried):
                total += fk[i, j] * now[j]
            after[i] = total


@compiled
def costates(p: Array, q: Array, step: Array, out: Array) -> None:
    """The cost to go's gradient in (x_k, u_k) after the step, [N+1, n+2]; in x_k the multipliers of the dynamics."""
    for k in range(p.shape[0]):
        for i in range(p.shape[1]):
            total = q[k, i]
            for j in range(p.shape[1]):
                total += p[k, i, j] * step[k, j]
            out[k, i] = total
