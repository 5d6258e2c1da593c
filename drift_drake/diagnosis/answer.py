"""The answer to one case: what a diagnosis says, as plain data and JSON."""

import dataclasses
import json
import math
from pathlib import Path
from typing import Any

from drift_drake.estimation.interval import Interval
from drift_drake.vehicle.catalogue import CATALOGUE


class InvalidAnswerError(ValueError):
    """An answer file that cannot be used; the message names the file and the mend."""


class UnplannableError(ValueError):
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
        parts = [_stated(name, self.magnitudes[name]) for name in self.causes]
        probability = self.posterior["+".join(sorted(self.causes))]
        remove = "it removes" if len(parts) == 1 else "they remove"
        return (
            f"{self.case}: {' and '.join(parts)}, probability {probability:.2f}; {remove} "
            f"{100 * self.reduction.estimate:.0f} % of the gap on parts of runs that were not fitted."
        )

    def _nearest(self) -> str:
        """What `unknown` leaves an engineer with (`diagnosis.nearest`); nothing in answers of before."""
        found = self.details.get("nearest")
        if not found:
            return ""
        causes = [_stated(name, Interval(**m)) for name, m in found["magnitudes"].items()]
        free = f"{100 * found['free_forces_remove']:.0f} %"
        where = "of the nominal car's squared innovations on parts of runs that were not fitted"
        if not causes:
            return f" No known cause comes near; free forces remove {free} {where}."
        removes = f"{'removes' if len(causes) == 1 else 'remove'} {100 * found['removes']:.0f} %"
        return f" The nearest known, {' and '.join(causes)}, {removes} {where}, free forces {free}."


def _stated(name: str, m: Interval) -> str:
    """A cause with its magnitude and interval, in words."""
    unit = CATALOGUE[name].unit
    unit = "" if unit == "-" else f" {unit}"
    numbers = [f"{q:.{significant_digits(m)}g}" for q in (m.estimate, m.low, m.high)]
    return f"{name} {numbers[0]}{unit} (95 %: {numbers[1]} to {numbers[2]})"


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
