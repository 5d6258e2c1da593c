"""The diagnosis's filter state: how it moves, what is measured of it, and both linearised; compiled.

z: r, v, beta, omega_r, psi, x, y, then the effects' internal states: lateral slips front and rear, heats front and
rear, filtered accelerations a_x and a_y, and states of effects from other packages. Measurements [9] are in the order
of `CHANNELS`.

The commands are known exactly, so that what actuators make of them is computed once, ahead of the filter, on the grid
of times that its Runge-Kutta stages use (`car.actuated`).
"""

from typing import Any

import numpy as np

from drift_drake.car.actuated import STAGES
from drift_drake.car.compilation import compiled, copied
from drift_drake.car.effects.magnitudes import (
    InternalStates,
    measured,
    unbiased,
)
from drift_drake.car.integrate import runge_kutta
from drift_drake.car.scalar import cos, fixed_tuple, jitable, signed_floor, sin
from drift_drake.car.single_track.equations import HELD, wheel_rate
from drift_drake.car.single_track.motion_with_effects import (
    motion_with_effects,
    settled_internal_states,
)

SUBSTEPS = STAGES // 2  # Runge-Kutta steps a row: a step's middle is a stage too
CHANNELS = ("r", "v", "beta", "omega_r", "ax", "ay", "psi", "x", "y")
FILTER_STATES = ("r", "v", "beta", "omega_r", "psi", "x", "y", "front_slip", "rear_slip")
SIZE = 7 + HELD  # of z
CORRECTED = 9  # of z, with a covariance
MEASURED = 9
UNRELAXED = 7  # of the corrected, that are left where tyres do not relax: none moves by the others, nor do these
FREE = 5  # of them, by which others move: none does by the place
STABLE = 2.5  # rate times step up to which Runge-Kutta steps and the transition are stable
MOST_SPLITS, MOST_SQUARINGS = 15, 8
MIN_FILTER_SPEED = (
    0.6  # [m/s] at which estimated speeds are held, either way: the slips' floors are no model of standstill
)
DIFFERENCE = 1e-4  # of a state, in its own unit


@jitable
def state_rates(
    z: Any, delta: Any, torque: Any, constants: Any, effects: Any, force_x: Any, force_y: Any, moment: Any
) -> Any:
    """Rates of z and the body acceleration (a_x, a_y)."""
    zero = 0.0 * z[0]
    internal = InternalStates(*((zero, zero) + fixed_tuple(z[7:], HELD)))  # noqa: RUF005 (for numba)
    motion, rates = motion_with_effects(
        z[0],
        z[1],
        z[2],
        z[3],
        z[4],
        internal,
        delta + zero,
        torque + zero,
        constants,
        effects,
        force_x,
        force_y,
        moment,
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
        *rates[2:],
        motion.a_x,
        motion.a_y,
    )


@jitable
def rates_of(z: Any, delta: Any, torque: Any, constants: Any, effects: Any, wrench: Any, out: Any) -> Any:
    rates = state_rates(z, delta, torque, constants, effects, wrench[0], wrench[1], wrench[2])
    for i, rate in enumerate(rates):
        out[i] = rate


@jitable
def _rates(z: Any, command: Any, car: Any, out: Any) -> Any:
    rates_of(z, command[0], command[1], car[0], car[1], car[2], out)


@compiled
def between(values: Any, place: Any) -> Any:
    """Linear between the grid's points; `place` counts them."""
    i = min(int(place), len(values) - 2)
    return values[i] + (place - i) * (values[i + 1] - values[i])


@jitable
def commanded(delta: Any, torque: Any, place: Any) -> Any:
    """Both commands at a place of their grid."""
    return between(delta, place), between(torque, place)


@jitable
def hold_speeds(z: Any) -> None:
    """Holds an estimated speed from standstill, and its rim from turning against it, in place."""
    z[1] = signed_floor(z[1], MIN_FILTER_SPEED)
    z[3] = max(z[3], 0.0) if z[1] > 0.0 else min(z[3], 0.0)


@jitable
def filter_step(
    z: Any,
    delta: Any,
    torque: Any,
    at: Any,
    end: Any,
    h: Any,
    constants: Any,
    effects: Any,
    wrench: Any,
    k: Any,
    w: Any,
) -> Any:
    """One step of h seconds, in place, between two places of the commands' grid.

    k [SIZE + 2] and w [2, SIZE] are scratch.
    """
    first, middle = commanded(delta, torque, at), commanded(delta, torque, 0.5 * (at + end))
    runge_kutta(_rates, z, first, middle, commanded(delta, torque, end), h, (constants, effects, wrench), k, w)
    hold_speeds(z)


@compiled
def advance_row(
    z: Any, delta: Any, torque: Any, row: Any, period: Any, substeps: Any, constants: Any, effects: Any, wrench: Any,
    k: Any, w: Any,
) -> Any:  # fmt: skip
    """One row of Runge-Kutta steps, in place, under a further force and moment; k [SIZE + 2], w [2, SIZE] are scratch.

    The steps are split where the driven rim of a light axle settles faster than they could follow.
    """
    step = period / substeps
    splits = min(int(step * wheel_rate(z[3], constants, effects) / STABLE), MOST_SPLITS) + 1
    h, stages = step / splits, STAGES / (substeps * splits)
    for substep in range(substeps * splits):
        at = STAGES * row + stages * substep
        filter_step(z, delta, torque, at, at + stages, h, constants, effects, wrench, k, w)


@compiled
def first_state(y: Any, first: Any, used: Any, delta: Any, torque: Any, constants: Any, effects: Any, z: Any) -> Any:
    """The filter's first state: what its first row measures, sensors' biases taken out, and settled effects."""
    r, v, beta, omega_r = unbiased(y[first, 0], y[first, 1], y[first, 2], y[first, 3], effects)
    z[0] = r
    z[1] = signed_floor(v, MIN_FILTER_SPEED)
    z[2] = beta if used[2] else y[first, 2]
    z[3] = omega_r if used[3] else z[1]
    for i in range(3):
        z[4 + i] = y[first, 6 + i] if used[6 + i] else 0.0
    at = STAGES * first
    internal = settled_internal_states(z[0], z[1], z[2], z[3], delta[at], torque[at], constants, effects)
    for i, state in enumerate(internal[2:]):
        z[7 + i] = state


@compiled
def predict_measurement(z: Any, a_x: Any, a_y: Any, effects: Any, out: Any) -> Any:
    out[0], out[1], out[2], out[3] = measured(z[0], z[1], z[2], z[3], effects)
    out[4], out[5] = a_x, a_y
    out[6], out[7], out[8] = z[4], z[5], z[6]


@compiled
def linearise(
    z: Any,
    delta: Any,
    torque: Any,
    constants: Any,
    effects: Any,
    relaxed: Any,
    graded: Any,
    probe: Any,
    jacobian: Any,
) -> Any:
    """Jacobian [SIZE + 2, 9] of the rates and accelerations by the corrected states, by central differences: a mirrored
    motion has the mirrored one. `probe` [SIZE] is scratch."""
    for j in range(CORRECTED):
        for i in range(SIZE + 2):
            jacobian[i, j] = 0.0
    copied(z, probe)
    for j in range(CORRECTED):
        if j == 5 or j == 6 or (j == 4 and not graded) or (j >= 7 and not relaxed):
            continue
        for moved in (DIFFERENCE, -DIFFERENCE):
            probe[j] = z[j] + moved
            for i, rate in enumerate(state_rates(probe, delta, torque, constants, effects, 0.0, 0.0, 0.0)):
                jacobian[i, j] += rate / (2.0 * moved)
        probe[j] = z[j]
    course = z[4] + z[2]
    if not graded:
        jacobian[5, 4] = -z[1] * np.sin(course)
        jacobian[6, 4] = z[1] * np.cos(course)


@compiled
def transition(jacobian: Any, period: Any, n: Any, f: Any, power: Any, scratch: Any) -> Any:
    """exp(A period) to fourth order, A the first n rows and columns of the Jacobian.

    Where the rim settles too fast for that, of a part of the period, and squared back to the whole.
    """
    by = n if n > UNRELAXED else FREE
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
            for j in range(by):
                total = 0.0
                for m in range(by):
                    total += jacobian[i, m] * power[m, j]
                scratch[i, j] = total * period / order
        for i in range(n):
            for j in range(by):
                power[i, j] = scratch[i, j]
                f[i, j] += power[i, j]
    for _ in range(squarings):
        for i in range(n):
            for j in range(n):
                total = 0.0
                for m in range(n):
                    total += f[i, m] * f[m, j]
                power[i, j] = total
        for i in range(n):
            copied(power[i], f[i])
