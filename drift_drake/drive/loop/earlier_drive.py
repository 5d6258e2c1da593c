"""What earlier drives teach a learnt model, so that the next attempt begins with it.

Such a belief holds for the kind of driving that it was learnt on: after a drive that gripped where it was to drift, a
car spins that the prior keeps on the lane. So such drives are refused. Of another course with the same drifts it holds
in the drifts, but not on the way into them: what it teaches is raised to a power (Ibrahim and Chen 2000).
"""

import dataclasses
from collections.abc import Sequence

import numpy as np

from drift_drake.car.log.table import InvalidLogError, Run
from drift_drake.car.single_track.motion import INPUTS, STATES
from drift_drake.common.arrays import Array
from drift_drake.drive.learnt.adapter import DEFAULT_THRESHOLD, Beliefs, adapt_bank
from drift_drake.drive.learnt.checkpoint import BayesianModel
from drift_drake.drive.learnt.command_lag import TIME_STEP, lagged_commands
from drift_drake.drive.learnt.features import STATE_COUNT
from drift_drake.drive.learnt.lag_bank import BANK
from drift_drake.drive.loop.metrics import steady_drifts
from drift_drake.drive.reference.trajectory import Reference

NEEDED = ("beta", "omega_r", "tau_cmd")  # in addition to what every log has
OFF_COURSE = 1.0  # [rad] between the car's course and the path's; a quarter more radius is 1.3 rad off after a circle
SHORT = 0.9  # of the course's length
HELD = 0.5  # of the steady drifts to a side
OTHER_COURSE = 0.3
"""What a drive of another course counts; several such drives count as much together, since they are off alike
(multi-body cars of draw 881, the loops after a figure-8)."""


def check_earlier_drive(run: Run, *courses: Reference) -> Reference:
    """The course that a drive is of, the first that it follows.

    The log needs no position: the car's course is the integral of its yaw rate, plus its sideslip, and its path
    position that of its speed.

    Raises:
        InvalidLogError: a drive of none of the courses, one that ended early, or did not hold its drifts (`HELD`).
    """
    missing = [name for name in NEEDED if run.column(name) is None]
    if missing or run.beta is None:
        raise InvalidLogError(
            f"{run.name}: has no column {', '.join(missing)}; a learnt model needs the yaw rate, the speed, the "
            "sideslip and the rim speed under both commands"
        )
    if abs(TIME_STEP / run.period - round(TIME_STEP / run.period)) > 0.01:
        raise InvalidLogError(
            f"{run.name}: its rows are {run.period:.4g} s apart, of which {TIME_STEP:g} s is no multiple: resample it"
        )
    steps = np.diff(run.t)
    s, turned = (np.concatenate([[0.0], np.cumsum(0.5 * steps * (a[1:] + a[:-1]))]) for a in (run.v, run.r))
    turned += run.beta - run.beta[0]
    reference = next((course for course in courses if _off(course, s, turned).max() <= OFF_COURSE), None)
    if reference is None:
        off = _off(courses[0], s, turned)
        raise InvalidLogError(
            f"{run.name}: is {off.max():.1f} rad off the course at t = {run.t[np.argmax(off)]:.1f} s; give a drive of "
            "the same course, or of another one with the same drifts, from its start on"
        )
    if s[-1] < SHORT * reference.distance:
        raise InvalidLogError(
            f"{run.name}: ends after {s[-1]:.0f} m of the {reference.distance:.0f} m of the course; give a drive that "
            "was completed, or begin without one"
        )
    wanted, drifted = steady_drifts(s, run.beta, reference)
    for side, mask in (("left", wanted < 0.0), ("right", wanted > 0.0)):
        if mask.any() and drifted[mask].mean() < HELD:
            raise InvalidLogError(
                f"{run.name}: of the drifts in curves to the {side} {drifted[mask].mean():.0%} were held; what "
                "gripping teaches leads astray in a drift: give a drive that held them, or begin without one"
            )
    return reference


def _off(reference: Reference, s: Array, turned: Array) -> Array:
    """How far the car's course, which has turned so far at path positions s [m], is off a reference's [rad]."""
    course = reference.path.heading(s)
    return np.where(s <= reference.distance, np.abs(turned - course + course[0]), 0.0)


def beliefs_after(
    model: BayesianModel, runs: Sequence[Run], reference: Reference, lags: Array = BANK,
    threshold: float = DEFAULT_THRESHOLD, others: Sequence[Reference] = (),
) -> Beliefs:  # fmt: skip
    """What the `BayesianAdapter` of a model believes at the end of earlier drives, one after the other.

    Args:
        model: the learnt model; runs: the drives' logs, with sideslip, rim speed and torque; reference: the course that
            is driven next; others: courses with the same drifts that earlier drives may be of, which count
            `OTHER_COURSE` together.
        lags: the adapter's [K, 2] in s; those of `drift-drake drive` without; threshold: the adapter's [-].

    Raises:
        InvalidLogError: a drive of none of the courses, one that ended early, or did not hold its drifts (`HELD`).

    Examples:
        >>> adapter, course = BayesianAdapter(model), straight_line(15.0, 15.0, 3.5)
        >>> beliefs = beliefs_after(model, [read_run("logs/monday/run_0.csv")], course, adapter.lags)
        >>> adapter.set_beliefs(adapter.CreateDefaultContext(), beliefs)
    """
    beliefs = Beliefs([model.prior()] * len(lags), np.zeros(len(lags)))
    elsewhere = [check_earlier_drive(run, reference, *others) is not reference for run in runs]
    for run, other in zip(runs, elsewhere, strict=True):
        counts = OTHER_COURSE / sum(elsewhere) if other else 1.0
        counted = dataclasses.replace(model, sample_weight=counts * model.sample_weight)
        beliefs = _after(beliefs, [counted.with_lag(lag) for lag in lags], run, lags, threshold)
    return beliefs


def _after(beliefs: Beliefs, models: Sequence[BayesianModel], run: Run, lags: Array, threshold: float) -> Beliefs:
    """What is believed after one drive more."""
    x = np.zeros((len(run), len(STATES)))
    x[:, :STATE_COUNT] = np.array([run.column(name) for name in STATES[:STATE_COUNT]]).T
    u = np.array([run.column(f"{name}_cmd") for name in INPUTS]).T
    lagged = np.stack([lagged_commands(run.t, u, lag) for lag in lags], axis=1)
    every, (posteriors, evidence) = round(TIME_STEP / run.period), beliefs
    for k in range(0, len(run) - every, every):
        after = adapt_bank(models, posteriors, x[k], lagged[k], u[k], u[k + every], x[k + every], threshold)
        if after is not None:
            posteriors, evidence = [one.posterior for one in after], evidence + [one.density for one in after]
    return Beliefs(posteriors, evidence)
