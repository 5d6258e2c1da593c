"""Internal states of several cars along the measured motion of one run, up to each window's start.

No sensor reads them. Where they are slow, or few, half an implicit step a row makes them follow (`follow_in_lanes`).
Where they ring (`CarKind.stepped`) they take the steps of a prediction (`follow_by_steps`).
"""

from typing import Any

import numpy as np

from drift_drake.car.compilation import compiled, copied
from drift_drake.car.effects.magnitudes import COUNT
from drift_drake.car.equations import decays, rates, settle
from drift_drake.car.lanes import LANES
from drift_drake.car.scalar import jitable
from drift_drake.gap.estimation.paired_windows import (
    advance,
    cars_of,
    commanded_in,
    scratch_of,
    start_measured,
    wrench_of,
)

FOLLOWING = 0.0125  # [s] of an implicit step, at most
LEAD = 1.5  # [s] of steps before a start, behind which states are settled; what rolls or relaxes forgets faster


@compiled
def follow_in_lanes(
    y: Any, starts: Any, delta: Any, torque: Any, period: Any, like: Any, constants: Any, effects: Any, wrenches: Any,
    out: Any,
) -> Any:  # fmt: skip
    """The internal states out [cars, windows, size] of cars along the measured motion y [rows, 5], at each start.

    The arguments are those of `predict_in_pairs`.
    """
    size = out.shape[2]
    z, k, decay = np.zeros(size * LANES), np.zeros(size * LANES), np.zeros(size * LANES)
    command, read, wrench_now = np.zeros(2 * LANES), np.zeros(5 * LANES), np.zeros(3 * LANES)
    p, q = np.zeros(constants.shape[1] * LANES), np.zeros(COUNT * LANES)
    car, row = np.zeros(LANES, np.int64), np.zeros(LANES, np.int64)
    count = max(2, int(np.ceil(period / FOLLOWING - 1e-9)))
    h, steps = period / count, np.full(LANES, count)
    for first in range(0, len(constants), LANES):
        for lane in range(LANES):
            car[lane] = min(first + lane, len(constants) - 1)
        of_cars, q_cars = cars_of(constants, effects, car, like, p, q)
        row[:] = 0
        start_measured(y, row, 0.0, steps, q_cars, read, z)
        begin = commanded_in(delta, torque, car, row, 0.0, steps, command)
        settle(z, begin[0], begin[1], of_cars, q_cars)
        for s in range(len(starts)):
            while row[0] < starts[s]:
                wrench = wrench_of(wrenches, car, row, wrench_now)
                for step in range(count):
                    start_measured(y, row, step + 0.5, steps, q_cars, read, z)
                    here = commanded_in(delta, torque, car, row, step + 0.5, steps, command)
                    rates(z, here, (of_cars, q_cars, wrench), k)
                    decays(z, of_cars, q_cars, decay)
                    for i in range(5 * LANES, size * LANES):
                        z[i] += h * k[i] / (1.0 + h * decay[i])
                row += 1
            for lane in range(min(LANES, len(constants) - first)):
                for i in range(size):
                    out[first + lane, s, i] = z[i * LANES + lane]


@jitable
def _next_starts(starts: Any, begin: Any, s: Any, lead: Any, at: Any, start: Any, anew: Any) -> Any:
    """Sets each lane's next start, and whether it is settled anew on the way; how many rows the furthest is behind."""
    behind = 0
    for lane in range(LANES):
        start[lane] = starts[min(begin[lane] + s, len(starts) - 1)]
        anew[lane] = start[lane] - at[lane] > lead
        at[lane] = max(start[lane] - lead, 0) if anew[lane] else at[lane]
        behind = max(behind, start[lane] - at[lane])
    return behind


@jitable
def _kept(before: Any, keep: Any, z: Any) -> None:
    """The states before, in the lanes that keep them."""
    for i in range(len(z)):
        if keep[i % LANES]:
            z[i] = before[i]


@compiled
def follow_by_steps(
    y: Any, starts: Any, delta: Any, torque: Any, period: Any, like: Any, constants: Any, effects: Any, fed: Any,
    wrenches: Any, bounds: Any, out: Any,
) -> Any:  # fmt: skip
    """The same as `follow_in_lanes`; each lane has a stretch of one car's starts, over at most `LEAD` before each.

    The arguments are those of `predict_in_pairs`, y its start_y.
    """
    size, windows, lead = out.shape[2], len(starts), int(np.ceil(LEAD / period))
    stretches = max(LANES // len(constants), 1)  # of each car
    each = (windows + stretches - 1) // stretches
    lines = len(constants) * stretches
    z, before, scratch = np.zeros(size * LANES), np.zeros(size * LANES), scratch_of(size)
    p, q = np.zeros(constants.shape[1] * LANES), np.zeros(COUNT * LANES)
    car, begin, start = np.zeros(LANES, np.int64), np.zeros(LANES, np.int64), np.zeros(LANES, np.int64)
    at, keep = np.zeros(LANES, np.int64), np.zeros(LANES, np.bool_)
    for first in range(0, lines, LANES):
        for lane in range(LANES):
            line = min(first + lane, lines - 1)
            car[lane], begin[lane], at[lane] = line // stretches, line % stretches * each, -lead - 1
        here = cars_of(constants, effects, car, like, p, q)
        for s in range(each):
            behind = _next_starts(starts, begin, s, lead, at, start, keep)
            if np.any(keep):
                copied(z, before)
                start_measured(y, at, 0.0, scratch[5], here[1], scratch[3], z)
                command = commanded_in(delta, torque, car, at, 0.0, scratch[5], scratch[2])
                settle(z, command[0], command[1], here[0], here[1])
                for lane in range(LANES):
                    keep[lane] = not keep[lane]
                _kept(before, keep, z)
            for _ in range(behind):
                copied(z, before)
                start_measured(y, at, 0.0, scratch[5], here[1], scratch[3], z)
                advance(z, at, here, car, (y, delta, torque, wrenches, fed), period, bounds, scratch)
                for lane in range(LANES):
                    keep[lane] = at[lane] >= start[lane]
                    at[lane] += 0 if keep[lane] else 1
                _kept(before, keep, z)
            for lane in range(LANES):
                for i in range(size):
                    out[car[lane], min(begin[lane] + s, windows - 1), i] = z[i * LANES + lane]
