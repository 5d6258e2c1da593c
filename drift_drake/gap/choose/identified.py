"""The car that a few seconds of lively driving identify: parameters, effects, and an additional fault if needed.

All of a car's drives are fitted by the filter's likelihood (`identification.identify`): parameters and the effects that
most driven cars have. A car may have an additional fault, such as a steering that is slow or a sensor that is off. Each
of `ONE_MORE` is then fitted with the others. And it may follow no single-track equations: a double-track car is fitted.
"""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from drift_drake.car.double_track.nearest import nearest_double_track
from drift_drake.car.effects.catalogue import CATALOGUE, fitted
from drift_drake.car.effects.delays import LATE
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.equations import folded_into
from drift_drake.car.equations_step import EquationsStepModel
from drift_drake.car.given_vehicle import label_of, single_track_of
from drift_drake.car.internal_states import BEYOND, LAGGED
from drift_drake.car.known_car import known_car_model
from drift_drake.car.log.table import InvalidLogError, Run
from drift_drake.car.parameters import CarParameters, InvalidVehicleError, VehicleParameters
from drift_drake.car.sensor_errors import SENSORS
from drift_drake.car.single_track.effects_step import EffectsStepModel
from drift_drake.common.arrays import Array
from drift_drake.common.errors import unit_suffix
from drift_drake.gap.estimation.robust_fit import robust_fit
from drift_drake.gap.estimation.unknowns import deviations_of, magnitudes, unknown, with_found
from drift_drake.gap.estimation.windows import WindowedRun, count_of, errors, errors_of_all
from drift_drake.gap.identification.identify import calibrate
from drift_drake.gap.identification.stated import Asked

# In addition to the vehicle's own parameters: what a driven car may have that a step of its model can hold.
EFFECTS = fitted("drives")
ONE_MORE = fitted("alone")
BIASES = tuple(name for name in SENSORS if CATALOGUE[name].unit != "-")  # that a double-track car may have all of
LEAST_WINDOWS = 20  # of half a second, one each 0.2 s
# Deviations of a vehicle file's parameters but for the mass, and what else a driven car may have.
OF_DOUBLE_TRACK = tuple(
    name for name, effect in CATALOGUE.items()
    if "double_track" in effect.fitted or effect.tolerance not in (None, "mass")
)  # fmt: skip
EVIDENCE = 0.2  # power of a double-track car's criterion: each moment lies in five windows
WIDTHS = (100.0, 8.0)  # of its loss (`robust_fit`)
NOT_PLANNED = tuple(name for name in BEYOND if name not in (*LAGGED, *SENSORS, *LATE))


class IdentifiedCar(NamedTuple):
    """A car as drives show it."""

    vehicle: CarParameters
    effects: Effects

    @property
    def name(self) -> str:
        """What it is called in a sentence, with what it has in addition to the usual effects."""
        kind = "car" if isinstance(self.vehicle, VehicleParameters) else label_of(self.vehicle)
        return f"the identified {kind}" + (f" with {', '.join(self.one_more)}" if self.one_more else "")

    @property
    def beyond(self) -> tuple[str, ...]:
        """Of its effects those that a controller does not plan with, and their size, such as a road's grade."""
        return self._said(NOT_PLANNED)

    @property
    def one_more(self) -> tuple[str, ...]:
        """Which of `ONE_MORE` it has, and its size."""
        return self._said(ONE_MORE)

    def _said(self, names: Sequence[str]) -> tuple[str, ...]:
        present = [(name, getattr(self.effects, name)) for name in names if getattr(self.effects, name) != 0.0]
        return tuple(f"{name} {size:.3g}{unit_suffix(CATALOGUE[name].unit)}" for name, size in present)

    def with_limit(self, rate: float) -> "IdentifiedCar":
        """The car with a limit of the steering's rate [rad/s], which a check showed; its own where it has one."""
        if math.isinf(rate) or self.effects.steering_rate_limit > 0.0:
            return self
        return self._replace(effects=self.effects._replace(steering_rate_limit=rate))

    def step_model(self) -> EffectsStepModel | EquationsStepModel:
        """What a controller plans with; its readings lose their `sensor_errors`."""
        return known_car_model(self.vehicle, self.effects)

    def errors(self, judged: Sequence[WindowedRun]) -> Array:
        """Of its predictions of drives, from a smoothed measurement on [windows, HORIZONS, 5]."""
        return errors(judged, self.vehicle.constants(), self.effects)


def identified(
    runs: Sequence[Run], first_guess: VehicleParameters, more: Sequence[str] = (), start: Effects = Effects()
) -> IdentifiedCar | None:
    """The car that fits the drives best, by the filter's likelihood; None where they are too short or it has no peak.

    Nothing is believed known but the equations: masses, inertias, stiffnesses, friction and the drive's gain have
    broad priors, and the effects that a driven car may have are fitted with them (`calibrate`).

    Args:
        more: effects that it may have in addition to `EFFECTS`; start: of some of them, which the car has, too.
    """
    try:
        with np.errstate(divide="ignore", invalid="ignore"):
            # What gentle drives do not show is judged by how the car predicts (`gap.choose.choice`), not kept.
            names = (*EFFECTS, *more)
            asked = Asked(first_guess, start, known=(), names=names, criterion="likelihood", force=True, unseen=())
            found = calibrate(runs, asked)
    except (InvalidLogError, InvalidVehicleError, np.linalg.LinAlgError):
        return None
    return IdentifiedCar(single_track_of(found.vehicle), found.effects)


def identified_with_own_states(
    judged: Sequence[WindowedRun],
    first_guess: CarParameters,
    more: Sequence[str] = (),
    near: Mapping[str, float] | None = None,
) -> tuple[IdentifiedCar, dict[str, float]] | None:
    """The car of four wheels that predicts the drives best, of the first guess's kind, or double-track where that is
    single-track; None where they are too short or identify none.

    What a vehicle file says nothing of (height of the centre of gravity, springs, the tyres' shape, ...) is unknown
    besides its own parameters. Its priors are the scatter from car to car about a first guess
    (`car.double_track.nearest`).

    Args:
        more: effects that it may have in addition to `OF_DOUBLE_TRACK`.
        near: magnitudes of one identified without these, to start from.

    Returns:
        The car, and the magnitudes of all that was unknown of it.
    """
    if count_of(judged) < LEAST_WINDOWS:
        return None
    dense = [_dense(run) for run in judged]

    def predicted(found: Sequence[Mapping[str, float]]) -> list[Array]:
        return errors_of_all(dense, [with_found(constants, Effects(), one) for one in found])

    try:
        with np.errstate(all="ignore"):
            guess = nearest_double_track(first_guess) if isinstance(first_guess, VehicleParameters) else first_guess
            constants, vehicle = guess.constants(), guess.single_track()
            unknowns = [unknown(name, vehicle, frozenset()) for name in (*OF_DOUBLE_TRACK, *more)]
            unknowns += deviations_of(constants)
            start = None if near is None else np.array([near.get(u.name, u.start) for u in unknowns])
            fit = robust_fit(predicted, unknowns, EVIDENCE, start, WIDTHS if near is None else WIDTHS[-1:])
            found = magnitudes(fit.names, fit.theta)
            car, effects = folded_into(*with_found(constants, Effects(), found))
            return IdentifiedCar(guess.with_constants(car), effects), found
    except (InvalidVehicleError, np.linalg.LinAlgError):
        return None


def _dense(run: WindowedRun) -> WindowedRun:
    """A window from each tenth of a second on."""
    if len(run.starts) == 0:
        return run
    return dataclasses.replace(run, starts=np.arange(run.starts[0], run.starts[-1] + 1, run.stride_rows))
