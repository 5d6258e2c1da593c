"""Innovations under frozen gains of slightly different cars, `LANES` of them at once.

What the filter (`filter`) found at some parameters stays as it is; parameters, commands, further forces or
measurements are others. Hundreds of such passes over a run make the derivatives that a fit steps by, and judge the
effects that may be added to a hypothesis.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from drift_drake.car.actuated import STAGES
from drift_drake.car.compilation import compiled, copied
from drift_drake.car.lanes import LANES, load_lanes, load_lanes_tuple
from drift_drake.car.single_track.equations import cars_in_lanes
from drift_drake.gap.estimation.filter import correct
from drift_drake.gap.estimation.filter_state import (
    MEASURED,
    SIZE,
    SUBSTEPS,
    advance_row,
    first_state,
    predict_measurement,
    rates_of,
)
from drift_drake.gap.estimation.problem import Gains, Problem, first_row, flat
from drift_drake.gap.estimation.variants import Variant, in_lanes, ready, wrench_at

NO_STATE = np.empty(0)


@compiled
def observe_in_lanes(
    y: Any, first: Any, used: Any, delta: Any, torque: Any, period: Any, substeps: Any, constants: Any,
    effects: Any, wrenches: Any, gain: Any, whitening: Any, known: Any, innovations: Any, states: Any,
) -> Any:  # fmt: skip
    """Innovations [rows, 9 * LANES] of one run; `states` [rows, SIZE * LANES] receives the corrected states.

    Args:
        y: measurements [rows, 9 * LANES]; first: row to start from; used: which channels count [9].
        delta, torque: on the stages' grid [count * LANES]; period: [s]; substeps: Runge-Kutta steps a row.
        constants, effects: of the cars (`cars_in_lanes`).
        wrenches: [rows, 3 * LANES], from each row to the next; none with zero rows.
        gain, whitening: of the filter [rows, 9, 9].
        known: corrected states [SIZE * LANES] at `first`; with zero numbers they are what the row measures.
        states: left alone if it has zero rows.
    """
    z, k, w = np.zeros(SIZE * LANES), np.zeros((SIZE + 2) * LANES), np.zeros((2, SIZE * LANES))
    predicted, nu = np.zeros(MEASURED * LANES), np.zeros(MEASURED * LANES)
    p, q = cars_in_lanes(constants, effects)
    none = load_lanes_tuple(nu, 0, 3)
    if len(known) > 0:
        copied(known, z)
    else:
        at = STAGES * first
        first_state(y[first], used, load_lanes(delta, at), load_lanes(torque, at), p, q, z)
    innovations[: first + 1] = 0.0
    for row in range(first + 1 if len(states) > 0 else 0):
        copied(z, states[row])
    for row in range(first + 1, len(y)):
        wrench = wrench_at(wrenches, row - 1, none)
        advance_row(z, delta, torque, row - 1, period, substeps, p, q, wrench, k, w)
        at = STAGES * row
        wrench = wrench_at(wrenches, row, none)
        rates_of(z, load_lanes(delta, at), load_lanes(torque, at), p, q, wrench, k)
        predict_measurement(z, load_lanes(k, SIZE), load_lanes(k, SIZE + 1), q, predicted)
        correct(y[row], used, predicted, gain[row], whitening[row], nu, z, innovations[row], q[0], 0.0)
        if len(states) > 0:
            copied(z, states[row])


def _observe(
    problem: Problem, gains: Gains, index: int, variants: Sequence[Variant], since: int, known: np.ndarray,
    substeps: int, keep: bool,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Innovations and, if they are kept, corrected states of up to LANES variants with one first row."""
    run, given = problem.runs[index], in_lanes([ready(problem, index, variant, since) for variant in variants])
    innovations = np.empty((len(given.y), MEASURED * LANES))
    states = np.empty((len(given.y) if keep else 0, SIZE * LANES))
    observe_in_lanes(
        given.y, max(first_row(run, variants[0].names) - since, 0), run.used, given.delta, given.torque, run.period,
        substeps, given.constants, given.effects, given.wrench, gains.gain[index][since:],
        gains.whitening[index][since:], np.repeat(known, LANES), innovations, states,
    )  # fmt: skip
    e, z = (np.moveaxis(values.reshape(len(values), values.shape[1] // LANES, LANES), -1, 0)[: len(variants)]
            for values in (innovations, states))  # fmt: skip
    return e if run.trace is None else e + run.trace[since:], z


def observe_each(
    problem: Problem, gains: Gains, index: int, variants: Sequence[Variant], since: int = 0,
    known: np.ndarray = NO_STATE, substeps: int = SUBSTEPS,
) -> np.ndarray:  # fmt: skip
    """Whitened innovations [variants, rows - since, 9] of one run under frozen gains.

    Args:
        since, known: row that all start from, and the corrected state [SIZE] there; innovations are those from it on,
            the first zero.
        substeps: Runge-Kutta steps a row.
    """
    run = problem.runs[index]
    out = np.empty((len(variants), len(run.y) - since, MEASURED))
    firsts = np.array([first_row(run, v.names) for v in variants])
    for first in np.unique(firsts):
        alike = np.flatnonzero(firsts == first)
        for begin in range(0, len(alike), LANES):
            some = alike[begin : begin + LANES]
            out[some], _ = _observe(problem, gains, index, [variants[i] for i in some], since, known, substeps, False)
    return out


def filtered_states(problem: Problem, gains: Gains, theta: np.ndarray, names: Sequence[str], index: int) -> np.ndarray:
    """Corrected states [rows, SIZE] of one run under frozen gains."""
    return _observe(problem, gains, index, [Variant(theta, names)], 0, NO_STATE, SUBSTEPS, True)[1][0]


def observe_case(problem: Problem, gains: Gains, variants: Sequence[Variant], substeps: int = SUBSTEPS) -> np.ndarray:
    """Whitened innovations that count, of all runs [variants, count], under frozen gains."""
    by_run = [observe_each(problem, gains, i, variants, substeps=substeps) for i in range(len(problem.runs))]
    return np.stack([flat(problem, [e[n] for e in by_run]) for n in range(len(variants))])
