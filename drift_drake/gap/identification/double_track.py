"""A double-track car calibrated on logs, by robust prediction errors: for cars that no single-track model follows.

What a vehicle file says nothing of (height of the centre of gravity, springs, the tyres' shape, ...) is unknown besides
its own parameters. Its priors are the scatter from car to car about a first guess (`car.double_track.nearest`).
"""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from drift_drake.car.car_file import PlantParameters
from drift_drake.car.double_track.nearest import nearest_double_track
from drift_drake.car.double_track.parameters import DoubleTrackParameters
from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.equations import folded_into
from drift_drake.common.arrays import Array
from drift_drake.gap.estimation.robust_fit import robust_fit
from drift_drake.gap.estimation.unknowns import deviations_of, unknown, with_found
from drift_drake.gap.estimation.windows import WindowedRun, errors

EFFECTS = tuple(  # deviations of a vehicle file's parameters but for the mass, and what else a driven car may have
    name for name, effect in CATALOGUE.items()
    if "double_track" in effect.fitted or effect.tolerance not in (None, "mass")
)  # fmt: skip
EVIDENCE = 0.2  # power of the criterion: each moment lies in five windows
WIDTHS = (100.0, 8.0)  # of the loss (`robust_fit`)


class DoubleTrackFit(NamedTuple):
    """A double-track car as logs show it."""

    vehicle: DoubleTrackParameters
    effects: Effects  # that are none of its parameters
    found: dict[str, float]  # magnitudes of all that was unknown, to start another fit from


def identify_double_track(
    runs: Sequence[WindowedRun],
    first_guess: PlantParameters,
    more: Sequence[str] = (),
    near: Mapping[str, float] | None = None,
) -> DoubleTrackFit:
    """The double-track car that predicts the runs best.

    Args:
        more: effects that may be there in addition to `EFFECTS`, such as a sensor's bias.
        near: magnitudes of a fit without them (`DoubleTrackFit.found`), to start from in place of the first guess.

    Raises:
        InvalidVehicleError: what predicts best is no car.
        numpy.linalg.LinAlgError: the runs identify nothing.
    """
    guess = first_guess if isinstance(first_guess, DoubleTrackParameters) else nearest_double_track(first_guess)
    constants = guess.constants()
    names = (*EFFECTS, *more)
    unknowns = [unknown(name, guess.single_track(), frozenset()) for name in names]
    unknowns += deviations_of(constants)
    dense = [_dense(run) for run in runs]

    def predicted(found: Mapping[str, float]) -> Array:
        return errors(dense, *with_found(constants, Effects(), found))

    start = None if near is None else np.array([near.get(u.name, u.start) for u in unknowns])
    fit = robust_fit(predicted, unknowns, EVIDENCE, start, WIDTHS if near is None else WIDTHS[-1:])
    found = dict(zip(fit.names, (float(q) for q in fit.theta), strict=True))
    car, rest = folded_into(*with_found(constants, Effects(), found))
    return DoubleTrackFit(guess.with_constants(car), rest, found)


def _dense(run: WindowedRun) -> WindowedRun:
    """A window from each tenth of a second on."""
    if len(run.starts) == 0:
        return run
    return dataclasses.replace(run, starts=np.arange(run.starts[0], run.starts[-1] + 1, run.stride_rows))
