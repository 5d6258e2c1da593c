"""Cars that differ a little, and what acts on them, made ready for a compiled pass over a run: `LANES` at once."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from drift_drake.car.actuated import STAGES, without_actuators
from drift_drake.car.lanes import LANES, load_lanes_tuple
from drift_drake.car.road import NO_WRENCH, on_road, with_bank
from drift_drake.car.scalar import jitable
from drift_drake.gap.estimation.problem import Commands, Problem, car, run_commands


class Variant(NamedTuple):
    """A car, and what acts on it."""

    theta: np.ndarray
    names: Sequence[str]
    wrench: np.ndarray = NO_WRENCH  # further force [N] and yaw moment [N m] on the body [rows, 3]
    extra_torque: np.ndarray | None = None  # on the engine [N m], one a row
    y: np.ndarray | None = None  # measurements [rows, 9] in place of the run's
    commands: Commands | None = None  # what `run_commands` gives, if that is known


class Ready(NamedTuple):
    """Arrays of a variant, or, behind a last axis of LANES, of several."""

    y: np.ndarray  # [rows, 9]
    delta: np.ndarray  # [count] on the stages' grid
    torque: np.ndarray  # [count]
    constants: np.ndarray  # [len(Constants)]
    effects: np.ndarray  # [COUNT]
    wrench: np.ndarray  # [rows, 3], from each row to the next; no rows where there is none


def ready(problem: Problem, index: int, variant: Variant, since: int = 0) -> Ready:
    """A variant as it drives through one run, from the row `since` on."""
    run = problem.runs[index]
    constants, effects = car(problem, variant.theta, variant.names)
    delta, torque = variant.commands or run_commands(problem, index, variant.theta, effects)
    if variant.extra_torque is not None:
        grid = np.arange(len(torque)) / STAGES
        torque = torque + np.interp(grid, np.arange(len(variant.extra_torque)), variant.extra_torque)
    dynamic, banked = on_road(run.bank, constants.mass, constants.gravity, without_actuators(effects))
    y = run.y if variant.y is None else variant.y
    return Ready(y[since:], delta[STAGES * since :], torque[STAGES * since :], np.array(constants, float),
                 np.array(dynamic, float), with_bank(variant.wrench, banked)[since:])  # fmt: skip


def in_lanes(given: Sequence[Ready]) -> Ready:
    """Up to LANES variants, the last again where there are fewer; short runs end as they are in their last row."""
    rows = max(len(one.y) for one in given)
    filled = [_lasting(one, rows) for one in given]
    if any(len(one.wrench) for one in filled):
        filled = [one if len(one.wrench) else one._replace(wrench=np.zeros((rows, 3))) for one in filled]
    filled += [filled[-1]] * (LANES - len(filled))
    return Ready(*(np.stack(arrays, axis=-1).reshape(*arrays[0].shape[:-1], arrays[0].shape[-1] * LANES)
                   for arrays in zip(*filled, strict=True)))  # fmt: skip


def _lasting(one: Ready, rows: int) -> Ready:
    def longer(values: np.ndarray, count: int) -> np.ndarray:
        return np.concatenate([values, np.repeat(values[-1:], count, axis=0)])

    more = rows - len(one.y)
    if not more:
        return one
    return one._replace(y=longer(one.y, more), delta=longer(one.delta, STAGES * more),
                        torque=longer(one.torque, STAGES * more), wrench=longer(one.wrench, more))  # fmt: skip


@jitable
def wrench_at(wrenches: Any, row: Any, none: Any) -> Any:
    """A row of wrenches as three LANES of numbers; `none` where there are no rows."""
    return load_lanes_tuple(wrenches[row], 0, 3) if len(wrenches) > 0 else none
