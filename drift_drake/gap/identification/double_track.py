"""A double-track car calibrated on logs, by robust prediction errors: for cars that no single-track model follows.

What a vehicle file says nothing of (height of the centre of gravity, springs, the tyres' shape, ...) is unknown beside
its own parameters. Its priors are the scatter from car to car about a first guess (`car.double_track.nearest`).
"""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from drift_drake.car.double_track.nearest import nearest_double_track
from drift_drake.car.double_track.parameters import (
    DoubleTrackConstants,
    DoubleTrackParameters,
    changed_constants,
)
from drift_drake.car.double_track.tyres import TireConstants
from drift_drake.car.effects.catalogue import CATALOGUE, PARAMETRIC
from drift_drake.car.effects.magnitudes import Effects, make_effects
from drift_drake.car.parameters import VehicleParameters
from drift_drake.common.arrays import Array
from drift_drake.gap.estimation.double_track_windows import double_track_errors
from drift_drake.gap.estimation.robust_fit import robust_fit
from drift_drake.gap.estimation.unknowns import Unknown, unknown
from drift_drake.gap.estimation.windows import WindowedRun

EFFECTS = tuple(  # deviations of a vehicle file's parameters but for the mass, and what else a driven car may have
    name for name, effect in CATALOGUE.items()
    if "double_track" in effect.fitted or effect.tolerance not in (None, "mass")
)  # fmt: skip
NO_PARAMETERS = [name for name in EFFECTS if CATALOGUE[name].double_track == "effect" and name not in PARAMETRIC]
EVIDENCE = 0.2  # power of the criterion: each moment lies in five windows
WIDTHS = (100.0, 8.0)  # of the loss (`robust_fit`)
LARGEST_WHEELS = 0.45  # inertia of a rear wheel over that of the axle with engine and gearbox
FURTHEST = 4.0  # standard deviations of a prior


class Deviation(NamedTuple):
    """How far a quantity of the double-track car alone may be from the first guess, from car to car."""

    deviation: float
    relative: bool = True  # of its logarithm
    low: float = 0.0
    high: float = np.inf


OWN = {
    "cg_height": Deviation(0.15),
    "roll_stiffness": Deviation(0.3),  # of both axles
    "front_roll_share": Deviation(0.08, relative=False, low=0.1, high=0.9),  # of it
    "longitudinal_stiffness": Deviation(0.3),
    "longitudinal_friction": Deviation(0.15),
    "load_sensitivity": Deviation(0.06, relative=False, high=0.4),
    "shape": Deviation(0.1, relative=False, low=1.02, high=1.9),
    "curvature": Deviation(0.5, relative=False, low=-4.0, high=0.99),
    "lateral_relaxation": Deviation(0.4),
    "longitudinal_relaxation": Deviation(0.4),
    "wheel_inertia": Deviation(0.3),
    "differential_preload": Deviation(100.0, relative=False),  # [N m]
    "differential_share": Deviation(0.2, relative=False, high=1.0),
    "ackermann": Deviation(0.3, relative=False, high=1.5),
    "steering_compliance": Deviation(0.6),
}
"""The tyres' are those of all four; stiffnesses and friction differ between the axles by effects of the catalogue."""


class DoubleTrackFit(NamedTuple):
    """A double-track car as logs show it."""

    vehicle: DoubleTrackParameters
    effects: Effects  # that are none of its parameters
    found: dict[str, float]  # magnitudes of all that was unknown, to start another fit from


def identify_double_track(
    runs: Sequence[WindowedRun],
    first_guess: VehicleParameters,
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
    guess = nearest_double_track(first_guess)
    constants = guess.constants()
    names = (*EFFECTS, *more)
    unknowns = [unknown(name, first_guess, frozenset()) for name in names]
    unknowns += [_unknown(name, constants) for name in OWN]
    dense = [_dense(run) for run in runs]

    def predicted(found: Mapping[str, float]) -> Array:
        return double_track_errors(dense, *_car(constants, found))

    start = None if near is None else np.array([near.get(u.name, u.start) for u in unknowns])
    fit = robust_fit(predicted, unknowns, EVIDENCE, start, WIDTHS if near is None else WIDTHS[-1:])
    found = dict(zip(fit.names, (float(q) for q in fit.theta), strict=True))
    car, effects = _car(constants, found)
    rest = Effects()._replace(**{name: getattr(effects, name) for name in (*NO_PARAMETERS, *more)})
    return DoubleTrackFit(guess.with_constants(changed_constants(car, effects)), rest, found)


def _dense(run: WindowedRun) -> WindowedRun:
    """A window from each tenth of a second on."""
    if len(run.starts) == 0:
        return run
    return dataclasses.replace(run, starts=np.arange(run.starts[0], run.starts[-1] + 1, run.stride_rows))


def _first(name: str, car: DoubleTrackConstants) -> float:
    """What a quantity of `OWN` is on a car."""
    if name == "roll_stiffness":
        return float(car.front_roll_stiffness + car.rear_roll_stiffness)
    if name == "front_roll_share":
        return float(car.front_roll_stiffness / (car.front_roll_stiffness + car.rear_roll_stiffness))
    return float(getattr(car if name in car._fields else car.rear_tire, name))


def _unknown(name: str, car: DoubleTrackConstants) -> Unknown:
    """In standard deviations from the first guess."""
    deviation, relative, low, high = OWN[name]
    first = _first(name, car)
    if relative:
        return Unknown(name, 1.0, 1.0, -FURTHEST, FURTHEST, 0.0)
    low, high = max((low - first) / deviation, -FURTHEST), min((high - first) / deviation, FURTHEST)
    return Unknown(name, 1.0, 1.0, low, high, 0.0)


def _car(first: DoubleTrackConstants, found: Mapping[str, float]) -> tuple[DoubleTrackConstants, Effects]:
    """The car with magnitudes of the unknowns, and the effects among them."""
    own = {name: _moved(name, first, found[name]) for name in OWN}
    effects = make_effects({name: q for name, q in found.items() if name not in OWN})
    total, share = own.pop("roll_stiffness"), own.pop("front_roll_share")
    longitudinal = {name: own.pop(name) / _first(name, first) for name in ("longitudinal_stiffness",
                                                                           "longitudinal_friction")}  # fmt: skip
    # It is a part of what turns with the axle.
    rotating = float(changed_constants(first, effects).rear_axle_inertia)
    own["wheel_inertia"] = min(own["wheel_inertia"], LARGEST_WHEELS * rotating)
    of_tires = {name: own.pop(name) for name in tuple(own) if name in TireConstants._fields}

    def tire(before: TireConstants) -> TireConstants:
        scaled = {name: factor * getattr(before, name) for name, factor in longitudinal.items()}
        return before._replace(**scaled, **of_tires)

    car = first._replace(
        **own, front_roll_stiffness=total * share, rear_roll_stiffness=total * (1.0 - share),
        front_tire=tire(first.front_tire), rear_tire=tire(first.rear_tire),
    )  # fmt: skip
    return car, effects


def _moved(name: str, car: DoubleTrackConstants, by: float) -> float:
    deviation, relative, _, _ = OWN[name]
    first = _first(name, car)
    return first * float(np.exp(deviation * by)) if relative else first + deviation * by
