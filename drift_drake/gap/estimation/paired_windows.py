"""Windows of one run under several cars, LANES pairs of a window and a car at once: prediction errors.

Of cars whose internal states are slow, or few (`equations.STEPPED`): half an implicit step a row makes these follow
the measured motion up to each start.
"""

from typing import Any

import numpy as np

from drift_drake.car.actuated import STAGES
from drift_drake.car.compilation import compiled
from drift_drake.car.effects.magnitudes import COUNT, Effects, unbiased
from drift_drake.car.equations import decays, fastest, rates, settle
from drift_drake.car.integrate import runge_kutta
from drift_drake.car.lanes import LANES, load_lanes, load_lanes_tuple
from drift_drake.car.scalar import fixed_tuple, jitable, signed_floor, stored
from drift_drake.car.single_track.equations import NUMBERS, cars_in_lanes
from drift_drake.gap.estimation.filter_state import MIN_FILTER_SPEED, hold_speeds
from drift_drake.gap.estimation.lane_windows import write_errors

FOLLOWING = 0.0125  # [s] of a step of internal states along the measured motion, at most


@jitable
def _cars(constants: Any, effects: Any, car: Any, p: Any, q: Any) -> Any:
    """Each lane's car, of constants [cars, NUMBERS + 1] and effects [cars, COUNT]; p, q: scratch."""
    for lane in range(LANES):
        for i in range(NUMBERS + 1):
            p[i * LANES + lane] = constants[car[lane], i]
        for i in range(COUNT):
            q[i * LANES + lane] = effects[car[lane], i]
    return cars_in_lanes(p, q)


@jitable
def _commanded(delta: Any, torque: Any, car: Any, row: Any, step: Any, steps: Any, out: Any) -> Any:
    """Both commands of all lanes, of grids [cars, count], `step` of its steps behind each lane's row."""
    for lane in range(LANES):
        place = min(step / steps[lane], 1.0) * STAGES
        first = min(int(place), STAGES - 1)
        at, of, part = STAGES * row[lane] + first, car[lane], place - first
        out[lane] = delta[of, at] + part * (delta[of, at + 1] - delta[of, at])
        out[LANES + lane] = torque[of, at] + part * (torque[of, at + 1] - torque[of, at])
    return load_lanes(out, 0), load_lanes(out, 1)


@jitable
def _measured(y: Any, row: Any, step: Any, steps: Any, effects: Any, read: Any) -> Any:
    """What sensors y [rows, 5] read `step` of its steps behind each lane's row, their errors taken out."""
    for lane in range(LANES):
        share = step / steps[lane]
        for i in range(5):
            here, there = y[row[lane], i], y[min(row[lane] + 1, len(y) - 1), i]
            read[i * LANES + lane] = here + share * (there - here)
    r, v, beta, omega_r, psi = load_lanes_tuple(read, 0, 5)
    r, v, beta, omega_r = unbiased(r, v, beta, omega_r, effects)
    return r, v, beta, omega_r, psi


@jitable
def _start(y: Any, row: Any, step: Any, steps: Any, effects: Any, read: Any, z: Any) -> None:
    """The measured states, as the cars' z."""
    r, v, beta, omega_r, psi = _measured(y, row, step, steps, effects, read)
    for i, state in enumerate((r, signed_floor(v, MIN_FILTER_SPEED), beta, omega_r, psi)):
        stored(z, i, state)


@jitable
def _feed(y: Any, row: Any, step: Any, steps: Any, effects: Any, read: Any, z: Any) -> None:
    """The measured speeds as those of cars that still move."""
    _, v, _, omega_r, _ = _measured(y, row, step, steps, effects, read)
    stored(read, 0, v)
    stored(read, 1, omega_r)
    for lane in range(LANES):
        if step < steps[lane]:
            z[LANES + lane], z[3 * LANES + lane] = read[lane], read[LANES + lane]


@jitable
def _moved(z: Any, command: Any, car: Any, out: Any) -> None:
    """The rates times each lane's step."""
    of_cars, effects, wrench, h = car
    rates(z, command, (of_cars, effects, wrench), out)
    for i in range(len(z)):
        out[i] *= h[i % LANES]


@jitable
def _wrench(wrenches: Any, car: Any, row: Any, out: Any) -> Any:
    """Each lane's wrench, of some [cars, rows, 3]; zero where there are no rows."""
    if wrenches.shape[1] > 0:
        for lane in range(LANES):
            for i in range(3):
                out[i * LANES + lane] = wrenches[car[lane], row[lane], i]
    return load_lanes_tuple(out, 0, 3)


@jitable
def _set_steps(fastest_rates: Any, period: Any, bounds: Any, steps: Any) -> Any:
    """Sets the steps that each lane takes in a row; the most of them."""
    step, per_rate, most = bounds
    by_time, found = int(np.ceil(period / step - 1e-9)), 1
    for lane in range(LANES):
        by_rate = period * fastest_rates[lane] / per_rate
        steps[lane] = min(max(by_time, int(by_rate) + 1), most) if by_rate < most else most
        found = max(found, steps[lane])
    return found


@compiled
def follow_in_lanes(
    y: Any, starts: Any, delta: Any, torque: Any, period: Any, constants: Any, effects: Any, wrenches: Any, out: Any
) -> Any:  # fmt: skip
    """The internal states out [cars, windows, size] of cars along the measured motion y [rows, 5], at each start.

    The arguments are those of `predict_in_pairs`.
    """
    size = out.shape[2]
    z, k, decay = np.zeros(size * LANES), np.zeros(size * LANES), np.zeros(size * LANES)
    command, read, wrench_now = np.zeros(2 * LANES), np.zeros(5 * LANES), np.zeros(3 * LANES)
    p, q = np.zeros((NUMBERS + 1) * LANES), np.zeros(COUNT * LANES)
    car, row = np.zeros(LANES, np.int64), np.zeros(LANES, np.int64)
    count = max(2, int(np.ceil(period / FOLLOWING - 1e-9)))
    h, steps = period / count, np.full(LANES, count)
    for first in range(0, len(constants), LANES):
        for lane in range(LANES):
            car[lane] = min(first + lane, len(constants) - 1)
        of_cars, q_cars = _cars(constants, effects, car, p, q)
        row[:] = 0
        _start(y, row, 0.0, steps, q_cars, read, z)
        begin = _commanded(delta, torque, car, row, 0.0, steps, command)
        settle(z, begin[0], begin[1], of_cars, q_cars)
        for s in range(len(starts)):
            while row[0] < starts[s]:
                wrench = _wrench(wrenches, car, row, wrench_now)
                for step in range(count):
                    _start(y, row, step + 0.5, steps, q_cars, read, z)
                    here = _commanded(delta, torque, car, row, step + 0.5, steps, command)
                    rates(z, here, (of_cars, q_cars, wrench), k)
                    decays(z, of_cars, q_cars, decay)
                    for i in range(5 * LANES, size * LANES):
                        z[i] += h * k[i] / (1.0 + h * decay[i])
                row += 1
            for lane in range(min(LANES, len(constants) - first)):
                for i in range(size):
                    out[first + lane, s, i] = z[i * LANES + lane]


@compiled
def predict_in_pairs(
    start_y: Any, y: Any, starts: Any, stride_rows: Any, delta: Any, torque: Any, period: Any, constants: Any,
    effects: Any, fed: Any, wrenches: Any, bounds: Any, internal: Any, out: Any,
) -> Any:  # fmt: skip
    """Prediction errors out [cars, windows, horizons, 5], measured less predicted, of the windows of one run.

    Args:
        start_y, y: smoothed and raw measurements [rows, 5]; starts: rows [windows], ascending; stride_rows: between
            horizons; delta, torque: on the stages' grid (`actuated`), of each car [cars, count]; period: [s].
        constants [cars, NUMBERS + 1], effects [cars, COUNT]: the cars, without effects of actuators.
        fed: whether speeds are those of the measurement; wrenches: further force and moment on the body
            [cars, rows, 3] (`road.on_road`), none with zero rows.
        bounds: of a step [s], of a step times the fastest rate, and of steps a row.
        internal: of `follow_in_lanes`.
    """
    windows, size = len(starts), internal.shape[2]
    z, k, w = np.zeros(size * LANES), np.zeros(size * LANES), np.zeros((2, size * LANES))
    command, read, wrench_now = np.zeros(2 * LANES), np.zeros(5 * LANES), np.zeros(3 * LANES)
    p, q = np.zeros((NUMBERS + 1) * LANES), np.zeros(COUNT * LANES)
    car, window, row = np.zeros(LANES, np.int64), np.zeros(LANES, np.int64), np.zeros(LANES, np.int64)
    steps, h = np.ones(LANES, np.int64), np.zeros(LANES)
    pairs = len(constants) * windows
    for first in range(0, pairs, LANES):
        for lane in range(LANES):
            pair = min(first + lane, pairs - 1)
            car[lane], window[lane] = pair // windows, pair % windows
            row[lane] = starts[window[lane]]
            for i in range(5, size):
                z[i * LANES + lane] = internal[car[lane], window[lane], i]
        of_cars, q_cars = _cars(constants, effects, car, p, q)
        _start(start_y, row, 0.0, steps, q_cars, read, z)
        for horizon in range(out.shape[2]):
            for _ in range(stride_rows):
                wrench = _wrench(wrenches, car, row, wrench_now)
                stored(k, 0, fastest(load_lanes_tuple(z, 0, 4), of_cars, q_cars))
                begin = _commanded(delta, torque, car, row, 0.0, steps, command)
                for step in range(_set_steps(k, period, bounds, steps)):
                    for lane in range(LANES):  # one that is there already waits
                        h[lane] = period / steps[lane] if step < steps[lane] else 0.0
                    if fed:
                        _feed(start_y, row, float(step), steps, q_cars, read, z)
                    middle = _commanded(delta, torque, car, row, step + 0.5, steps, command)
                    end = _commanded(delta, torque, car, row, step + 1.0, steps, command)
                    runge_kutta(_moved, z, begin, middle, end, 1.0, (of_cars, q_cars, wrench, h), k, w)
                    begin = end
                    hold_speeds(z, q_cars[0])
                row += 1
            for lane in range(min(LANES, pairs - first)):
                own = Effects(*fixed_tuple(effects[car[lane]], COUNT))
                write_errors(y, row[lane], own, z, lane, LANES, out[car[lane], window[lane], horizon])
