"""Extended Kalman filter over the car, its pose and the effects' own states (`filter_state`), compiled.

The first nine of the state carry a covariance; heats and filtered accelerations follow from the estimated motion
without a correction of their own. The filter returns whitened innovations (mean square one where the model and the
noise levels are right) and, for each row, the gain and the whitening matrix. With those frozen, `observe_run` evaluates
the innovations of slightly different parameters some ten times faster: a prediction-error criterion, whose derivatives
by differences serve Gauss-Newton.
"""

from typing import Any

import numpy as np

from drift_drake.car.actuated import STAGES
from drift_drake.car.compilation import compiled, copied
from drift_drake.car.effects.magnitudes import depends_on_heading, reading_gains
from drift_drake.car.scalar import jitable
from drift_drake.gap.estimation.filter_state import (
    CORRECTED,
    MEASURED,
    SIZE,
    SUBSTEPS,
    UNRELAXED,
    advance_row,
    first_state,
    hold_speeds,
    linearise,
    predict_measurement,
    rates_of,
    transition,
)

STATE_OF = (0, 1, 2, 3, -1, -1, 4, 5, 6)  # that a channel measures alone; accelerations depend on several
UNMEASURED = 0.01  # first variance of a state that no sensor measures (sideslip: a tenth of a radian)


@compiled
def measurement_matrix(effects: Any, h: Any) -> Any:
    """Derivatives h [9, 9] of the channels by the corrected states; the accelerations' rows are left zero."""
    gains = reading_gains(effects)
    for i in range(MEASURED):
        if STATE_OF[i] >= 0:
            h[i, STATE_OF[i]] = gains[i] if i < len(gains) else 1.0


@compiled
def propagate(f: Any, process: Any, period: Any, n: Any, p: Any, t: Any) -> Any:
    """Covariance p of the first n states a row later, in place, under the transition f; t is scratch."""
    for i in range(n):
        for j in range(n):
            total = 0.0
            for c in range(n):
                total += f[i, c] * p[c, j]
            t[i, j] = total
    for i in range(n):
        for j in range(i + 1):
            total = 0.0
            for c in range(n):
                total += t[i, c] * f[j, c]
            p[i, j] = total
            p[j, i] = total
        p[i, i] += process[i] * period


@jitable
def innovation_covariance(h: Any, noise: Any, used: Any, n: Any, p: Any, ph: Any, s: Any) -> Any:
    """Fills s, lower triangle, with the innovations' covariance under p of the first n states, and ph with p h'."""
    m = MEASURED
    for j in range(m):
        state = STATE_OF[j]
        for i in range(n):
            total = 0.0
            if state >= 0:
                total = p[i, state] * h[j, state]
            else:
                for c in range(n):
                    total += p[i, c] * h[j, c]
            ph[i, j] = total if used[j] else 0.0
    for i in range(m):
        state = STATE_OF[i]
        for j in range(i + 1):
            total = 0.0
            if state >= 0:
                total = h[i, state] * ph[state, j]
            else:
                for c in range(n):
                    total += h[i, c] * ph[c, j]
            s[i, j] = total if used[i] else 0.0
        s[i, i] += noise[i] if used[i] else 1.0


@jitable
def inverse_root(s: Any, low: Any, out: Any) -> Any:
    """Fills out with the inverse of the Cholesky factor of s [9, 9], and low with the factor."""
    m = MEASURED
    for i in range(m):
        for j in range(i + 1):
            total = s[i, j]
            for c in range(j):
                total -= low[i, c] * low[j, c]
            low[i, j] = np.sqrt(max(total, 1e-18)) if i == j else total / low[j, j]
    for j in range(m):
        for i in range(m):
            if i < j:
                out[i, j] = 0.0
            elif i == j:
                out[i, j] = 1.0 / low[i, i]
            else:
                total = 0.0
                for c in range(j, i):
                    total += low[i, c] * out[c, j]
                out[i, j] = -total / low[i, i]


@compiled
def update_covariance(
    h: Any, noise: Any, used: Any, n: Any, p: Any, gain: Any, whitening: Any, ph: Any, s: Any, low: Any, t: Any,
    scratch: Any,
) -> Any:  # fmt: skip
    """Fills gain and whitening [9, 9] of a measurement, and p with the covariance after it of the first n states.

    The rest is scratch. The whitening matrix is the inverse of the Cholesky factor of the innovations' covariance s.
    """
    m = MEASURED
    innovation_covariance(h, noise, used, n, p, ph, s)
    inverse_root(s, low, whitening)
    for i in range(n):
        for j in range(m):
            total = 0.0
            for c in range(j + 1):
                total += ph[i, c] * whitening[j, c]
            t[i, j] = total  # p h' L^-T
    for i in range(n):
        for j in range(m):
            total = 0.0
            for c in range(j, m):
                total += t[i, c] * whitening[c, j]
            gain[i, j] = total if used[j] else 0.0
        for j in range(i + 1):
            total = 0.0
            for c in range(m):
                total += t[i, c] * t[j, c]
            scratch[i, j] = total
    gain[n:] = 0.0
    for i in range(n):
        for j in range(i + 1):
            p[i, j] -= scratch[i, j]
            p[j, i] = p[i, j]


@compiled
def filter_run(
    y: Any, first: Any, used: Any, delta: Any, torque: Any, period: Any, constants: Any, effects: Any, noise: Any,
    process: Any, wrenches: Any, innovations: Any, gain: Any, whitening: Any,
) -> Any:  # fmt: skip
    """Extended Kalman filter over one run.

    Args:
        y: measurements [rows, 9] in the order of CHANNELS; first: row to start from, whose innovations and those
            before are left zero; used: which channels count [9].
        delta, torque: on the stages' grid (`filter_state.actuated`); period: [s]; constants, effects: the car.
        noise: measurement variances [9]; process: process noise of the first nine states, variance a second [9].
        wrenches: wrenches as in `observe_run`.
        innovations [rows, 9], gain [rows, 9, 9] (states by channels), whitening [rows, 9, 9]: filled.
    """
    rows = y.shape[0]
    z, k, w = np.zeros(SIZE), np.zeros(SIZE + 2), np.zeros((2, SIZE))
    probe = np.zeros(SIZE)
    jacobian = np.zeros((SIZE + 2, CORRECTED))
    n, m = CORRECTED, MEASURED
    p, f, t = np.zeros((n, n)), np.zeros((n, n)), np.zeros((n, n))
    scratch = np.zeros((n, n))
    h, ph, s, low = np.zeros((m, n)), np.zeros((n, m)), np.zeros((m, m)), np.zeros((m, m))
    predicted, nu, wrench = np.zeros(m), np.zeros(m), np.zeros(3)
    relaxed = effects.tyre_relaxation > 0.0
    moving = CORRECTED if relaxed else UNRELAXED
    acting = wrenches.shape[0] == rows
    graded = depends_on_heading(effects)
    measurement_matrix(effects, h)
    first_state(y, first, used, delta, torque, constants, effects, z)
    for i in range(4):
        p[i, i] = noise[i] if used[i] else UNMEASURED
    for i in range(3):
        p[4 + i, 4 + i] = noise[6 + i] if used[6 + i] else 0.0
    if relaxed:
        p[7, 7] = p[8, 8] = 1e-4
    innovations[: first + 1] = 0.0
    gain[: first + 1] = 0.0
    whitening[: first + 1] = 0.0
    linearise(z, delta[STAGES * first], torque[STAGES * first], constants, effects, relaxed, graded, probe, jacobian)
    for row in range(first + 1, rows):
        transition(jacobian, period, moving, f, t, scratch)
        propagate(f, process, period, moving, p, t)
        if acting:
            copied(wrenches[row - 1], wrench)
        advance_row(z, delta, torque, row - 1, period, SUBSTEPS, constants, effects, wrench, k, w)
        if acting:
            copied(wrenches[row], wrench)
        at = STAGES * row
        linearise(z, delta[at], torque[at], constants, effects, relaxed, graded, probe, jacobian)
        rates_of(z, delta[at], torque[at], constants, effects, wrench, k)
        predict_measurement(z, k[SIZE], k[SIZE + 1], effects, predicted)
        for j in range(n):
            h[4, j] = jacobian[SIZE, j]
            h[5, j] = jacobian[SIZE + 1, j]
        update_covariance(h, noise, used, moving, p, gain[row], whitening[row], ph, s, low, t, scratch)
        correct(y[row], used, predicted, gain[row], whitening[row], nu, z, innovations[row])


@compiled
def correct(y: Any, used: Any, predicted: Any, gain: Any, whitening: Any, nu: Any, z: Any, innovations: Any) -> Any:
    """Corrects z by one row's measurement y [9] and writes its whitened innovations [9]; nu is scratch."""
    for j in range(MEASURED):
        nu[j] = y[j] - predicted[j] if used[j] else 0.0
    for i in range(MEASURED):
        total = 0.0
        for j in range(i + 1):
            total += whitening[i, j] * nu[j]
        innovations[i] = total
    for i in range(CORRECTED):
        total = 0.0
        for j in range(MEASURED):
            total += gain[i, j] * nu[j]
        z[i] += total
    hold_speeds(z)


@compiled
def observe_run(
    y: Any,
    first: Any,
    used: Any,
    delta: Any,
    torque: Any,
    period: Any,
    substeps: Any,
    constants: Any,
    effects: Any,
    wrenches: Any,
    gain: Any,
    whitening: Any,
    innovations: Any,
    states: Any,
    known: Any,
) -> Any:
    """Innovations [rows, 9] of one run under frozen gains; `states` [rows, SIZE] receives the corrected states.

    Args:
        substeps: Runge-Kutta steps a row.
        known: corrected state [SIZE] at `first`; with zero numbers it is what the row measures.
        wrenches: further force (F_x, F_y) [N] and yaw moment [N m] on the body from each row to the next [rows, 3];
            none with zero rows.
        states: left alone if it has zero rows.
        others: as in `filter_run`.
    """
    rows = y.shape[0]
    z, k, w = np.zeros(SIZE), np.zeros(SIZE + 2), np.zeros((2, SIZE))
    predicted, nu, wrench = np.zeros(MEASURED), np.zeros(MEASURED), np.zeros(3)
    keep, acting = states.shape[0] == rows, wrenches.shape[0] == rows
    if known.shape[0] == SIZE:
        copied(known, z)
    else:
        first_state(y, first, used, delta, torque, constants, effects, z)
    innovations[: first + 1] = 0.0
    for row in range(first + 1 if keep else 0):
        copied(z, states[row])
    for row in range(first + 1, rows):
        if acting:
            copied(wrenches[row - 1], wrench)
        advance_row(z, delta, torque, row - 1, period, substeps, constants, effects, wrench, k, w)
        at = STAGES * row
        if acting:
            copied(wrenches[row], wrench)
        rates_of(z, delta[at], torque[at], constants, effects, wrench, k)
        predict_measurement(z, k[SIZE], k[SIZE + 1], effects, predicted)
        correct(y[row], used, predicted, gain[row], whitening[row], nu, z, innovations[row])
        if keep:
            copied(z, states[row])
