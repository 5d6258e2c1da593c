"""Extended Kalman filter over the car, its pose and the effects' own states, compiled.

Filter state z [13]: r, v, beta, omega_r, psi, x, y, then the effects' memory: lateral slips front and rear, heats
front and rear, filtered accelerations a_x and a_y. The first nine carry a covariance; heats and filtered accelerations
follow from the estimated motion without a correction of their own.

Measurements [9] in the order of `CHANNELS`. The filter returns whitened innovations (mean square one where the model
and the noise levels are right) and, for each row, the gain and the whitening matrix. With those frozen, `observe`
evaluates the innovations of slightly different parameters some ten times faster: a prediction-error criterion, whose
derivatives by differences serve Gauss-Newton.
"""

from typing import Any

import numpy as np

from drift_drake.compilation import compiled
from drift_drake.diagnosis.commands import STAGES, SUBSTEPS
from drift_drake.vehicle.bicycle import MIN_SLIP_SPEED
from drift_drake.vehicle.effects import Memory, changed_constants, measured, motion_with_effects, settled_memory
from drift_drake.vehicle.scalar import cos, jitable, sin

CHANNELS = ("r", "v", "beta", "omega_r", "ax", "ay", "psi", "x", "y")
FILTER_STATES = ("r", "v", "beta", "omega_r", "psi", "x", "y", "front_slip", "rear_slip")
SIZE = 13  # of z
CORRECTED = 9  # of z, with a covariance
MEASURED = 9

UNMEASURED = 0.01  # first variance of a state that no sensor measures (sideslip: a tenth of a radian)
STABLE = 2.5  # rate times step up to which Runge-Kutta steps and the transition are stable
MOST_SPLITS, MOST_SQUARINGS = 15, 8
MIN_FILTER_SPEED = 0.6  # [m/s] at which estimated speeds are held: the slips' floors are no model of standstill


@jitable
def state_rates(
    z: Any, delta: Any, torque: Any, constants: Any, effects: Any, force_x: Any, force_y: Any, moment: Any
) -> Any:
    """Rates of z [13] and the body acceleration (a_x, a_y), on floats or complex numbers."""
    zero = 0.0 * z[0]
    memory = Memory(zero, zero, z[7], z[8], z[9], z[10], z[11], z[12])
    motion, rates = motion_with_effects(
        z[0], z[1], z[2], z[3], z[4], memory, delta + zero, torque + zero, constants, effects, force_x, force_y, moment
    )
    course = z[4] + z[2]
    return (
        motion.r_dot,
        motion.v_dot,
        motion.beta_dot,
        motion.omega_r_dot,
        z[0],
        z[1] * cos(course),
        z[1] * sin(course),
        rates.front_slip,
        rates.rear_slip,
        rates.front_heat,
        rates.rear_heat,
        rates.a_x,
        rates.a_y,
        motion.a_x,
        motion.a_y,
    )


@compiled
def rates_of(z: Any, delta: Any, torque: Any, constants: Any, effects: Any, push: Any, out: Any) -> Any:
    rates = state_rates(z, delta, torque, constants, effects, push[0], push[1], push[2])
    out[0], out[1], out[2], out[3], out[4], out[5], out[6] = rates[:7]
    out[7], out[8], out[9], out[10], out[11], out[12], out[13], out[14] = rates[7:]


@compiled
def wheel_rate(z: Any, constants: Any, effects: Any) -> Any:
    """Rate [1/s] at which the driven rim settles in grip: of all rates the fastest."""
    p = changed_constants(constants, effects)
    stiffness = p.rear_stiffness + p.front_coupling * p.front_stiffness
    return stiffness * p.wheel_radius**2 / (p.rear_axle_inertia * max(z[3], MIN_SLIP_SPEED))


@compiled
def between(values: Any, place: Any) -> Any:
    """Linear between the grid's points; `place` counts them."""
    i = min(int(place), len(values) - 2)
    return values[i] + (place - i) * (values[i + 1] - values[i])


@compiled
def advance(
    z: Any, delta: Any, torque: Any, row: Any, step: Any, constants: Any, effects: Any, push: Any, k: Any, w: Any
) -> Any:
    """One row of Runge-Kutta steps, in place, under a further force and moment; k [15], w [2, 13] are scratch.

    The steps are split where the driven rim of a light axle settles faster than they could follow.
    """
    splits = min(int(step * wheel_rate(z, constants, effects) / STABLE), MOST_SPLITS) + 1
    h = step / splits
    for substep in range(SUBSTEPS * splits):
        at = STAGES * row + 2.0 * substep / splits
        end = at + 2.0 / splits
        middle = 0.5 * (at + end)
        rates_of(z, between(delta, at), between(torque, at), constants, effects, push, k)
        for i in range(SIZE):
            w[1, i] = k[i]
            w[0, i] = z[i] + 0.5 * h * k[i]
        rates_of(w[0], between(delta, middle), between(torque, middle), constants, effects, push, k)
        for i in range(SIZE):
            w[1, i] += 2.0 * k[i]
            w[0, i] = z[i] + 0.5 * h * k[i]
        rates_of(w[0], between(delta, middle), between(torque, middle), constants, effects, push, k)
        for i in range(SIZE):
            w[1, i] += 2.0 * k[i]
            w[0, i] = z[i] + h * k[i]
        rates_of(w[0], between(delta, end), between(torque, end), constants, effects, push, k)
        for i in range(SIZE):
            z[i] += h / 6.0 * (w[1, i] + k[i])
        z[1] = max(z[1], MIN_FILTER_SPEED)
        z[3] = max(z[3], 0.0)


@compiled
def _start(y: Any, first: Any, used: Any, delta: Any, torque: Any, constants: Any, effects: Any, z: Any) -> Any:
    """The filter's first state: what its first row measures, sensors' biases taken out, and settled effects."""
    z[0] = y[first, 0] - effects.gyro_bias
    z[1] = max(y[first, 1], MIN_FILTER_SPEED)
    z[2] = y[first, 2] - effects.sideslip_bias if used[2] else y[first, 2]
    z[3] = y[first, 3] / (1.0 + effects.wheel_radius_error) if used[3] else z[1]
    for i in range(3):
        z[4 + i] = y[first, 6 + i] if used[6 + i] else 0.0
    at = STAGES * first
    memory = settled_memory(z[0], z[1], z[2], z[3], delta[at], torque[at], constants, effects)
    z[7], z[8], z[9], z[10], z[11], z[12] = memory[2:]


@compiled
def predict_measurement(z: Any, a_x: Any, a_y: Any, effects: Any, out: Any) -> Any:
    out[0], out[2], out[3] = measured(z[0], z[2], z[3], effects)
    out[1] = z[1]
    out[4], out[5] = a_x, a_y
    out[6], out[7], out[8] = z[4], z[5], z[6]


@compiled
def _linearise(
    z: Any,
    delta: Any,
    torque: Any,
    constants: Any,
    effects: Any,
    relaxed: Any,
    graded: Any,
    probe: Any,
    out: Any,
    jacobian: Any,
) -> Any:
    """Complex-step Jacobian [15, 9] of the rates and accelerations with respect to the corrected states."""
    for j in range(CORRECTED):
        for i in range(SIZE + 2):
            jacobian[i, j] = 0.0
    for j in range(CORRECTED):
        if j == 5 or j == 6 or (j == 4 and not graded) or (j >= 7 and not relaxed):
            continue
        for i in range(SIZE):
            probe[i] = z[i]
        probe[j] += 1e-20j
        rates = state_rates(probe, delta, torque, constants, effects, 0.0, 0.0, 0.0)
        out[0], out[1], out[2], out[3], out[4], out[5], out[6] = rates[:7]
        out[7], out[8], out[9], out[10], out[11], out[12], out[13], out[14] = rates[7:]
        for i in range(SIZE + 2):
            jacobian[i, j] = out[i].imag * 1e20
    course = z[4] + z[2]
    if not graded:
        jacobian[5, 4] = -z[1] * np.sin(course)
        jacobian[6, 4] = z[1] * np.cos(course)


@compiled
def _transition(jacobian: Any, period: Any, f: Any, power: Any, scratch: Any) -> Any:
    """exp(A period) to fourth order, A the first nine rows of the Jacobian.

    Where the rim settles too fast for that, of a part of the period, and squared back to the whole.
    """
    n = CORRECTED
    squarings = 0
    while -jacobian[3, 3] * period > STABLE and squarings < MOST_SQUARINGS:
        period *= 0.5
        squarings += 1
    for i in range(n):
        for j in range(n):
            f[i, j] = 1.0 if i == j else 0.0
            power[i, j] = f[i, j]
    for order in range(1, 5):
        for i in range(n):
            for j in range(n):
                total = 0.0
                for m in range(n):
                    total += jacobian[i, m] * power[m, j]
                scratch[i, j] = total * period / order
        for i in range(n):
            for j in range(n):
                power[i, j] = scratch[i, j]
                f[i, j] += power[i, j]
    for _ in range(squarings):
        for i in range(n):
            for j in range(n):
                total = 0.0
                for m in range(n):
                    total += f[i, m] * f[m, j]
                power[i, j] = total
        f[:] = power


@compiled
def filter_run(
    y: Any,
    first: Any,
    used: Any,
    delta: Any,
    torque: Any,
    period: Any,
    constants: Any,
    effects: Any,
    noise: Any,
    process: Any,
    innovations: Any,
    gain: Any,
    whitening: Any,
) -> Any:
    """Extended Kalman filter over one run.

    Args:
        y: measurements [rows, 9] in the order of CHANNELS; first: row to start from, whose innovations and those
            before are left zero; used: which channels count [9].
        delta, torque: on the stages' grid (`commands.actuated`); period: [s]; constants, effects: the car.
        noise: measurement variances [9]; process: process noise of the first nine states, variance a second [9].
        innovations [rows, 9], gain [rows, 9, 9] (states by channels), whitening [rows, 9, 9]: filled.
    """
    rows = y.shape[0]
    step = period / SUBSTEPS
    z, k, w = np.zeros(SIZE), np.zeros(SIZE + 2), np.zeros((2, SIZE))
    probe, out = np.zeros(SIZE, np.complex128), np.zeros(SIZE + 2, np.complex128)
    jacobian = np.zeros((SIZE + 2, CORRECTED))
    n, m = CORRECTED, MEASURED
    p, f, t = np.zeros((n, n)), np.zeros((n, n)), np.zeros((n, n))
    scratch = np.zeros((n, n))
    h, ph, s, low = np.zeros((m, n)), np.zeros((n, m)), np.zeros((m, m)), np.zeros((m, m))
    predicted, nu, push = np.zeros(m), np.zeros(m), np.zeros(3)
    relaxed = effects.tyre_relaxation > 0.0
    graded = effects.road_grade != 0.0
    for i in range(m):
        scale = effects.wheel_radius_error + 1.0 if i == 3 else 1.0
        if i == 0 or i == 1 or i == 2 or i == 3:
            h[i, i] = scale
        elif i >= 6:
            h[i, i - 2] = 1.0
    _start(y, first, used, delta, torque, constants, effects, z)
    for i in range(4):
        p[i, i] = noise[i] if used[i] else UNMEASURED
    for i in range(3):
        p[4 + i, 4 + i] = noise[6 + i] if used[6 + i] else 0.0
    if relaxed:
        p[7, 7] = p[8, 8] = 1e-4
    innovations[: first + 1] = 0.0
    gain[: first + 1] = 0.0
    whitening[: first + 1] = 0.0
    _linearise(
        z, delta[STAGES * first], torque[STAGES * first], constants, effects, relaxed, graded, probe, out, jacobian
    )
    for row in range(first + 1, rows):
        _transition(jacobian, period, f, t, scratch)
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
        advance(z, delta, torque, row - 1, step, constants, effects, push, k, w)
        at = STAGES * row
        _linearise(z, delta[at], torque[at], constants, effects, relaxed, graded, probe, out, jacobian)
        rates_of(z, delta[at], torque[at], constants, effects, push, k)
        predict_measurement(z, k[13], k[14], effects, predicted)
        for j in range(n):
            h[4, j] = jacobian[13, j]
            h[5, j] = jacobian[14, j]
        for i in range(n):
            for j in range(m):
                total = 0.0
                for c in range(n):
                    total += p[i, c] * h[j, c]
                ph[i, j] = total if used[j] else 0.0
        for i in range(m):
            for j in range(m):
                total = 0.0
                for c in range(n):
                    total += h[i, c] * ph[c, j]
                s[i, j] = total if used[i] else 0.0
            s[i, i] += noise[i] if used[i] else 1.0
        # Cholesky factor of s, its inverse (the whitening matrix), and the gain p h' s^-1.
        for i in range(m):
            for j in range(i + 1):
                total = s[i, j]
                for c in range(j):
                    total -= low[i, c] * low[j, c]
                low[i, j] = np.sqrt(max(total, 1e-18)) if i == j else total / low[j, j]
        for j in range(m):
            for i in range(m):
                if i < j:
                    whitening[row, i, j] = 0.0
                elif i == j:
                    whitening[row, i, j] = 1.0 / low[i, i]
                else:
                    total = 0.0
                    for c in range(j, i):
                        total += low[i, c] * whitening[row, c, j]
                    whitening[row, i, j] = -total / low[i, i]
        for i in range(n):
            for j in range(m):
                total = 0.0
                for c in range(j + 1):
                    total += ph[i, c] * whitening[row, j, c]
                t[i, j] = total  # p h' L^-T
        for i in range(n):
            for j in range(m):
                total = 0.0
                for c in range(j, m):
                    total += t[i, c] * whitening[row, c, j]
                gain[row, i, j] = total if used[j] else 0.0
            for j in range(i + 1):
                total = 0.0
                for c in range(m):
                    total += t[i, c] * t[j, c]
                scratch[i, j] = total
        for i in range(n):
            for j in range(i + 1):
                p[i, j] -= scratch[i, j]
                p[j, i] = p[i, j]
        _correct(y, row, used, predicted, gain, whitening, nu, z, innovations)


@compiled
def _correct(
    y: Any, row: Any, used: Any, predicted: Any, gain: Any, whitening: Any, nu: Any, z: Any, innovations: Any
) -> Any:
    for j in range(MEASURED):
        nu[j] = y[row, j] - predicted[j] if used[j] else 0.0
    for i in range(MEASURED):
        total = 0.0
        for j in range(i + 1):
            total += whitening[row, i, j] * nu[j]
        innovations[row, i] = total
    for i in range(CORRECTED):
        total = 0.0
        for j in range(MEASURED):
            total += gain[row, i, j] * nu[j]
        z[i] += total
    z[1] = max(z[1], MIN_FILTER_SPEED)
    z[3] = max(z[3], 0.0)


@compiled
def observe_run(
    y: Any,
    first: Any,
    used: Any,
    delta: Any,
    torque: Any,
    period: Any,
    constants: Any,
    effects: Any,
    pushes: Any,
    gain: Any,
    whitening: Any,
    innovations: Any,
    states: Any,
) -> Any:
    """Innovations [rows, 9] of one run under frozen gains; `states` [rows, 13] receives the corrected states.

    Args:
        pushes: further force (F_x, F_y) [N] and yaw moment [N m] on the body from each row to the next [rows, 3];
            none with zero rows.
        states: left alone if it has zero rows.
        others: as in `filter_run`.
    """
    rows = y.shape[0]
    step = period / SUBSTEPS
    z, k, w = np.zeros(SIZE), np.zeros(SIZE + 2), np.zeros((2, SIZE))
    predicted, nu, push = np.zeros(MEASURED), np.zeros(MEASURED), np.zeros(3)
    keep, pushed = states.shape[0] == rows, pushes.shape[0] == rows
    _start(y, first, used, delta, torque, constants, effects, z)
    innovations[: first + 1] = 0.0
    if keep:
        states[: first + 1] = z
    for row in range(first + 1, rows):
        if pushed:
            push[:] = pushes[row - 1]
        advance(z, delta, torque, row - 1, step, constants, effects, push, k, w)
        at = STAGES * row
        if pushed:
            push[:] = pushes[row]
        rates_of(z, delta[at], torque[at], constants, effects, push, k)
        predict_measurement(z, k[13], k[14], effects, predicted)
        _correct(y, row, used, predicted, gain, whitening, nu, z, innovations)
        if keep:
            states[row] = z
