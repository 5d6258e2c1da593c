"""What a calibration would leave open, from the logs and the first guess alone, before anything is fitted.

The car's errors are taken to first order in all that is unknown of it, and the step that makes them least is taken:
what it leaves shows the baseline residuals, whether recordings agree, and which change a diagnosis could name.
"""

import dataclasses
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.equations import kind_of
from drift_drake.car.log.table import Run
from drift_drake.car.parameters import CarParameters
from drift_drake.gap.estimation.baseline import left_of
from drift_drake.gap.estimation.effort import affordable
from drift_drake.gap.estimation.learn_normal import learn_normal
from drift_drake.gap.estimation.robust_fit import robust_scales
from drift_drake.gap.estimation.scores import Day, between_recordings, huber_weights, make_day, units
from drift_drake.gap.estimation.unknowns import OWN
from drift_drake.gap.estimation.usable import seen_effects
from drift_drake.gap.estimation.windows import stride_of, thinned, windowed
from drift_drake.gap.evidence.left_out import asked_in_turn
from drift_drake.gap.identification.by_prediction import EVIDENCE, LeftOpen, left_open, prior_of
from drift_drake.gap.identification.outlook import Outlook, outlook

MOST_WINDOWS = 600
ROUNDS = 3  # of a robust step's weights


class Forecast(NamedTuple):
    """Of a calibration by prediction."""

    left_open: LeftOpen
    outlook: Outlook


def forecast(
    runs: Sequence[Run], car: CarParameters, effects: Effects, known: Sequence[str], stated: frozenset[str]
) -> Forecast:
    """What a calibration by prediction on usable runs would leave open.

    Args:
        car, effects: the first guess; known: parameters that stay as they are; stated: tolerances that the vehicle
            file states.
    """
    vehicle, lacks = car.single_track(), kind_of(car.constants()).LACKS
    seen, _ = seen_effects(runs, tuple(name for name in CATALOGUE if name not in lacks))
    windows = [windowed(run, run.filled, stride_of(vehicle)) for run in runs]
    steps = units(seen, vehicle)
    prior = np.array([prior_of(name, vehicle, stated | frozenset(known)) for name in seen]) / steps
    most = affordable(car.constants(), windows, MOST_WINDOWS)
    day = make_day(thinned(windows, most), car.constants(), effects, seen, steps)
    day = linearly_calibrated(day, prior)
    between = between_recordings(seen, vehicle) / steps
    own = [name for name in OWN if name in seen and CATALOGUE[name].tolerance not in known]
    left = left_of(prior, np.isin(seen, own))
    learnt = learn_normal(day, tuple(seen), steps, prior, between, left)
    return Forecast(
        left_open(day, learnt, own, asked_in_turn(learnt, vehicle)), outlook(day, learnt.normal, left, vehicle)
    )


def linearly_calibrated(day: Day, prior: np.ndarray) -> Day:
    """The day under the car that the errors ask for, to first order.

    Args:
        day: under the first guess; prior: standard deviations [n] of the effects, in their units.
    """
    e = day.errors
    for _ in range(ROUNDS):
        scales = robust_scales(e)
        weights = np.broadcast_to(huber_weights(e, scales), e.shape).reshape(len(e), -1)
        # Derivatives are in scales of the first guess.
        jacobian = day.jacobian[..., : len(prior)] * (robust_scales(day.errors) / scales).reshape(-1)[:, None]
        flat = (day.errors / scales).reshape(len(e), -1)
        information = np.einsum("wip,wi,wiq->pq", jacobian, weights, jacobian, optimize=True)
        gradient = np.einsum("wip,wi,wi->p", jacobian, weights, flat, optimize=True)
        step = -np.linalg.solve(np.diag(1.0 / prior**2) + EVIDENCE * information, EVIDENCE * gradient)
        e = ((flat + jacobian @ step) * scales.reshape(-1)).reshape(e.shape)
    ratio = (robust_scales(day.errors) / robust_scales(e)).reshape(-1)
    return dataclasses.replace(day, errors=e, jacobian=day.jacobian * ratio[:, None])
