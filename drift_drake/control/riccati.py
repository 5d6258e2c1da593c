"""The Newton step of an OCP's quadratic program, by a Riccati recursion over its stages.

A stage holds (x_k, u_k, w_k) with w_k = u_{k+1}, [n+4]; what is carried to the next is (x, u), [n+2]:

    x_{k+1} = F_k (x_k, u_k, w_k) + d_k,    u_{k+1} = w_k,    x_0 = u_0 = 0.

Minimised is sum_k 1/2 (x, u, w)' H_k (x, u, w) + h_k' (x, u, w), and for k = 1..N a barrier's diagonal in e_k and u_k
beside. The work grows as N (n+4)^3 / 3, the solution is exact (Rao, Wright and Rawlings, 1998, section 3).
"""

import numpy as np
from numpy.typing import NDArray

from drift_drake.compilation import compiled

Array = NDArray[np.float64]

LATERAL = 4  # of the state: the deviation e


@compiled
def _eliminated(whole: Array, inverse: Array, gain: Array, here: Array) -> bool:
    """Takes w_k out of a stage's Hessian [n+4, n+4]; False where it is not convex in w_k."""
    carried = here.shape[0]
    a, b, c = whole[carried, carried], whole[carried, carried + 1], whole[carried + 1, carried + 1]
    determinant = a * c - b * b
    if not (a > 0.0 and determinant > 0.0):
        return False
    inverse[0], inverse[1], inverse[2] = c / determinant, -b / determinant, a / determinant
    for j in range(carried):
        first, second = whole[carried, j], whole[carried + 1, j]
        gain[0, j] = -(inverse[0] * first + inverse[1] * second)
        gain[1, j] = -(inverse[1] * first + inverse[2] * second)
    for i in range(carried):
        first, second = whole[carried, i], whole[carried + 1, i]
        for j in range(carried):
            here[i, j] = whole[i, j] + first * gain[0, j] + second * gain[1, j]
    return True


@compiled
def factorise(f: Array, hessian: Array, curvature: Array, p: Array, gain: Array, inverse: Array) -> bool:
    """The backward recursion's matrices.

    Args:
        f: F_k [N, n, n+4]; hessian: H_k [N, n+4, n+4]; curvature: the barrier's, of (e, delta, tau) [N, 3], k = 1..N.
        p: P_k [N+1, n+2, n+2], gain: w_k by (x_k, u_k) [N, 2, n+2], inverse: of the Hessian in w_k, (11, 12, 22)
            [N, 3]; all are written.

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
            if not _eliminated(whole, inverse[k], gain[k], here):
                return False
        if k > 0:
            here[LATERAL, LATERAL] += curvature[k - 1, 0]
            here[n, n] += curvature[k - 1, 1]
            here[n + 1, n + 1] += curvature[k - 1, 2]
    return True


@compiled
def substitute(f: Array, linear: Array, end: Array, barrier: Array, defect: Array, p: Array, gain: Array,
               inverse: Array, q: Array, ahead: Array, step: Array) -> None:  # fmt: skip
    """The step for given linear terms, with what `factorise` has written.

    Args:
        f: as there; linear: h_k [N, n+4], and end: that of (x_N, u_N) [n+2]; defect: d_k [N, n].
        barrier: its linear terms in (e, delta, tau) [N, 3], k = 1..N.
        q: linear terms of the cost to go, [N+1, n+2], and ahead: [N, 2], scratch.
        step: (x_k, u_k) [N+1, n+2].
    """
    count, n = f.shape[0], f.shape[1]
    carried = n + 2
    value, whole = np.empty(carried), np.empty(n + 4)
    for k in range(count, -1, -1):
        here = q[k]
        if k == count:
            here[:] = end
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
            ahead[k, 0] = -(inverse[k, 0] * first + inverse[k, 1] * second)
            ahead[k, 1] = -(inverse[k, 1] * first + inverse[k, 2] * second)
            for j in range(carried):
                here[j] = whole[j] + gain[k, 0, j] * first + gain[k, 1, j] * second
        if k > 0:
            here[LATERAL] += barrier[k - 1, 0]
            here[n] += barrier[k - 1, 1]
            here[n + 1] += barrier[k - 1, 2]
    step[0] = 0.0
    for k in range(count):
        now, after, fk = step[k], step[k + 1], f[k]
        for i in range(2):
            total = ahead[k, i]
            for j in range(carried):
                total += gain[k, i, j] * now[j]
            after[n + i] = total
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
