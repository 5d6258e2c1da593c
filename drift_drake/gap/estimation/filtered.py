"""The full filter over all runs of a case, `LANES` runs or cars at once."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from drift_drake.car.actuated import STAGES
from drift_drake.car.compilation import compiled, copied
from drift_drake.car.effects.magnitudes import depends_on_heading
from drift_drake.car.lanes import LANES, load_lanes, load_lanes_tuple, store_lanes
from drift_drake.car.scalar import anywhere, jitable
from drift_drake.car.single_track.equations import cars_in_lanes
from drift_drake.gap.estimation.filter import (
    UNMEASURED,
    correct,
    measurement_matrix,
    propagate,
    update_covariance,
)
from drift_drake.gap.estimation.filter_state import (
    CORRECTED,
    MEASURED,
    SIZE,
    SUBSTEPS,
    UNRELAXED,
    advance_row,
    first_state,
    linearise,
    predict_measurement,
    rates_of,
    transition,
)
from drift_drake.gap.estimation.problem import Filtered, Gains, Problem, first_row
from drift_drake.gap.estimation.variants import Variant, in_lanes, ready, wrench_at

SLIP_VARIANCE = 1e-4  # first, of a slip that lags


@compiled
def _lane_of(values: Any, lane: Any, out: Any) -> None:
    """One lane of a matrix [n, n * LANES] to out [n, n]."""
    for i in range(len(values)):
        for j in range(out.shape[1]):
            out[i, j] = values[i, j * LANES + lane]


@jitable
def _first_covariance(noise: Any, used: Any, moving: Any, p: Any, like: Any) -> None:
    for i in range(UNRELAXED):
        measured = i if i < 4 else i + 2
        start = noise[measured] if used[measured] else (UNMEASURED if i < 4 else 0.0)
        store_lanes(p[i], i, start + 0.0 * like)
    for i in range(UNRELAXED, moving):
        store_lanes(p[i], i, SLIP_VARIANCE + 0.0 * like)


@compiled
def filter_in_lanes(
    y: Any, first: Any, used: Any, delta: Any, torque: Any, period: Any, substeps: Any, constants: Any,
    effects: Any, noise: Any, process: Any, wrenches: Any, innovations: Any, gains: Any, whitenings: Any,
) -> Any:  # fmt: skip
    """Extended Kalman filter over LANES runs.

    Args:
        y: measurements [rows, 9 * LANES] in the order of CHANNELS; first: row to start from, whose innovations and
            those before are left zero; used: which channels count [9].
        delta, torque: on the stages' grid [count * LANES]; period: [s]; substeps: Runge-Kutta steps a row.
        constants, effects: of the cars (`cars_in_lanes`).
        noise: measurement variances [9]; process: process noise of the first nine states, variance a second [9].
        wrenches: [rows, 3 * LANES] from each row to the next; none with zero rows.
        innovations: [rows, 9 * LANES], filled.
        gains (states by channels), whitenings: an array [rows, 9, 9] a lane, filled as far as it has rows.
    """
    n, m = CORRECTED * LANES, MEASURED * LANES
    z, k, w = np.zeros(SIZE * LANES), np.zeros((SIZE + 2) * LANES), np.zeros((2, SIZE * LANES))
    probe, jacobian, p = np.zeros(SIZE * LANES), np.zeros((SIZE + 2, n)), np.zeros((CORRECTED, n))
    f, t, scratch = np.zeros((CORRECTED, n)), np.zeros((CORRECTED, n)), np.zeros((CORRECTED, n))
    h, ph, s, low = np.zeros((MEASURED, n)), np.zeros((MEASURED, n)), np.zeros((MEASURED, m)), np.zeros((MEASURED, m))
    gain, whitening, predicted, nu = np.zeros((CORRECTED, m)), np.zeros((MEASURED, m)), np.zeros(m), np.zeros(m)
    car, q = cars_in_lanes(constants, effects)
    relaxed, graded = anywhere(q.tyre_relaxation), depends_on_heading(q)
    none, like, moving = load_lanes_tuple(nu, 0, 3), q[0], CORRECTED if relaxed else UNRELAXED
    measurement_matrix(q, h)
    at = STAGES * first
    first_state(y[first], used, load_lanes(delta, at), load_lanes(torque, at), car, q, z)
    _first_covariance(noise, used, moving, p, like)
    innovations[: first + 1] = 0.0
    for lane in range(LANES):
        gains[lane][: first + 1] = 0.0
        whitenings[lane][: first + 1] = 0.0
    linearise(z, load_lanes(delta, at), load_lanes(torque, at), car, q, relaxed, graded, probe, jacobian)
    for row in range(first + 1, len(y)):
        transition(jacobian, period, moving, f, t, scratch, like)
        propagate(f, process, period, moving, p, t, like)
        wrench = wrench_at(wrenches, row - 1, none)
        advance_row(z, delta, torque, row - 1, period, substeps, car, q, wrench, k, w)
        at, wrench = STAGES * row, wrench_at(wrenches, row, none)
        linearise(z, load_lanes(delta, at), load_lanes(torque, at), car, q, relaxed, graded, probe, jacobian)
        rates_of(z, load_lanes(delta, at), load_lanes(torque, at), car, q, wrench, k)
        predict_measurement(z, load_lanes(k, SIZE), load_lanes(k, SIZE + 1), q, predicted)
        copied(jacobian[SIZE], h[4])
        copied(jacobian[SIZE + 1], h[5])
        update_covariance(h, noise, used, moving, p, gain, whitening, ph, s, low, t, like)
        correct(y[row], used, predicted, gain, whitening, nu, z, innovations[row], like, like)
        for lane in range(LANES):
            if row < len(gains[lane]):
                _lane_of(gain, lane, gains[lane][row])
                _lane_of(whitening, lane, whitenings[lane][row])


def filter_each(problem: Problem, hypotheses: Sequence[Variant]) -> list[Gains]:
    """The full filter over all runs for each of some parameters: innovations with gains that fit these."""
    passes = [(n, i) for n in range(len(hypotheses)) for i in range(len(problem.runs))]
    together: dict[tuple[object, ...], list[tuple[int, int]]] = {}
    for n, i in sorted(passes, key=lambda one: -len(problem.runs[one[1]].y)):
        run = problem.runs[i]
        key = run.period, first_row(run, hypotheses[n].names), run.used.tobytes()
        together.setdefault(key, []).append((n, i))
    found: dict[tuple[int, int], tuple[np.ndarray, np.ndarray, np.ndarray]] = {}
    for alike in together.values():
        for begin in range(0, len(alike), LANES):
            some = alike[begin : begin + LANES]
            found |= zip(some, _filtered(problem, [(hypotheses[n], i) for n, i in some]), strict=True)
    return [_gains(problem, [found[n, i] for i in range(len(problem.runs))]) for n in range(len(hypotheses))]


def _filtered(
    problem: Problem, passes: Sequence[tuple[Variant, int]]
) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Innovations [rows, 9], gains and whitening matrices [rows, 9, 9] of up to LANES passes that start alike."""
    given = in_lanes([ready(problem, i, variant) for variant, i in passes])
    run, rows = problem.runs[passes[0][1]], [len(problem.runs[i].y) for _, i in passes] + [0] * (LANES - len(passes))
    gains, whitenings = (tuple(np.empty((count, *shape)) for count in rows)
                         for shape in ((CORRECTED, MEASURED), (MEASURED, MEASURED)))  # fmt: skip
    innovations = np.empty((len(given.y), MEASURED * LANES))
    filter_in_lanes(
        given.y, first_row(run, passes[0][0].names), run.used, given.delta, given.torque, run.period, SUBSTEPS,
        given.constants, given.effects, problem.noise**2, problem.process, given.wrench, innovations, gains, whitenings,
    )  # fmt: skip
    by_lane = np.moveaxis(innovations.reshape(-1, MEASURED, LANES), -1, 0)
    return [(by_lane[lane, : rows[lane]].copy(), gains[lane], whitenings[lane]) for lane in range(len(passes))]


def _gains(problem: Problem, found: Sequence[tuple[np.ndarray, np.ndarray, np.ndarray]]) -> Gains:
    logdet = 0.0
    for run, (e, _, whitening) in zip(problem.runs, found, strict=True):
        # The whitening matrices are inverse Cholesky factors of the innovations' covariances; zero where the filter has
        # lost the car, whose innovations are no numbers then.
        with np.errstate(divide="ignore"):
            logdet -= 2.0 * float(np.sum(np.log(np.diagonal(whitening[run.counted], axis1=1, axis2=2))))
        if run.trace is not None:
            e += run.trace
    innovations, gains, whitenings = zip(*found, strict=True)
    return Gains(list(gains), list(whitenings), Filtered(list(innovations), problem.tempering * logdet))


def filter_case(problem: Problem, theta: np.ndarray, names: Sequence[str]) -> Gains:
    """The full filter over all runs: innovations with gains that fit these parameters."""
    return filter_each(problem, [Variant(theta, names)])[0]
