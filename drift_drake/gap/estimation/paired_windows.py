"""Windows of one run under several cars of one kind, LANES pairs of a window and a car at once: prediction errors."""

from typing import Any

import numpy as np

from drift_drake.car.actuated import STAGES
from drift_drake.car.compilation import compiled
from drift_drake.car.effects.magnitudes import COUNT, Effects, unbiased
from drift_drake.car.equations import cars_in_lanes, fastest, rates
from drift_drake.car.integrate import runge_kutta
from drift_drake.car.lanes import LANES, load_lanes, load_lanes_tuple
from drift_drake.car.scalar import fixed_tuple, jitable, signed_floor, stored
from drift_drake.gap.estimation.filter_state import MIN_FILTER_SPEED, hold_speeds


@jitable
def cars_of(constants: Any, effects: Any, car: Any, like: Any, p: Any, q: Any) -> Any:
    """Each lane's car, of constants [cars, n] and effects [cars, COUNT]; p, q: scratch."""
    for lane in range(LANES):
        for i in range(constants.shape[1]):
            p[i * LANES + lane] = constants[car[lane], i]
        for i in range(COUNT):
            q[i * LANES + lane] = effects[car[lane], i]
    return cars_in_lanes(p, q, like)


@jitable
def commanded_in(delta: Any, torque: Any, car: Any, row: Any, step: Any, steps: Any, out: Any) -> Any:
    """Both commands of all lanes, of grids [cars, count], `step` of its steps behind each lane's row."""
    for lane in range(LANES):
        place = min(step * (STAGES / steps[lane]), float(STAGES))
        first = min(int(place), STAGES - 1)
        at, part = STAGES * row[lane] + first, place - first
        angles, torques = delta[car[lane]], torque[car[lane]]
        out[lane] = angles[at] + part * (angles[at + 1] - angles[at])
        out[LANES + lane] = torques[at] + part * (torques[at + 1] - torques[at])
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
def start_measured(y: Any, row: Any, step: Any, steps: Any, effects: Any, read: Any, z: Any) -> None:
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
    step = load_lanes(h, 0)
    for i in range(len(z) // LANES):
        stored(out, i, step * load_lanes(out, i))


@jitable
def wrench_of(wrenches: Any, car: Any, row: Any, out: Any) -> Any:
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


@jitable
def advance(z: Any, row: Any, lanes_of: Any, of: Any, logged: Any, period: Any, bounds: Any, scratch: Any) -> None:
    """The states z of all lanes a row later, in place, each in steps of its own.

    Args:
        row: of each lane; lanes_of: the cars and effects; of: index of each lane's car; logged: start_y, delta, torque,
            wrenches and whether speeds are fed, as of `predict_in_pairs`; scratch: of `scratch_of`.
    """
    of_cars, q_cars = lanes_of
    y, delta, torque, wrenches, fed = logged
    k, w, command, read, wrench_now, steps, h = scratch
    wrench = wrench_of(wrenches, of, row, wrench_now)
    stored(k, 0, fastest(load_lanes_tuple(z, 0, 4), of_cars, q_cars))
    begin = commanded_in(delta, torque, of, row, 0.0, steps, command)
    for step in range(_set_steps(k, period, bounds, steps)):
        for lane in range(LANES):  # one that is there already waits
            h[lane] = period / steps[lane] if step < steps[lane] else 0.0
        if fed:
            _feed(y, row, float(step), steps, q_cars, read, z)
        middle = commanded_in(delta, torque, of, row, step + 0.5, steps, command)
        end = commanded_in(delta, torque, of, row, step + 1.0, steps, command)
        runge_kutta(_moved, z, begin, middle, end, 1.0, (of_cars, q_cars, wrench, h), k, w)
        begin = end
        hold_speeds(z, q_cars[0])


@jitable
def scratch_of(size: Any) -> Any:
    """What `advance` writes to: rates, work, commands, measurements, wrenches, steps, their lengths."""
    return (np.zeros(size * LANES), np.zeros((2, size * LANES)), np.zeros(2 * LANES), np.zeros(5 * LANES),
            np.zeros(3 * LANES), np.ones(LANES, np.int64), np.zeros(LANES))  # fmt: skip


@jitable
def _write_errors(y: Any, end: Any, effects: Any, z: Any, lane: Any, out: Any) -> None:
    """Writes the errors [5] at a row of one lane of the cars z [size * LANES]."""
    r, v, beta, omega_r = unbiased(y[end, 0], y[end, 1], y[end, 2], y[end, 3], effects)
    out[0], out[1] = r - z[lane], v - z[LANES + lane]
    out[2], out[3] = beta - z[2 * LANES + lane], omega_r - z[3 * LANES + lane]
    out[4] = y[end, 4] - z[4 * LANES + lane]


@compiled
def predict_in_pairs(
    start_y: Any, y: Any, starts: Any, stride_rows: Any, delta: Any, torque: Any, period: Any, like: Any,
    constants: Any, effects: Any, fed: Any, wrenches: Any, bounds: Any, internal: Any, out: Any,
) -> Any:  # fmt: skip
    """Prediction errors out [cars, windows, horizons, 5], measured less predicted, of the windows of one run.

    Args:
        start_y, y: smoothed and raw measurements [rows, 5]; starts: rows [windows], ascending; stride_rows: between
            horizons; delta, torque: on the stages' grid (`actuated`), of each car [cars, count]; period: [s].
        like: one of the cars, for its kind; constants [cars, n] (`flattened`), effects [cars, COUNT]: the cars, without
            effects of actuators.
        fed: whether speeds are those of the measurement; wrenches: further force and moment on the body
            [cars, rows, 3] (`road.on_road`), none with zero rows.
        bounds: of a step [s], of a step times the fastest rate, and of steps a row.
        internal: the cars' states at each start (`followed`) [cars, windows, size], of which the first five are not
            read.
    """
    windows, size = len(starts), internal.shape[2]
    z, scratch = np.zeros(size * LANES), scratch_of(size)
    p, q = np.zeros(constants.shape[1] * LANES), np.zeros(COUNT * LANES)
    car, window, row = np.zeros(LANES, np.int64), np.zeros(LANES, np.int64), np.zeros(LANES, np.int64)
    pairs = len(constants) * windows
    for first in range(0, pairs, LANES):
        for lane in range(LANES):
            pair = min(first + lane, pairs - 1)
            car[lane], window[lane] = pair // windows, pair % windows
            row[lane] = starts[window[lane]]
            for i in range(5, size):
                z[i * LANES + lane] = internal[car[lane], window[lane], i]
        here = cars_of(constants, effects, car, like, p, q)
        start_measured(start_y, row, 0.0, scratch[5], here[1], scratch[3], z)
        for horizon in range(out.shape[2]):
            for _ in range(stride_rows):
                advance(z, row, here, car, (start_y, delta, torque, wrenches, fed), period, bounds, scratch)
                row += 1
            for lane in range(min(LANES, pairs - first)):
                own = Effects(*fixed_tuple(effects[car[lane]], COUNT))
                _write_errors(y, row[lane], own, z, lane, out[car[lane], window[lane], horizon])
