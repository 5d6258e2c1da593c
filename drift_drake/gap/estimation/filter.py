"""Extended Kalman filter over the car, its pose and the effects' own states (`filter_state`), compiled.

The first nine of the state carry a covariance; heats and filtered accelerations follow from the estimated motion
without a correction of their own. The filter returns whitened innovations (mean square one where the model and the
noise levels are right) and, for each row, the gain and the whitening matrix. With those frozen, `observed` evaluates
innovations of slightly different parameters: a prediction-error criterion, whose derivatives by differences serve
Gauss-Newton.
"""

from typing import Any

from drift_drake.car.compilation import compiled
from drift_drake.car.effects.magnitudes import reading_gains
from drift_drake.car.scalar import jitable, loaded, maximum, sqrt, stored
from drift_drake.gap.estimation.filter_state import CORRECTED, MEASURED, hold_speeds, product

STATE_OF = (0, 1, 2, 3, -1, -1, 4, 5, 6)  # that a channel measures alone; accelerations depend on several
UNMEASURED = 0.01  # first variance of a state that no sensor measures (sideslip: a tenth of a radian)


@compiled
def measurement_matrix(effects: Any, h: Any) -> Any:
    """Derivatives h [9, 9] of the channels by the corrected states; the accelerations' rows are left zero."""
    one = 1.0 + 0.0 * effects[0]
    by_r, by_v, by_beta, by_rim = reading_gains(effects)
    gains = (by_r * one, by_v * one, by_beta * one, by_rim * one)
    for i in range(MEASURED):
        if STATE_OF[i] >= 0:
            stored(h[i], STATE_OF[i], gains[i] if i < len(gains) else one)


@jitable
def _row_product(a: Any, i: Any, b: Any, j: Any, end: Any, like: Any) -> Any:
    """Sum of a[i, c] b[j, c] over c before `end`: of a and the transposed b."""
    total = loaded(a[i], 0, like) * loaded(b[j], 0, like)
    for c in range(1, end):
        total = total + loaded(a[i], c, like) * loaded(b[j], c, like)
    return total


@compiled
def propagate(f: Any, process: Any, period: Any, n: Any, p: Any, t: Any, like: Any) -> Any:
    """Covariance p of the first n states a row later, in place, under the transition f; t is scratch."""
    for i in range(n):
        for j in range(n):
            stored(t[i], j, _row_product(f, i, p, j, n, like))  # p is symmetric
    for i in range(n):
        for j in range(i + 1):
            total = _row_product(t, i, f, j, n, like)
            stored(p[i], j, total)
            stored(p[j], i, total)
        stored(p[i], i, loaded(p[i], i, like) + process[i] * period)


@jitable
def innovation_covariance(h: Any, noise: Any, used: Any, n: Any, p: Any, ph: Any, s: Any, like: Any) -> Any:
    """Fills s, lower triangle, with the innovations' covariance under p of the first n states, and ph with h p."""
    zero = 0.0 * like
    for j in range(MEASURED):
        state = STATE_OF[j]
        for i in range(n):
            if not used[j]:
                stored(ph[j], i, zero)
            elif state >= 0:
                stored(ph[j], i, loaded(p[i], state, like) * loaded(h[j], state, like))
            else:
                stored(ph[j], i, _row_product(p, i, h, j, n, like))
    for i in range(MEASURED):
        state = STATE_OF[i]
        for j in range(i + 1):
            total = zero
            if used[i] and state >= 0:
                total = loaded(h[i], state, like) * loaded(ph[j], state, like)
            elif used[i]:
                total = _row_product(h, i, ph, j, n, like)
            stored(s[i], j, total)
        stored(s[i], i, loaded(s[i], i, like) + (noise[i] if used[i] else 1.0))


@jitable
def inverse_root(s: Any, low: Any, out: Any, like: Any) -> Any:
    """Fills out with the inverse of the Cholesky factor of s [9, 9], and low with the factor."""
    for i in range(MEASURED):
        for j in range(i + 1):
            total = loaded(s[i], j, like)
            if j > 0:
                total = total - _row_product(low, i, low, j, j, like)
            stored(low[i], j, sqrt(maximum(total, 1e-18)) if i == j else total / loaded(low[j], j, like))
    for j in range(MEASURED):
        for i in range(MEASURED):
            total = 0.0 * like if i < j else 1.0 / loaded(low[i], i, like)
            if i > j:
                total = -product(low, i, out, j, j, i, like) * total
            stored(out[i], j, total)


@compiled
def update_covariance(
    h: Any, noise: Any, used: Any, n: Any, p: Any, gain: Any, whitening: Any, ph: Any, s: Any, low: Any, t: Any,
    like: Any,
) -> Any:  # fmt: skip
    """Fills gain and whitening [9, 9] of a measurement, and p with the covariance after it of the first n states.

    The rest is scratch. The whitening matrix is the inverse of the Cholesky factor of the innovations' covariance s.
    """
    innovation_covariance(h, noise, used, n, p, ph, s, like)
    inverse_root(s, low, whitening, like)
    for i in range(n):
        for j in range(MEASURED):  # t is p h' L^-T
            stored(t[i], j, product(whitening, j, ph, i, 0, j + 1, like))
    for i in range(n):
        for j in range(MEASURED):
            stored(gain[i], j, product(t, i, whitening, j, j, MEASURED, like) if used[j] else 0.0 * like)
        for j in range(i + 1):
            total = loaded(p[i], j, like) - _row_product(t, i, t, j, MEASURED, like)
            stored(p[i], j, total)
            stored(p[j], i, total)
    gain[n:] = 0.0


@compiled
def correct(y: Any, used: Any, predicted: Any, gain: Any, whitening: Any, nu: Any, z: Any, innovations: Any, like: Any,
            of_gain: Any) -> Any:  # fmt: skip
    """Corrects z by one row's measurement y [9] and writes its whitened innovations [9]; nu is scratch.

    Args:
        like, of_gain: one of the numbers of the car, and of gain and whitening.
    """
    for j in range(MEASURED):
        error = loaded(y, j, like) - loaded(predicted, j, like)
        stored(nu, j, error if used[j] else 0.0 * like)
    for i in range(MEASURED):
        total = loaded(whitening[i], 0, of_gain) * loaded(nu, 0, like)
        for j in range(1, i + 1):
            total = total + loaded(whitening[i], j, of_gain) * loaded(nu, j, like)
        stored(innovations, i, total)
    for i in range(CORRECTED):
        total = loaded(gain[i], 0, of_gain) * loaded(nu, 0, like)
        for j in range(1, MEASURED):
            total = total + loaded(gain[i], j, of_gain) * loaded(nu, j, like)
        stored(z, i, loaded(z, i, like) + total)
    hold_speeds(z, like)
