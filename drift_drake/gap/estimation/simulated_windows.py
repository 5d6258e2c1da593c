"""Prediction errors of a simulator of the user's: windows become roll-outs, effects what is done round it.

What actuators and clocks do is done to its inputs, what sensors do to what is compared, further forces along the
measured motion go to its inputs for forces, and all else through its parameters (`car.foreign.simulator`).
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from drift_drake.car.effects.magnitudes import Effects, unbiased
from drift_drake.car.equations import folded_into
from drift_drake.car.foreign.along import inputs_along
from drift_drake.car.foreign.asked import CHANNELS, job_along, motion_of
from drift_drake.car.foreign.pool import roll_all
from drift_drake.car.foreign.rollouts import Job, SimulatorError
from drift_drake.car.foreign.simulator import Simulator, SimulatorConstants
from drift_drake.common.arrays import Array, Index

if TYPE_CHECKING:
    from drift_drake.gap.estimation.windows import WindowedRun

LARGEST_ERROR = 1e3  # of any channel, where a prediction diverges


class _Part(NamedTuple):
    """Windows of one run with the same lead-in, predicted by one car."""

    car: int
    run: int
    at: Index  # indices of the run's windows
    lead: int  # rows
    measured: Array  # [windows, 5] at the starts, sensors' errors taken out


def simulated_errors(
    runs: "Sequence[WindowedRun]", cars: Sequence[tuple[SimulatorConstants, Effects]], horizons: int,
    wrenches: Sequence[Array],
) -> list[list[Array]]:  # fmt: skip
    """Prediction errors [windows, horizons, 5] of each car and run; zero in channels that are not put out.

    Args:
        cars: parameters of one simulator, and effects; wrenches: of each run, further force (F_x, F_y) [N] and yaw
            moment [N m] on the body [rows, 3], none with zero rows.

    Raises:
        SimulatorError: the simulator cannot be run.
    """
    simulator, rest, parts, jobs = cars[0][0].simulator, list[Effects](), list[_Part](), list[Job]()
    for i, car in enumerate(cars):
        constants, effects = folded_into(*car)
        rest.append(effects)
        for k, (run, wrench) in enumerate(zip(runs, wrenches, strict=True)):
            if run.fed and "measured_speed" not in simulator.inputs:
                raise SimulatorError(
                    f"{run.name}: has no tau_cmd, and the simulator no input measured_speed that would stand for it; "
                    "log the torque, or give the simulator such an input"
                )
            for part, job in _asked((i, k), run, constants, effects, horizons, wrench):
                parts.append(part)
                jobs.append(job)
    out = [[np.zeros((len(run.starts), horizons, len(CHANNELS))) for run in runs] for _ in cars]
    for part, got in zip(parts, roll_all(jobs), strict=True):
        run, effects = runs[part.run], rest[part.car]
        steps = simulator.steps_in(run.period)
        motion = motion_of(simulator, got, run.period / steps)
        rows = part.lead + run.stride_rows * np.arange(horizons + 1)
        moved = motion[:, rows * steps] - motion[:, rows[:1] * steps]
        first = part.measured if part.lead else _started(simulator, part.measured, motion)
        y = run.y[run.starts[part.at][:, None] + run.stride_rows * np.arange(1, horizons + 1)]
        read = unbiased(*(y[..., i] for i in range(4)), run.read_with(effects))
        errors = np.stack([*read, y[..., 4]], axis=-1) - (first[:, None] + moved[:, 1:])
        there = np.array([simulator.gives(name) for name in CHANNELS])
        errors[..., ~there] = 0.0
        errors[..., ~run.used] = 0.0
        out[part.car][part.run][part.at] = np.where(np.abs(errors) < LARGEST_ERROR, errors, LARGEST_ERROR)
    return out


def _started(simulator: Simulator, measured: Array, motion: Array) -> Array:
    """What predictions without a lead-in begin at [windows, 5]: what was set, or what the simulator begins with."""
    begun = [simulator.sets(name) or name == "psi" for name in CHANNELS]
    return np.where(begun, measured, np.where(np.isfinite(motion[:, 0]), motion[:, 0], measured))


def _asked(
    of: tuple[int, int], run: "WindowedRun", constants: SimulatorConstants, effects: Effects, horizons: int,
    wrench: Array,
) -> list[tuple[_Part, Job]]:  # fmt: skip
    """The roll-outs of one car and run, by the length of their lead-in (early windows have less of it)."""
    reading = run.read_with(effects)
    motion = np.stack([*unbiased(*(run.start_y[:, i] for i in range(4)), reading), run.start_y[:, 4]], axis=-1)
    signals = inputs_along((run.delta, run.tau), motion, run.period, constants, effects, run.bank, wrench)
    leads = np.minimum(run.starts, round(constants.simulator.lead_in / run.period))
    out = []
    for lead in np.unique(leads):
        at = np.flatnonzero(leads == lead)
        rows = int(lead) + horizons * run.stride_rows
        job = job_along(constants, run.period, motion, signals, run.starts[at] - lead, int(lead), rows)
        out.append((_Part(*of, at, int(lead), motion[run.starts[at]]), job))
    return out
