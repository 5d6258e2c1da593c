"""The answer to one case: what a diagnosis says, as plain data and JSON."""

import dataclasses
import json
import math
from pathlib import Path
from typing import Any

from drift_drake.errors import DriftDrakeError
from drift_drake.estimation.interval import Interval
from drift_drake.vehicle.catalogue import CATALOGUE

ASKED_FIRST = ("friction_level", "mass_error", "rear_stiffness_error", "steering_delay", "torque_gain_error")
"""Effects whose detection limits the sentence of a `none` states; the others are in the answer and its report."""


class InvalidAnswerError(DriftDrakeError, ValueError):
    """An answer file that cannot be used; the message names the file and the mend."""


class UnplannableError(DriftDrakeError, ValueError):
    """An answer that no drive can follow; the message says why."""


@dataclasses.dataclass(frozen=True)
class Answer:
    """One case's answer. Beyond the contract's keys: tolerances, reduction by state and horizon, warnings."""

    case: str
    verdict: str  # effect, none or unknown
    causes: list[str]
    posterior: dict[str, float]
    ambiguity: list[str]
    magnitudes: dict[str, Interval]  # in the catalogue's units
    where: dict[str, Any]
    reduction: Interval
    seconds: float
    tolerances: dict[str, float]  # deviations from the vehicle file found beside the causes, in tolerances
    details: dict[str, Any]
    warnings: list[str]

    def to_json(self) -> str:
        """The answer as JSON text."""
        return json.dumps(_rounded(dataclasses.asdict(self)), indent=2)

    def write(self, path: str | Path) -> None:
        """Writes the JSON file."""
        Path(path).write_text(self.to_json() + "\n")

    def sentence(self) -> str:
        """The verdict in one sentence."""
        if self.verdict == "none" and "detection" in self.details:
            return (
                f"{self.case}: nothing that is not normal for this car (probability {self.posterior['none']:.2f})."
                + (self._could_show())
            )
        if self.verdict == "none":
            worth = self.details.get("row_weight", 1.0)
            if worth < 1.0:
                return (
                    f"{self.case}: no gap beyond the vehicle file's tolerances and the car's everyday misfit, with a "
                    f"row worth {worth:.2g} (probability {self.posterior['none']:.2f})."
                )
            return f"{self.case}: no gap beyond the vehicle file's tolerances and the sensors' noise."
        if self.verdict == "unknown":
            return (
                f"{self.case}: there is a gap that no catalogued effect explains "
                f"(probability {self.posterior['unknown']:.2f})." + self._nearest()
            )
        least = self.details.get("at_least", [])
        parts = [_stated(name, self.magnitudes[name], name in least) for name in self.causes]
        probability = self.posterior["+".join(sorted(self.causes))]
        remove = "it removes" if len(parts) == 1 else "they remove"
        return (
            f"{self.case}: {' and '.join(parts)}, probability {probability:.2f}; {remove} "
            f"{100 * self.reduction.estimate:.0f} % of the gap on parts of runs that were not fitted."
        )

    def _could_show(self) -> str:
        """What the logs of a `none` would have shown, by effects that people ask for first."""
        limits = self.details["detection"]
        shown = [name for name in ASKED_FIRST if name in limits and limits[name]["least"] is not None]
        blind = [name for name in ASKED_FIRST if name in limits and limits[name]["least"] is None]
        parts = [f"{name} {limits[name]['least']:.2g}{_unit(name)}" for name in shown]
        told = f" These logs would have shown (95 %) {', '.join(parts)}" if parts else ""
        return told + (f"{', but no' if told else ' These logs cannot show'} {', '.join(blind)}." if blind else ".")

    def _nearest(self) -> str:
        """What `unknown` leaves an engineer with (`diagnosis.nearest`); nothing in answers of before."""
        found = self.details.get("nearest")
        if not found:
            return ""
        causes = [_stated(name, Interval(**m)) for name, m in found["magnitudes"].items()]
        if found["free_forces_remove"] is None:
            near = " and ".join(causes) or "the calibrated car as it is"
            return f" The nearest known, {near}, removes {100 * found['removes']:.0f} % of it on held-out blocks."
        free = f"{100 * found['free_forces_remove']:.0f} %"
        where = "of the nominal car's squared innovations on parts of runs that were not fitted"
        if not causes:
            return f" No known cause comes near; free forces remove {free} {where}."
        removes = f"{'removes' if len(causes) == 1 else 'remove'} {100 * found['removes']:.0f} %"
        return f" The nearest known, {' and '.join(causes)}, {removes} {where}, free forces {free}."


def _stated(name: str, m: Interval, at_least: bool = False) -> str:
    """A cause with its magnitude and interval, in words; one at the end of what is believed possible is a bound."""
    unit = _unit(name)
    numbers = [f"{q:.{significant_digits(m)}g}" for q in (m.estimate, m.low, m.high)]
    if at_least:
        return f"{name} of {numbers[0]}{unit} at least"
    return f"{name} {numbers[0]}{unit} (95 %: {numbers[1]} to {numbers[2]})"


def _unit(name: str) -> str:
    unit = CATALOGUE[name].unit
    return "" if unit == "-" else f" {unit}"


def significant_digits(m: Interval) -> int:
    """Digits that show an interval's width, three at least."""
    width = m.high - m.low
    if width <= 0.0 or m.estimate == 0.0:
        return 3
    return max(3, 1 + math.ceil(math.log10(abs(m.estimate) / width)) + 1)


def _rounded(data: Any) -> Any:
    if isinstance(data, dict):
        return {key: _rounded(value) for key, value in data.items()}
    if isinstance(data, (list, tuple)):
        return [_rounded(value) for value in data]
    if isinstance(data, float):
        return float(f"{data:.6g}")
    return data


def read_answer(path: str | Path) -> Answer:
    """Reads an answer file.

    Raises:
        InvalidAnswerError: unreadable, not JSON, or without a key of the contract.
    """
    try:
        data = json.loads(Path(path).read_text())
    except OSError as error:
        raise InvalidAnswerError(f"{path}: cannot be read ({error.strerror}); give the path of an answer") from None
    except json.JSONDecodeError as error:
        raise InvalidAnswerError(
            f"{path}: not JSON (line {error.lineno}); write it with 'drift-drake diagnose --json'"
        ) from None
    required = ("case", "verdict", "causes", "posterior", "ambiguity", "magnitudes", "where", "reduction", "seconds")
    missing = [key for key in required if not isinstance(data, dict) or key not in data]
    if missing:
        raise InvalidAnswerError(
            f"{path}: missing {', '.join(missing)}; write the answer with 'drift-drake diagnose --json'"
        )
    optional = {key: data.get(key, {}) for key in ("tolerances", "details")}
    return Answer(
        **{key: data[key] for key in required if key not in ("magnitudes", "reduction")},
        magnitudes={name: Interval(**m) for name, m in data["magnitudes"].items()},
        reduction=Interval(**data["reduction"]),
        **optional,
        warnings=data.get("warnings", []),
    )
