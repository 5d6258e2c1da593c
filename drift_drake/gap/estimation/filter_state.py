"""The diagnosis's filter state: how it moves, what is measured of it, and both linearised; compiled.

z: r, v, beta, omega_r, psi, x, y, then the effects' internal states: lateral slips front and rear, heats front and
rear, filtered accelerations a_x and a_y, and states of effects from other packages. Measurements [9] are in the order
of `CHANNELS`.

The commands are known exactly, so that what actuators make of them is computed once, ahead of the filter, on the grid
of times that its Runge-Kutta stages use (`car.actuated`).

Where magnitudes of effects are given as `LANES` numbers each, so are a car's constants, and arrays hold as many cars.
"""

from typing import Any

from drift_drake.car.actuated import STAGES
from drift_drake.car.compilation import compiled, copied
from drift_drake.car.effects.magnitudes import (
    InternalStates,
    measured,
    unbiased,
)
from drift_drake.car.integrate import runge_kutta
from drift_drake.car.scalar import (
    anywhere,
    cos,
    jitable,
    length,
    loaded,
    loaded_tuple,
    maximum,
    minimum,
    select,
    signed_floor,
    sin,
    stored,
)
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
    r, v, beta, omega_r, psi = loaded_tuple(z, 0, 5, effects[0])
    zero = 0.0 * r
    internal = InternalStates(*((zero, zero) + loaded_tuple(z, 7, HELD, effects[0])))  # noqa: RUF005 (for numba)
    motion, rates = motion_with_effects(r, v, beta, omega_r, psi, internal, delta + zero, torque + zero, constants,
                                        effects, force_x, force_y, moment)  # fmt: skip
    course = psi + beta
    along = motion.r_dot, motion.v_dot, motion.beta_dot, motion.omega_r_dot, r, v * cos(course), v * sin(course)
    return along + rates[2:] + (motion.a_x, motion.a_y)


@jitable
def rates_of(z: Any, delta: Any, torque: Any, constants: Any, effects: Any, wrench: Any, out: Any) -> Any:
    rates = state_rates(z, delta, torque, constants, effects, wrench[0], wrench[1], wrench[2])
    for i, rate in enumerate(rates):
        stored(out, i, rate)


@jitable
def _rates(z: Any, command: Any, car: Any, out: Any) -> Any:
    rates_of(z, command[0], command[1], car[0], car[1], car[2], out)


@jitable
def _between(values: Any, i: Any, share: Any, like: Any) -> Any:
    """Linear between one of an array's numbers and the next."""
    here = loaded(values, i, like)
    return here + share * (loaded(values, i + 1, like) - here)


@jitable
def commanded(delta: Any, torque: Any, place: Any, like: Any = 0.0) -> Any:
    """Both commands at a place of their grid."""
    i = min(int(place), length(delta, like) - 2)
    return _between(delta, i, place - i, like), _between(torque, i, place - i, like)


@jitable
def hold_speeds(z: Any, like: Any = 0.0) -> None:
    """Holds an estimated speed from standstill, and its rim from turning against it, in place."""
    v, omega_r = signed_floor(loaded(z, 1, like), MIN_FILTER_SPEED), loaded(z, 3, like)
    stored(z, 1, v)
    stored(z, 3, select(0.0, v, maximum(omega_r, 0.0), minimum(omega_r, 0.0)))


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
    first, middle = commanded(delta, torque, at, effects[0]), commanded(delta, torque, 0.5 * (at + end), effects[0])
    last = commanded(delta, torque, end, effects[0])
    runge_kutta(_rates, z, first, middle, last, h, (constants, effects, wrench), k, w)
    hold_speeds(z, effects[0])


@compiled
def advance_row(
    z: Any, delta: Any, torque: Any, row: Any, period: Any, substeps: Any, constants: Any, effects: Any, wrench: Any,
    k: Any, w: Any,
) -> Any:  # fmt: skip
    """One row of Runge-Kutta steps, in place, under a further force and moment; k [SIZE + 2], w [2, SIZE] are scratch.

    The steps are split where the driven rim of a light axle settles faster than they could follow.
    """
    step, fastest = period / substeps, 0.0
    stored(k, 0, wheel_rate(loaded(z, 3, effects[0]), constants, effects))
    for car in range(len(z) // SIZE):
        fastest = max(fastest, k[car])
    splits = int(min(step * fastest / STABLE, float(MOST_SPLITS))) + 1
    h, stages = step / splits, STAGES / (substeps * splits)
    for substep in range(substeps * splits):
        at = STAGES * row + stages * substep
        filter_step(z, delta, torque, at, at + stages, h, constants, effects, wrench, k, w)


@compiled
def first_state(y: Any, used: Any, delta: Any, torque: Any, constants: Any, effects: Any, z: Any) -> Any:
    """The filter's first state: what its first row measures, sensors' biases taken out, and settled effects.

    Args:
        y: measurement [9]; delta, torque: the commands there.
    """
    raw = loaded_tuple(y, 0, MEASURED, effects[0])
    r, v, beta, omega_r = unbiased(raw[0], raw[1], raw[2], raw[3], effects)
    v = signed_floor(v, MIN_FILTER_SPEED)
    beta, omega_r = beta if used[2] else raw[2] + 0.0 * beta, omega_r if used[3] else v
    zero = 0.0 * r
    place = raw[6] if used[6] else zero, raw[7] if used[7] else zero, raw[8] if used[8] else zero
    start = (r, v, beta, omega_r) + place  # noqa: RUF005 (for numba)
    settled = settled_internal_states(r, v, beta, omega_r, delta, torque, constants, effects)
    for i, state in enumerate(start + settled[2:]):
        stored(z, i, state)


@compiled
def predict_measurement(z: Any, a_x: Any, a_y: Any, effects: Any, out: Any) -> Any:
    r, v, beta, omega_r, psi, x, y = loaded_tuple(z, 0, 7, effects[0])
    for i, value in enumerate(measured(r, v, beta, omega_r, effects) + (a_x, a_y, psi, x, y)):  # noqa: RUF005 (for numba)
        stored(out, i, value)


@compiled
def linearise(
    z: Any, delta: Any, torque: Any, constants: Any, effects: Any, relaxed: Any, graded: Any, probe: Any, jacobian: Any
) -> Any:  # fmt: skip
    """Jacobian [SIZE + 2, 9] of the rates and accelerations by the corrected states, by central differences: a mirrored
    motion has the mirrored one. `probe` [SIZE] is scratch."""
    like, zero = effects[0], 0.0 * effects[0]
    jacobian[:] = 0.0
    copied(z, probe)
    for j in range(CORRECTED):
        if j == 5 or j == 6 or (j == 4 and not graded) or (j >= 7 and not relaxed):
            continue
        here = loaded(z, j, like)
        for moved in (DIFFERENCE, -DIFFERENCE):
            stored(probe, j, here + moved)
            for i, rate in enumerate(state_rates(probe, delta, torque, constants, effects, zero, zero, zero)):
                stored(jacobian[i], j, loaded(jacobian[i], j, like) + rate / (2.0 * moved))
        stored(probe, j, here)
    if not graded:
        v, course = loaded(z, 1, like), loaded(z, 4, like) + loaded(z, 2, like)
        stored(jacobian[5], 4, -v * sin(course))
        stored(jacobian[6], 4, v * cos(course))


@jitable
def product(a: Any, i: Any, b: Any, j: Any, begin: Any, end: Any, like: Any) -> Any:
    """Sum of a[i, c] b[c, j] over c from `begin` to before `end`; like: one of the car's numbers, here and below."""
    total = loaded(a[i], begin, like) * loaded(b[begin], j, like)
    for c in range(begin + 1, end):
        total = total + loaded(a[i], c, like) * loaded(b[c], j, like)
    return total


@compiled
def transition(jacobian: Any, period: Any, n: Any, f: Any, power: Any, scratch: Any, like: Any) -> Any:
    """exp(A period) to fourth order, A the first n rows and columns of the Jacobian.

    Where the rim settles too fast for that, of a part of the period, and squared back to the whole.
    """
    by, one = n if n > UNRELAXED else FREE, 1.0 + 0.0 * like
    part, halvings = period * one, 0.0 * like
    for _ in range(MOST_SQUARINGS):
        fast = select(STABLE, -loaded(jacobian[3], 3, like) * part, one, 0.0)
        part, halvings = part * (1.0 - 0.5 * fast), halvings + fast
    for i in range(n):
        for j in range(n):
            stored(f[i], j, one if i == j else 0.0 * like)
            stored(power[i], j, loaded(f[i], j, like))
    for order in range(1, 5):
        for i in range(n):
            for j in range(by):
                stored(scratch[i], j, product(jacobian, i, power, j, 0, by, like) * part / order)
        for i in range(n):
            for j in range(by):
                term = loaded(scratch[i], j, like)
                stored(power[i], j, term)
                stored(f[i], j, loaded(f[i], j, like) + term)
    for squaring in range(MOST_SQUARINGS):
        more = select(squaring * one, halvings, one, 0.0)
        if not anywhere(more):
            break
        for i in range(n):
            for j in range(n):
                squared = product(f, i, f, j, 0, n, like)
                stored(power[i], j, select(0.0, more, squared, loaded(f[i], j, like)))
        for i in range(n):
            copied(power[i], f[i])
