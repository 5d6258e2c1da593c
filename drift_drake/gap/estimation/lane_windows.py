"""The windows of one run, LANES of them at once: prediction errors of a car whose equations are costly.

Each lane has a stretch of the run's windows. Internal states follow the measured motion up to each start by the steps
of a prediction, over at most `LEAD` seconds, before which they are settled.
"""

from typing import Any

import numpy as np

from drift_drake.car.actuated import STAGES
from drift_drake.car.compilation import compiled, copied
from drift_drake.car.effects.magnitudes import unbiased
from drift_drake.car.equations import fastest, rates, settle
from drift_drake.car.integrate import runge_kutta
from drift_drake.car.lanes import LANES, load_lanes
from drift_drake.car.scalar import jitable, signed_floor, stored
from drift_drake.gap.estimation.filter_state import MIN_FILTER_SPEED, commanded, hold_speeds

LEAD = 1.5  # [s]; what rolls or relaxes forgets faster


@jitable
def _gathered(values: Any, row: Any, share: Any, out: Any) -> None:
    """An array [rows, n] at a share of the row that each lane is at, as [n * LANES]."""
    for lane in range(LANES):
        here, there = values[row[lane]], values[row[lane] + 1]
        for i in range(values.shape[1]):
            out[i * LANES + lane] = here[i] + share * (there[i] - here[i])


@jitable
def _measured_state(y: Any, effects: Any, speeds_only: Any, z: Any) -> None:
    """The cars' states from what sensors read [5 * LANES], their errors taken out; or the speeds of car and rim."""
    r, v, beta, omega_r = unbiased(load_lanes(y, 0), load_lanes(y, 1), load_lanes(y, 2), load_lanes(y, 3), effects)
    if not speeds_only:
        stored(z, 0, r)
        stored(z, 2, beta)
        stored(z, 4, load_lanes(y, 4))
    stored(z, 1, signed_floor(v, MIN_FILTER_SPEED))
    stored(z, 3, omega_r)


@jitable
def _commanded(delta: Any, torque: Any, row: Any, share: Any, out: Any) -> Any:
    """Both commands of all lanes at a share of their rows."""
    first = min(int(share * STAGES), STAGES - 1)
    part = share * STAGES - first
    for lane in range(LANES):
        at = STAGES * row[lane] + first
        out[lane] = delta[at] + part * (delta[at + 1] - delta[at])
        out[LANES + lane] = torque[at] + part * (torque[at + 1] - torque[at])
    return load_lanes(out, 0), load_lanes(out, 1)


@jitable
def _copied(x: Any, lane: Any, out: Any) -> None:
    """One lane of the states x to out."""
    for i in range(lane, len(x), LANES):
        out[i] = x[i]


@jitable
def _steps(x: Any, period: Any, constants: Any, effects: Any, bounds: Any, z: Any) -> Any:
    """Runge-Kutta steps that a row takes in all lanes; z: scratch [size]."""
    step, per_rate, most = bounds
    z[1] = max(np.max(x[LANES : 2 * LANES]), -np.min(x[LANES : 2 * LANES]))
    by_time = int(np.ceil(period / step - 1e-9))
    return min(max(by_time, int(period * fastest(z, constants, effects) / per_rate) + 1), most)


@jitable
def _advance(x: Any, row: Any, period: Any, steps: Any, delta: Any, torque: Any, start_y: Any, effects: Any, fed: Any,
             car: Any, scratch: Any) -> None:  # fmt: skip
    """The states x a row later, in place; with `fed`, speeds are those of the measurement."""
    k, w, read, command = scratch
    begin = _commanded(delta, torque, row, 0.0, command)
    for step in range(steps):
        if fed:
            _gathered(start_y, row, step / steps, read)
            _measured_state(read, effects, True, x)
        middle = _commanded(delta, torque, row, (step + 0.5) / steps, command)
        end = _commanded(delta, torque, row, (step + 1.0) / steps, command)
        runge_kutta(rates, x, begin, middle, end, period / steps, car, k, w)
        begin = end
        hold_speeds(x, load_lanes(x, 0))


@jitable
def _next_starts(starts: Any, s: Any, each: Any, lead: Any, at: Any, start: Any, anew: Any) -> Any:
    """Sets each lane's next start, and whether it is settled anew on the way; how many rows the furthest is behind."""
    behind = 0
    for lane in range(LANES):
        start[lane] = starts[min(lane * each + s, len(starts) - 1)]
        anew[lane] = start[lane] - at[lane] > lead
        at[lane] = max(start[lane] - lead, 0) if anew[lane] else at[lane]
        behind = max(behind, start[lane] - at[lane])
    return behind


@jitable
def write_errors(y: Any, end: Any, effects: Any, z: Any, lane: Any, cars: Any, out: Any) -> None:
    """Writes the errors [5] at a row of one of the cars z [size * cars]."""
    r, v, beta, omega_r = unbiased(y[end, 0], y[end, 1], y[end, 2], y[end, 3], effects)
    out[0], out[1] = r - z[lane], v - z[cars + lane]
    out[2], out[3] = beta - z[2 * cars + lane], omega_r - z[3 * cars + lane]
    out[4] = y[end, 4] - z[4 * cars + lane]


@compiled
def predict_in_lanes(
    start_y: Any, y: Any, starts: Any, stride_rows: Any, delta: Any, torque: Any, period: Any, constants: Any,
    effects: Any, fed: Any, wrenches: Any, size: Any, bounds: Any, out: Any,
) -> Any:  # fmt: skip
    """Prediction errors out [windows, horizons, 5], measured less predicted, of the windows of one run.

    Args:
        delta, torque: [count]; constants, effects: one car; wrenches: [rows, 3]; size: states of the car.
        the others: as in `paired_windows.predict_in_pairs`.
    """
    lead, each = int(np.ceil(LEAD / period)), (len(starts) + LANES - 1) // LANES
    z, carried, before = np.zeros(size * LANES), np.zeros(size * LANES), np.zeros(size * LANES)
    k, w, wrench = np.zeros(size * LANES), np.zeros((2, size * LANES)), np.zeros(3 * LANES)
    read, command, one = np.zeros(5 * LANES), np.zeros(2 * LANES), np.zeros(size)
    at, start, row = np.full(LANES, -lead - 1), np.zeros(LANES, np.int64), np.zeros(LANES, np.int64)
    anew = np.zeros(LANES, np.bool_)
    for s in range(each):
        behind = _next_starts(starts, s, each, lead, at, start, anew)
        if np.any(anew):
            copied(carried, before)
            _gathered(start_y, at, 0.0, read)
            _measured_state(read, effects, False, carried)
            begin = _commanded(delta, torque, at, 0.0, command)
            settle(carried, begin[0], begin[1], constants, effects)
            for lane in range(LANES):
                if not anew[lane]:
                    _copied(before, lane, carried)
        # Along the measured motion up to the start, then from it to each horizon.
        for part in range(out.shape[1] + 1):
            x = carried if part == 0 else z
            if part == 1:
                copied(carried, z)
                _gathered(start_y, start, 0.0, read)
                _measured_state(read, effects, False, z)
            for further in range(behind if part == 0 else stride_rows):
                for lane in range(LANES):
                    row[lane] = at[lane] if part == 0 else start[lane] + (part - 1) * stride_rows + further
                if part == 0:
                    copied(carried, before)
                    _gathered(start_y, row, 0.0, read)
                    _measured_state(read, effects, False, x)
                if wrenches.shape[0] == y.shape[0]:
                    _gathered(wrenches, row, 0.0, wrench)
                steps = _steps(x, period, constants, effects, bounds, one)
                _advance(x, row, period, steps, delta, torque, start_y, effects, fed, (constants, effects, wrench),
                         (k, w, read, command))  # fmt: skip
                for lane in range(LANES if part == 0 else 0):
                    if at[lane] < start[lane]:
                        at[lane] += 1
                    else:
                        _copied(before, lane, carried)
            for lane in range(LANES if part > 0 else 0):
                index = min(lane * each + s, len(starts) - 1)
                write_errors(y, start[lane] + part * stride_rows, effects, z, lane, LANES, out[index, part - 1])


@compiled
def predict_one_by_one(
    start_y: Any, y: Any, starts: Any, stride_rows: Any, delta: Any, torque: Any, period: Any, constants: Any,
    effects: Any, fed: Any, wrenches: Any, size: Any, bounds: Any, out: Any,
) -> Any:  # fmt: skip
    """The same, one window after the other: less work where there are few; internal states are followed from the first
    row on."""
    z, carried, k, w, wrench = np.zeros(size), np.zeros(size), np.zeros(size), np.zeros((2, size)), np.zeros(3)
    _read_state(start_y[0], effects, carried)
    settle(carried, delta[0], torque[0], constants, effects)
    at_row = 0
    for s in range(len(starts)):
        while at_row < starts[s]:
            _read_state(start_y[at_row], effects, carried)
            _advance_one(carried, at_row, period, delta, torque, start_y, fed, wrenches, wrench, (constants, effects),
                         bounds, k, w)  # fmt: skip
            at_row += 1
        copied(carried, z)
        _read_state(start_y[at_row], effects, z)
        for h in range(out.shape[1]):
            for row in range(at_row + h * stride_rows, at_row + (h + 1) * stride_rows):
                _advance_one(z, row, period, delta, torque, start_y, fed, wrenches, wrench, (constants, effects),
                             bounds, k, w)  # fmt: skip
            write_errors(y, at_row + (h + 1) * stride_rows, effects, z, 0, 1, out[s, h])


@jitable
def _read_state(y: Any, effects: Any, z: Any) -> Any:
    """One car's states from what sensors read, their errors taken out."""
    z[0], v, z[2], z[3] = unbiased(y[0], y[1], y[2], y[3], effects)
    z[1] = signed_floor(v, MIN_FILTER_SPEED)
    z[4] = y[4]


@jitable
def _advance_one(z: Any, row: Any, period: Any, delta: Any, torque: Any, start_y: Any, fed: Any, wrenches: Any,
                 wrench: Any, car: Any, bounds: Any, k: Any, w: Any) -> Any:  # fmt: skip
    """One car's states a row later, in place; with `fed`, speeds are those of the measurement."""
    step, per_rate, most = bounds
    constants, effects = car
    if len(wrenches) > 0:
        copied(wrenches[row], wrench)
    steps = min(max(int(np.ceil(period / step - 1e-9)), int(period * fastest(z, constants, effects) / per_rate) + 1),
                most)  # fmt: skip
    for part in range(steps):
        at, end = STAGES * (row + part / steps), STAGES * (row + (part + 1) / steps)
        if fed:
            y = start_y[row] + part / steps * (start_y[row + 1] - start_y[row])
            _, z[1], _, z[3] = unbiased(y[0], y[1], y[2], y[3], effects)
        runge_kutta(rates, z, commanded(delta, torque, at), commanded(delta, torque, 0.5 * (at + end)),
                    commanded(delta, torque, end), period / steps, (constants, effects, wrench), k, w)  # fmt: skip
        hold_speeds(z)
