"""From logs of a car and a first guess of it to the calibrated car, with intervals and what the logs cannot tell.

Two criteria: the filter's likelihood, exact where its innovations are white, and robust prediction errors where they
are not (`by_prediction`). The logs choose.
"""

import dataclasses
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from drift_drake.estimation.admitted import admit
from drift_drake.estimation.prior import TWO_SIDED
from drift_drake.estimation.problem import filter_case, make_problem
from drift_drake.estimation.unknowns import FIELDS, OWN, folded
from drift_drake.estimation.usable import part_of, seen_effects
from drift_drake.estimation.windows import stride_of, windowed
from drift_drake.identification.by_likelihood import identify_by_likelihood
from drift_drake.identification.by_prediction import PredictionFit, fit_by_prediction
from drift_drake.identification.calibration import Calibration, Identification, Parameter, not_identified, tied
from drift_drake.identification.estimate import Trust, check_effect_names
from drift_drake.identification.held_out import HeldOut
from drift_drake.identification.options import EFFECTS, KNOWN, Criterion
from drift_drake.logs.table import InvalidLogError, Run, read_case, stated_noise
from drift_drake.standard_output import Progress
from drift_drake.vehicle.catalogue import CATALOGUE
from drift_drake.vehicle.effects import Effects
from drift_drake.vehicle.parameters import VehicleParameters

NEAR = 20.0  # mean square up to which a fit by likelihood may still make innovations white
WHITE = 0.1  # row weight of that fit, from which they are
FURTHER = (  # that a car may have beside those asked for, taken in where held-out prediction asks for them
    "steering_lag", "torque_lag", "aero_drag", "front_rear_friction_split", "longitudinal_load_transfer",
    "lateral_load_transfer", "tyre_relaxation", "sliding_friction_drop",
)  # fmt: skip


def identify(
    runs: Sequence[Run],
    vehicle: VehicleParameters,
    effects: Effects = Effects(),
    case: str = "case",
    known: Sequence[str] = KNOWN,
    names: Sequence[str] = EFFECTS,
    stated: Mapping[str, float] | None = None,
    progress: Progress | None = None,
    criterion: Criterion = "auto",
    tolerances: frozenset[str] = frozenset(),
) -> Identification:
    """Calibrates a car on runs.

    Args:
        runs: of one car, of one or several days; vehicle, effects: the first guess;
        known: parameters whose tolerance in the vehicle is believed as it is;
        names: effects that may belong to the car, beside those of the first guess;
        stated: noise levels that are known otherwise (`make_problem`); progress: called with a stage and a share;
        criterion: "auto" is the likelihood where innovations are white beside the car that it finds, else prediction;
        tolerances: names of those that the vehicle file states: prediction believes them, times two.

    Raises:
        InvalidLogError: no run can be used, or prediction is asked for without the column beta.
        InvalidVehicleError: a name that is no parameter or effect.
    """
    began = time.perf_counter()
    tell = progress or (lambda _stage, _share: None)
    check_effect_names(known, names)
    runs, _, warnings = admit(runs, vehicle)
    warnings += [
        f"effect {name}: calibrated anyway, as a parameter of the vehicle file" for name in names if name in OWN
    ]
    names = [name for name in names if name not in OWN]
    lacks_beta = any(run.beta is None for run in runs)
    if criterion == "prediction" and lacks_beta:
        raise InvalidLogError(f"{case}: column beta is missing; prediction needs it, choose --criterion likelihood")
    if criterion == "auto" and lacks_beta:
        criterion, warnings = "likelihood", [*warnings, "column beta is missing: calibrated by likelihood"]
    found = None
    part, left_out = part_of(runs)  # the filter's derivatives are kept for every row
    if criterion != "likelihood":
        further = tuple(dict.fromkeys([*names, *FURTHER]))
        predicted = by_prediction(runs, vehicle, effects, known, further, tolerances,
                                  lambda stage, share: tell(stage, 0.5 * share))  # fmt: skip
        why = []
        if criterion == "auto":
            white = whiteness(part, predicted.vehicle, predicted.effects, stated)
            why = [white.sentence()]
            if white.may_be_white:
                found = white_or_none(part, vehicle, effects, case, known, names, stated, tell)
        if found is None:
            found = stated_in_full(predicted, why, case, vehicle, effects, sum(len(run) for run in runs))
    if found is None:
        found = identify_by_likelihood(part, vehicle, effects, case, known, names, stated, tell)
    c = found.calibration
    warnings += left_out if c.criterion == "likelihood" else []
    c = dataclasses.replace(c, seconds=time.perf_counter() - began, warnings=[*warnings, *c.warnings])
    tell("done", 1.0)
    return dataclasses.replace(found, calibration=c)


@dataclasses.dataclass(frozen=True)
class Whiteness:
    """Of the innovations that count: the median over runs of their mean square, and their correlation row to row."""

    mean_square: float
    correlation: float  # the largest of all channels, in absolute value

    @property
    def may_be_white(self) -> bool:
        """Whether a fit by likelihood is worth a try."""
        return self.mean_square < NEAR

    def sentence(self) -> str:
        """Why prediction was the criterion."""
        if not np.isfinite(self.mean_square):
            return "calibrated by prediction: the filter of the nominal equations loses the car on these logs"
        return (
            f"calibrated by prediction: innovations are not white (mean square {self.mean_square:.3g}, correlation "
            f"from row to row {self.correlation:.2f})"
        )


def whiteness(
    runs: Sequence[Run], vehicle: VehicleParameters, effects: Effects, stated: Mapping[str, float] | None
) -> Whiteness:
    """Innovations of the car as it is: where they are white the likelihood is exact. A filter that diverges is not."""
    problem = make_problem(runs, vehicle, stated=stated, own=effects)
    gains = filter_case(problem, np.zeros(problem.nuisances), ())
    squares, tied = [], [0.0]
    for run, e in zip(problem.runs, gains.innovations, strict=True):
        kept = e[run.counted][:, run.used]
        if not np.isfinite(kept).all() or len(kept) < 3:
            return Whiteness(float("inf"), 1.0)
        squares.append(float(np.mean(np.median(kept**2, axis=0) / 0.4549)))
        spread = kept - kept.mean(axis=0)
        tied.append(float(np.max(np.abs(np.sum(spread[1:] * spread[:-1], axis=0) / np.sum(spread**2, axis=0)))))
    return Whiteness(float(np.median(squares)), float(np.median(tied[1:])) if len(tied) > 1 else 1.0)


def white_or_none(
    runs: Sequence[Run], vehicle: VehicleParameters, effects: Effects, case: str, known: Sequence[str],
    names: Sequence[str], stated: Mapping[str, float] | None, tell: Progress,
) -> Identification | None:  # fmt: skip
    """The car calibrated by likelihood if its innovations are then white; None if not, if the filter fails, or if no
    run is long enough for it."""
    try:
        found = identify_by_likelihood(runs, vehicle, effects, case, known, names, stated, tell)
    except (np.linalg.LinAlgError, InvalidLogError):
        return None
    return found if found.calibration.row_weight >= WHITE else None


def by_prediction(
    runs: Sequence[Run], vehicle: VehicleParameters, effects: Effects, known: Sequence[str], names: Sequence[str],
    tolerances: frozenset[str], tell: Progress,
) -> PredictionFit:  # fmt: skip
    """The car that predicts best; parameters that are known stay as they are."""
    held = {name for name, info in CATALOGUE.items() if info.tolerance in known}
    seen, _ = seen_effects(runs, tuple(CATALOGUE))
    own = [name for name in OWN if name not in held and name in seen]
    candidates = [name for name in names if name in seen and name not in OWN]
    stated = tolerances | frozenset(known)
    windows = [windowed(run, run.filled, stride_of(vehicle)) for run in runs]
    return fit_by_prediction(windows, vehicle, effects, own, candidates, stated, seen, tell)


def stated_in_full(
    found: PredictionFit, why: list[str], case: str, vehicle: VehicleParameters, effects: Effects, rows: int,
) -> Identification:  # fmt: skip
    """Parameters, tolerances and the file, all of one fit by prediction; `why`: that was the criterion."""
    parameters: dict[str, Parameter] = {}
    changes: dict[str, float] = {}
    start, _ = folded(vehicle, effects)
    for u, sigma in zip(found.unknowns, found.deviations, strict=True):
        info = CATALOGUE[u.name]
        field = FIELDS.get(u.name)
        scale = 1.0 if field is None or u.name == "cg_shift" else float(getattr(start, field))
        origin = float(getattr(start, field)) if field else 0.0
        value = float(getattr(found.vehicle if field else found.effects, field or u.name))
        sigma, prior = float(min(sigma, u.prior)) * scale, u.prior * scale
        low, high = value - TWO_SIDED * sigma, value + TWO_SIDED * sigma
        low = max(low, 0.0) if not info.signed or (field and u.name != "cg_shift") else low
        unit = VehicleParameters.__dataclass_fields__[field].metadata["unit"] if field else info.unit
        kind = "free" if u.name in OWN else "effect"
        first = origin if field else float(getattr(effects, u.name))
        parameters[field or u.name] = Parameter(unit, first, value, low, high, sigma, prior, 1.0, kind)
        if info.tolerance:
            relative = info.tolerance not in ("front_axle_distance", "steering_offset")
            changes[info.tolerance] = sigma / (value if relative else 1.0)
    shown, prior_of = list(parameters), np.array([p.prior for p in parameters.values()])
    sigmas = np.array([p.deviation for p in parameters.values()])
    covariance = found.correlation * np.outer(sigmas, sigmas)
    calibration = Calibration(
        case=case, parameters=parameters, correlation=found.correlation.tolist(),
        not_identified=not_identified(shown, prior_of, covariance), tied=tied(shown, found.correlation),
        left_out=list(found.left_out), held_out=found.held_out, trust=Trust(1.0, 1.0), row_weight=1.0, everyday=None,
        seconds=0.0, warnings=[*why, *worse_states(found.held_out), *found.differences],
        criterion="prediction", normal=found.normal,
    )  # fmt: skip
    tolerance = dataclasses.replace(found.vehicle.tolerance, **changes)
    return Identification(calibration, found.vehicle.replace(tolerance=tolerance), found.effects, rows)


def worse_states(h: HeldOut) -> list[str]:
    """Warnings of states that the calibrated car predicts worse than the first guess."""
    rows = zip(h.states, h.before[-1], h.after[-1], strict=True)
    return [f"{state} is predicted worse than by the first guess ({after:.3g}, {before:.3g} before)"
            for state, before, after in rows if state in h.worse]  # fmt: skip


class Days(NamedTuple):
    """Runs of all case folders, one for each day, with the noise that imports stated, and a name for them together."""

    runs: list[Run]
    stated: dict[str, float]
    case: str


def read_days(folders: Sequence[str | Path]) -> Days:
    """Reads case folders (`logs.table.read_case`); runs of several days have their folder's name before their own."""
    runs, noise = [], dict[str, list[float]]()
    for folder in folders:
        day = read_case(folder)
        prefix = f"{Path(folder).resolve().name}/" if len(folders) > 1 else ""
        runs += [dataclasses.replace(run, name=prefix + run.name) for run in day]
        for name, level in stated_noise(folder).items():
            noise.setdefault(name, []).append(level)
    stated = {name: float(np.median(levels)) for name, levels in noise.items()}
    return Days(runs, stated, "+".join(Path(folder).resolve().name for folder in folders))
