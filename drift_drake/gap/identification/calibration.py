"""What an identification says of a car: parameters with intervals, what is not identified, how well it predicts."""

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.log.table import Run
from drift_drake.car.parameters import CarParameters, VehicleParameters
from drift_drake.common.errors import DriftDrakeError
from drift_drake.common.plain_files import named_number, read_json
from drift_drake.gap.estimation.filter_state import CHANNELS
from drift_drake.gap.estimation.freeform import FORCE_CHANNELS, FUNCTIONS
from drift_drake.gap.estimation.normal import Normal, normal_from_data
from drift_drake.gap.estimation.problem import ModelDiscrepancy
from drift_drake.gap.identification.driving import Driving
from drift_drake.gap.identification.estimate import Trust
from drift_drake.gap.identification.held_out import HeldOut
from drift_drake.gap.identification.options import LARGEST_SCALE
from drift_drake.gap.identification.outlook import Outlook

LEFT = 0.5  # of the prior's standard deviation that is left
PART = 0.3  # of a direction's length that a parameter must hold to be named
SIMILAR = 0.95  # correlation beyond which only two parameters' combination is known
SHOWN = 3  # combinations that are spelt out; of more the worst, and their number


@dataclasses.dataclass(frozen=True)
class Direction:
    """A combination of parameters, in standard deviations of their priors, and the share of it that is left."""

    parts: dict[str, float]
    left: float

    def sentence(self) -> str:
        """The direction in words."""
        if len(self.parts) == 1:
            return f"{next(iter(self.parts))} ({100 * self.left:.0f} % of the prior's width is left)"
        return f"{self.sides()} ({100 * self.left:.0f} % of the priors' width is left)"

    def sides(self) -> str:
        """Its parameters, those that rise together on one side."""
        sides = [" with ".join(name for name, q in self.parts.items() if q * sign > 0.0) for sign in (1.0, -1.0)]
        return " against ".join(filter(None, sides))


@dataclasses.dataclass(frozen=True)
class Parameter:
    """One unknown: its estimate with a 95 % interval, its standard deviations after and before the logs."""

    unit: str
    start: float
    estimate: float
    low: float
    high: float
    deviation: float
    prior: float
    widened: float  # by how much the interval is wider than that of white innovations
    kind: str  # free, known (held by its tolerance), effect, or unseen (kept at its first guess)


@dataclasses.dataclass(frozen=True)
class Calibration:
    """What an identification says, as plain data. `correlation` is in the order of `parameters`."""

    case: str
    parameters: dict[str, Parameter]
    correlation: list[list[float]]
    not_identified: list[Direction]
    tied: list[tuple[str, str, float]]
    left_out: list[str]  # effects that cannot be distinguished from zero, and that the vehicle file therefore lacks
    held_out: HeldOut
    trust: Trust  # for `drift-drake diagnose --noise-scale --process-scale` on this car's logs
    tempering: float  # and for `--tempering`: the likelihood tempering exponent, in (0, 1]
    discrepancy: ModelDiscrepancy | None  # and what `--calibration` takes out before, where that raises the exponent
    seconds: float
    warnings: list[str]
    criterion: str = "likelihood"  # or "prediction"
    normal: Normal | None = None  # of a car calibrated by prediction, for a diagnosis of a change
    watching: dict[str, Any] | None = None  # of `gap.monitoring.baselines`, for `drift-drake watch`
    catalogue: tuple[str, ...] = tuple(CATALOGUE)  # effects that there were
    disagreed: dict[str, str] = dataclasses.field(default_factory=dict)  # parameters, and who pulls each the most
    driving: Driving | None = None
    outlook: Outlook = dataclasses.field(default_factory=dict)  # detection limits, after more recordings too
    validation: tuple[str, ...] = ()  # stretches that were kept to judge by; none: blocks of all runs

    @property
    def identified(self) -> list[str]:
        """Parameters that are known to half of what was believed before, and that all recordings agree about."""
        return [
            name
            for name, p in self.parameters.items()
            if p.kind != "known" and p.deviation < LEFT * p.prior and name not in self.disagreed
        ]

    def sentence(self) -> str:
        """What was reached, in one sentence."""
        h = self.held_out
        if self.held_out.ratio > 1.0:
            return (
                f"{self.case}: no better than the first guess: {h.judged:g} s ahead on parts that were not fitted, "
                f"errors are {h.ratio:.2f} (95 %: {h.low:.2f} to {h.high:.2f}) of its."
            )
        free = [name for name, p in self.parameters.items() if p.kind != "known"]
        apart = f" (recordings disagree about {len(self.disagreed)})" if self.disagreed else ""
        return (
            f"{self.case}: {len(self.identified)} of {len(free)} parameters identified{apart}; {h.judged:g} s ahead on "
            f"parts that were not fitted, errors are {h.ratio:.2f} (95 %: {h.low:.2f} to {h.high:.2f}) of the first "
            "guess's."
        )


@dataclasses.dataclass(frozen=True)
class Identification:
    """The calibrated car."""

    calibration: Calibration
    vehicle: CarParameters
    effects: Effects
    rows: int  # of the logs
    single_track: tuple[VehicleParameters, Effects] | None = None  # calibrated on the same logs as a double-track car
    first: tuple[CarParameters, Effects] | None = None  # guess
    runs: Sequence[Run] = dataclasses.field(default=(), repr=False)  # as they were given


def not_identified(names: Sequence[str], prior: np.ndarray, covariance: np.ndarray) -> list[Direction]:
    """Combinations that stay as they were believed, the worst first.

    Args:
        prior: standard deviations [n]; covariance: of the posterior [n, n].
    """
    left, directions = np.linalg.eigh(covariance / np.outer(prior, prior))
    out = []
    for i in np.argsort(-left):
        if np.sqrt(max(left[i], 0.0)) <= LEFT:
            break
        v = directions[:, i] * np.sign(directions[np.argmax(np.abs(directions[:, i])), i])
        order = np.argsort(-np.abs(v))
        parts = {names[j]: float(v[j]) for j in order if abs(v[j]) > PART}
        out.append(Direction(parts, min(float(np.sqrt(left[i])), 1.0)))
    return out


def directions(parameters: Mapping[str, Parameter], correlation: np.ndarray) -> list[Direction]:
    """`not_identified` of all parameters that are not known."""
    free = [i for i, p in enumerate(parameters.values()) if p.kind != "known"]
    names, sigma = list(parameters), np.array([p.deviation for p in parameters.values()])
    prior = np.array([p.prior for p in parameters.values()])
    covariance = correlation * np.outer(sigma, sigma)
    return not_identified([names[i] for i in free], prior[free], covariance[np.ix_(free, free)])


def tied(names: Sequence[str], correlation: np.ndarray) -> list[tuple[str, str, float]]:
    """Pairs of parameters that are identified only together, the closest first."""
    pairs = [
        (names[i], names[j], float(correlation[i, j]))
        for i in range(len(names))
        for j in range(i)
        if abs(correlation[i, j]) > SIMILAR
    ]
    return sorted(pairs, key=lambda pair: -abs(pair[2]))


class InvalidCalibrationError(DriftDrakeError, ValueError):
    """A calibration that cannot be used; the message names the file and the remedy."""


@dataclasses.dataclass(frozen=True)
class CarTrust:
    """Factors of the noise and the process, the tempering exponent, and the model discrepancy; or the baseline."""

    noise_scale: float
    process_scale: float
    tempering: float
    discrepancy: ModelDiscrepancy | None
    normal: Normal | None = None  # of a car calibrated by prediction, in place of the others
    catalogue: tuple[str, ...] = ()  # effects that there were when `normal` was learnt

    def options(self) -> dict[str, Any]:
        """As `diagnose` takes them."""
        own = ("normal", "catalogue")
        return {field.name: getattr(self, field.name) for field in dataclasses.fields(self) if field.name not in own}

    def check_knows(self, effects: Sequence[str], path: str | Path) -> None:
        """Checks that the baseline was learnt for all these effects: one that it lacks would be left out in silence.

        Raises:
            InvalidCalibrationError: an effect has been added since, by a package that was installed say.
        """
        lacks = [name for name in effects if name not in self.catalogue] if self.normal is not None else []
        if lacks:
            raise InvalidCalibrationError(
                f"{path}: this calibration does not know {', '.join(lacks)}, which the catalogue has now: calibrate "
                f"again (drift-drake identify --json), or leave {'it' if len(lacks) == 1 else 'them'} out (--exclude "
                f"{' '.join(lacks)})"
            )


def read_trust(path: str | Path) -> CarTrust:
    """Reads them from a calibration's JSON.

    Raises:
        InvalidCalibrationError: unreadable, not JSON, or not what `identify` writes.
    """
    remedy = "write it with 'drift-drake identify --json'"
    data = read_json(path, InvalidCalibrationError, remedy)
    try:
        return trust_of(data)
    except (KeyError, TypeError, AttributeError):
        raise InvalidCalibrationError(
            f"{path}: no trust, tempering and discrepancy of a calibration; {remedy}"
        ) from None
    except ValueError as error:
        raise InvalidCalibrationError(f"{path}: {error}; {remedy}") from None


def trust_of(data: Any) -> CarTrust:
    """The same from the JSON's content; KeyError or TypeError where something is missing, ValueError if off."""
    if data.get("normal"):
        normal = normal_from_data(data["normal"])
        known = data.get("catalogue") or normal.names
        return CarTrust(1.0, 1.0, 1.0, None, normal, tuple(str(name) for name in known))
    discrepancy = data["discrepancy"]
    return CarTrust(
        _within("trust.noise", data["trust"]["noise"], LARGEST_SCALE),
        _within("trust.process", data["trust"]["process"], LARGEST_SCALE),
        _within("tempering", data["tempering"], 1.0),
        None if discrepancy is None else _discrepancy(discrepancy),
    )


def _discrepancy(data: Mapping[str, Any]) -> ModelDiscrepancy:
    forces = {
        name: [named_number(f"discrepancy.forces.{name}", q) for q in data["forces"][name]] for name in FORCE_CHANNELS
    }
    for name, weights in forces.items():
        if len(weights) != FUNCTIONS:
            raise ValueError(f"discrepancy.forces has {len(weights)} weights for {name}, expected {FUNCTIONS}")
    offsets = {str(name): named_number(f"discrepancy.offsets.{name}", q) for name, q in data["offsets"].items()}
    unknown = sorted(set(offsets) - set(CHANNELS)) + sorted(set(data["forces"]) - set(FORCE_CHANNELS))
    if unknown:
        raise ValueError(f"discrepancy names '{unknown[0][:60]}', which is no channel")
    return ModelDiscrepancy(forces, offsets, _within("discrepancy.tempering", data["tempering"], 1.0))


def _within(name: str, value: Any, high: float) -> float:
    return named_number(name, value, lambda q: 0.0 < q <= high, f", give a number above 0, up to {high:g}")


def grouped(found: Sequence[Direction], disagreed: Mapping[str, str]) -> list[str]:
    """At most one sentence of single quantities, one of combinations, and one for each recording that disagrees.

    Args:
        found: what logs do not identify, the worst first; disagreed: by quantity the recording that differs the most.
    """
    single = [direction for direction in found if len(direction.parts) == 1]
    combined = [direction for direction in found if len(direction.parts) > 1]
    sentences = [single[0].sentence()] if len(single) == 1 else []
    if len(single) > 1:
        sentences.append(f"{', '.join(next(iter(d.parts)) for d in single)} ({_left(single, 'each prior')} is left)")
    if len(combined) > SHOWN:
        worst = "; ".join(direction.sides() for direction in combined[:SHOWN])
        sentences.append(f"{len(combined)} combinations ({_left(combined, 'the priors')} is left), the worst: {worst}")
    else:
        sentences += [direction.sentence() for direction in combined]
    for recording in dict.fromkeys(disagreed.values()):
        names = ", ".join(name for name, who in disagreed.items() if who == recording)
        sentences.append(f"{names} (the recordings ask for different values, {recording} the most)")
    return sentences


def _left(found: Sequence[Direction], whose: str) -> str:
    """The shares of the width that are left, as a range."""
    least, most = (round(100.0 * share(direction.left for direction in found)) for share in (min, max))
    possessive = f"{whose}'" if whose.endswith("s") else f"{whose}'s"
    return f"{least} to {most} % of {possessive} width" if least < most else f"{most} % of {possessive} width"
