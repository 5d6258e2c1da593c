"""What a car does from given states on, without a correction: `LANES` starts at once."""

from typing import Any

import numpy as np

from drift_drake.car.actuated import STAGES
from drift_drake.car.compilation import compiled, copied
from drift_drake.car.lanes import LANES, load_lanes, load_lanes_tuple
from drift_drake.car.single_track.equations import cars_in_lanes
from drift_drake.gap.estimation.filter_state import (
    MEASURED,
    SIZE,
    SUBSTEPS,
    advance_row,
    predict_measurement,
    rates_of,
)
from drift_drake.gap.estimation.variants import Ready, in_lanes, wrench_at


@compiled
def roll_in_lanes(
    z: Any, steps: Any, delta: Any, torque: Any, period: Any, substeps: Any, constants: Any, effects: Any,
    wrenches: Any, out: Any,
) -> Any:  # fmt: skip
    """Moves states z [SIZE * LANES] on; out [steps, 9 * LANES]: measurements, `steps` rows ahead.

    Args:
        steps: one or more, above zero, ascending; the rest is as in `filtered.filter_in_lanes`.
    """
    k, w, predicted = np.zeros((SIZE + 2) * LANES), np.zeros((2, SIZE * LANES)), np.zeros(MEASURED * LANES)
    p, q = cars_in_lanes(constants, effects)
    none = load_lanes_tuple(k, 0, 3)
    n = 0
    for row in range(1, steps[-1] + 1):
        advance_row(z, delta, torque, row - 1, period, substeps, p, q, wrench_at(wrenches, row - 1, none), k, w)
        if row == steps[n]:
            at = STAGES * row
            rates_of(z, load_lanes(delta, at), load_lanes(torque, at), p, q, wrench_at(wrenches, row, none), k)
            predict_measurement(z, load_lanes(k, SIZE), load_lanes(k, SIZE + 1), q, predicted)
            copied(predicted, out[n])
            n += 1


def roll_out(car: Ready, period: float, states: np.ndarray, starts: np.ndarray, steps: np.ndarray) -> np.ndarray:
    """Predicted measurements [starts, steps, 9]; NaN beyond the run's end.

    Args:
        car: as it drives through the whole run; period: between rows [s].
        states: at each row [rows, SIZE]; starts: rows to start from; steps: rows ahead, above zero, ascending.
    """
    rows = len(car.y)
    out = np.full((len(starts), len(steps), MEASURED), np.nan)
    for begin in range(0, len(starts), LANES):
        some = starts[begin : begin + LANES]
        reached = steps[steps < rows - min(some)]
        if not len(reached):
            continue
        given = in_lanes([_part(car, start, min(start + int(reached[-1]), rows - 1)) for start in some])
        z = states[np.append(some, np.repeat(some[-1:], LANES - len(some)))]
        ahead = np.empty((len(reached), MEASURED * LANES))
        roll_in_lanes(z.T.ravel(), reached, given.delta, given.torque, period, SUBSTEPS, given.constants,
                      given.effects, given.wrench, ahead)  # fmt: skip
        found = np.moveaxis(ahead.reshape(len(reached), MEASURED, LANES), -1, 0)[: len(some)]
        inside = some[:, None] + reached < rows
        out[begin : begin + LANES, : len(reached)][inside] = found[inside]
    return out


def _part(car: Ready, start: int, end: int) -> Ready:
    """The car from one row to another."""
    stages = slice(STAGES * start, STAGES * end + 1)
    return car._replace(y=car.y[start : end + 1], delta=car.delta[stages], torque=car.torque[stages],
                        wrench=car.wrench[start : end + 1])  # fmt: skip
