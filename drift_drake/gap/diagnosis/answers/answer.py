"""The answer to one case: what a diagnosis says, as plain data and JSON."""

import dataclasses
import json
import math
from pathlib import Path
from typing import Any

from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.common.errors import DriftDrakeError, shown, significant
from drift_drake.common.plain_files import named_number, parse_json, read_text
from drift_drake.common.safe_files import write_text
from drift_drake.gap.diagnosis.answers.rivals import in_words, of_rivals, tells_apart
from drift_drake.gap.estimation.prior import Interval

NAMED = 0.1  # probability from which a rival is named
RIVALS = 3  # that are named; the others are counted
MOSTLY = 0.5  # share of unfamiliar driving that a sentence states
ASKED_FIRST = sorted((name for name, effect in CATALOGUE.items() if effect.asked), key=lambda n: -CATALOGUE[n].daily)
"""Effects whose detection limits the sentence of a `none` states; the others are in the answer and its report."""
IMPLAUSIBLE = 3.0  # tolerances
MOST_STRETCHED = 3  # deviations that a sentence names
LEAST_SAID = 0.005  # share of errors that rounds to a percent
NOTHING = "nothing"
VERDICTS = ("effect", "none", "unknown")


class InvalidAnswerError(DriftDrakeError, ValueError):
    """An answer file that cannot be used; the message names the file and the remedy."""


class UnplannableError(DriftDrakeError, ValueError):
    """An answer that no drive can follow; the message says why."""


@dataclasses.dataclass(frozen=True)
class Answer:
    """One case's answer, as in its JSON file (docs/formats.md).

    Examples:
        >>> read_answer("answer.json").causes
        ['steering_lag']
    """

    case: str  # name
    verdict: str  # effect, none or unknown
    causes: list[str]  # names of effects
    posterior: dict[str, float]  # probability [-] of each hypothesis
    ambiguity: list[str]  # hypotheses that together hold 95 %
    magnitudes: dict[str, Interval]  # in the catalogue's units
    where: dict[str, Any]  # in which states, runs and regions the gap acts
    reduction: Interval  # share [-] of the gap that the causes remove
    seconds: float  # [s] of CPU
    tolerances: dict[str, float]  # [tolerances] deviations from the vehicle file found in addition to the causes
    details: dict[str, Any]  # of the method
    warnings: list[str]  # sentences

    def to_json(self) -> str:
        """The answer as JSON text; a number that is not finite, which JSON has none of, is null."""
        return json.dumps(_rounded(dataclasses.asdict(self)), indent=2, allow_nan=False)

    def write(self, path: str | Path) -> None:
        """Writes the JSON file to a path; OutputError where it cannot."""
        write_text(path, self.to_json() + "\n")

    def sentence(self) -> str:
        """The verdict in one sentence."""
        if self.verdict == "none":
            return f"{self.case}: {self._no_gap()}.{self._rivals()}{self._could_show()}"
        if self.verdict == "unknown":
            return (
                f"{self.case}: there is a gap that no catalogued effect explains "
                f"(probability {self.posterior['unknown']:.2f}).{self._acts_like()}{self._unfamiliar()}{self._rivals()}"
                + self._nearest()
            )
        least = self.details.get("at_least", [])
        parts = [_stated(name, self.magnitudes[name], name in least) for name in self.causes]
        left, fault = self.details.get("left_over", {}), "additional fault that the catalogue lacks"
        too = [f"an {fault}"] if left and left.get("probability", 1.0) > 0.5 else []
        name = "+".join(sorted(self.causes))
        probability = self.posterior[name] + self.posterior.get(f"{name}+unknown", 0.0)
        remove = f"{'it removes' if len(parts) == 1 else 'they remove'} {_removed(self.reduction.estimate)}"
        said = f"{' and '.join(parts + too)}, probability {probability:.2f}"
        if self.details.get("decision") == "cause_open":
            said = f"there is a gap whose cause these logs leave open: most likely {said}"
        is_left = "is left over" if too else f"may be there too ({left.get('probability', 0.0):.2f})"
        remains = f" An {fault} {is_left}." if left else ""
        return (
            f"{self.case}: {said}; {remove} of the gap on parts of runs that were not fitted.{remains}{self._rivals()}"
        )

    def _acts_like(self) -> str:
        """What a gap that no catalogued effect explains is most like."""
        like = self.details.get("left_over", {}).get("like")
        return f" It acts like {like}." if like else ""

    def _rivals(self) -> str:
        """What it may be instead, with the detection limit of the first."""
        leading = "+".join(sorted(self.causes)) or self.verdict
        too = self.posterior.get(f"{leading}+unknown", 0.0)
        more_too = f" An additional fault may be there too ({too:.2f} of it)." if too >= NAMED else ""
        rivals = {name: p for name, p in of_rivals(self.posterior, leading).items() if p >= NAMED}
        others = list(rivals)
        if not others:
            return more_too
        parts = [f"{in_words(name)} ({rivals[name]:.2f}{self._shown_from(name) if i == 0 else ''})"
                 for i, name in enumerate(others[:RIVALS])]  # fmt: skip
        more = [f"one of {len(others) - RIVALS} others"] if len(others) > RIVALS else []
        may_be = ", or ".join(parts + more)
        plan = "'drift-drake plan-next' plans a drive that would tell."
        return f"{more_too} It may be {may_be} instead: {plan}{tells_apart(leading, others)}"

    def _shown_from(self, name: str) -> str:
        """From which magnitude on these logs would have shown an effect, or that none would have been."""
        limit = self.details.get("detection", {}).get(name)
        if self.verdict != "none" or limit is None or (limit["least"] is None and limit["taken_for"] != "none"):
            return ""
        if limit["least"] is None:
            return ", which these logs cannot show"
        return f", which these logs would show from {significant(limit['least'], 2)}{CATALOGUE[name].suffix} on"

    def _no_gap(self) -> str:
        """Beyond what there is no gap."""
        sure = f"(probability {self.posterior['none']:.2f})"
        if self.details.get("criterion") == "prediction":
            rate = self.details.get("false_alarm_rate", {})
            of = f", at a false-alarm rate of {rate['asked']:g}" if "asked" in rate else ""
            if self.details.get("decision") == "undecided":
                return f"undecided: these logs neither show nor exclude a gap {sure[:-1]} of none{of})"
            return f"no gap beyond the car's calibrated baseline {sure[:-1]}{of})"
        worth = self.details.get("tempering", 1.0)
        if worth < 1.0:
            beyond = f"the car's model discrepancy, at a likelihood tempering exponent of {worth:.2g} {sure}"
            return f"no gap beyond the vehicle file's tolerances and {beyond}"
        return "no gap beyond the vehicle file's tolerances and the sensors' noise"

    def _unfamiliar(self) -> str:
        """That most of the driving is harder than any that the car was calibrated on, where it is."""
        share = 1.0 - float(self.details.get("familiar", 1.0))
        if share < MOSTLY:
            return ""
        return (
            f" {100 * share:.0f} % of the driving is harder than any that the car was calibrated on and hardly counts: "
            "calibrate on such drives too."
        )

    def _could_show(self) -> str:
        """What the logs of a `none` would have shown, by effects that people ask for first."""
        limits = self.details.get("detection", {})
        shown = [name for name in ASKED_FIRST if name in limits and limits[name]["least"] is not None]
        blind = [name for name in ASKED_FIRST if name in limits and limits[name]["least"] is None]
        parts = [f"{name} {significant(limits[name]['least'], 2)}{CATALOGUE[name].suffix}" for name in shown]
        would = f" These logs would have shown (95 %) {', '.join(parts)}" if parts else ""
        ends = f"{', but no' if would else ' These logs cannot show'} {', '.join(blind)}." if blind else "."
        return f"{self._unfamiliar()}{would}{ends}" if would or blind else self._unfamiliar()

    def _nearest(self) -> str:
        """What `unknown` leaves an engineer with (`diagnose.nearest`); nothing in answers of before."""
        found = self.details.get("nearest")
        if not found:
            return ""
        causes = [_stated(name, _interval(name, m)) for name, m in found["magnitudes"].items()]
        if found.get("free_forces_remove") is None:
            near = " and ".join(causes) or "the calibrated car as it is"
            removes = _removed(found.get("removes"))
            if removes == NOTHING:
                return " No known cause removes any of it on held-out blocks."
            return f" The nearest known hypothesis, {near}, removes {removes} of it on held-out blocks."
        free = _removed(found.get("free_forces_remove"))
        where = "of the nominal car's squared innovations on parts of runs that were not fitted"
        if not causes:
            return f" No known cause comes near; free-form forces remove {free} {where}."
        near, removes = " and ".join(causes) + self._stretched(), _removed(found.get("removes"))
        return f" The nearest known hypothesis, {near}, removes {removes} {where}; free-form forces remove {free}."

    def _stretched(self) -> str:
        """Deviations from the vehicle file, far beyond what it allows, without which a hypothesis is not near."""
        far = {name: n for name, n in self.tolerances.items() if abs(n) > IMPLAUSIBLE}
        worst = sorted(far, key=lambda name: -abs(far[name]))[:MOST_STRETCHED]
        return f" with {' and '.join(f'{name} {far[name]:+.0f}' for name in worst)} tolerances off" if worst else ""


def answer_row(answer: Answer) -> dict[str, Any]:
    """An answer as a row of a table: verdict, probability, share of the gap removed, causes with intervals."""
    causes = "+".join(sorted(answer.causes))
    row = {
        "case": answer.case,
        "verdict": answer.verdict,
        "causes": causes,
        "decision": answer.details.get("decision"),
        "probability": answer.posterior.get(causes or answer.verdict),
        "reduction": answer.reduction.estimate,
        "reduction_low": answer.reduction.low,
        "reduction_high": answer.reduction.high,
        "warnings": len(answer.warnings),
        "seconds": answer.seconds,
    }
    for name, magnitude in answer.magnitudes.items():
        row |= {name: magnitude.estimate, f"{name}_low": magnitude.low, f"{name}_high": magnitude.high}
    return dict(_rounded(row))  # as it is written: the row of an answer that is read again is the same


def _removed(share: float | None) -> str:
    """A share of errors that is removed; what adds to them removes nothing. None: it is not known."""
    if share is None:
        return "an unknown share"
    return f"{100 * share:.0f} %" if share >= LEAST_SAID else NOTHING


def _stated(name: str, m: Interval, at_least: bool = False) -> str:
    """A cause with its magnitude and interval, in words; one at the end of what is believed possible is a bound."""
    unit = CATALOGUE[name].suffix
    written = (float(f"{q:.6g}") for q in (m.estimate, m.low, m.high))  # an answer that is read again says the same
    numbers = [significant(q, significant_digits(m)) for q in written]
    if at_least:
        return f"{name} of {numbers[0]}{unit} at {'most' if CATALOGUE[name].limit else 'least'}"
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
        return float(f"{data:.6g}") if math.isfinite(data) else None
    return data


def read_answer(path: str | Path) -> Answer:
    """Reads an answer file.

    Raises:
        InvalidAnswerError: unreadable, not JSON, or a key of the contract is missing or holds something else.

    Examples:
        >>> read_answer("answer.json").magnitudes["steering_lag"].estimate
        0.1
    """
    remedy = "write it with 'drift-drake diagnose --json'"
    text = read_text(path, InvalidAnswerError, "give the path of an answer")
    data = parse_json(text, InvalidAnswerError, str(path), remedy)
    required = ("case", "verdict", "causes", "posterior", "ambiguity", "magnitudes", "where", "reduction", "seconds")
    missing = [key for key in required if not isinstance(data, dict) or key not in data]
    if missing:
        raise InvalidAnswerError(f"{path}: missing {', '.join(missing)}; {remedy}")
    try:
        return _answer(data)
    except ValueError as error:
        raise InvalidAnswerError(f"{path}: {error}; {remedy}") from None


def _answer(data: dict[str, Any]) -> Answer:
    """An answer from plain data that has the contract's keys; ValueError says what is wrong with one."""
    verdict = data["verdict"]
    if verdict not in VERDICTS:
        raise ValueError(f"verdict is {shown(verdict)}, not one of {', '.join(VERDICTS)}")
    causes = _names("causes", data["causes"])
    posterior = {name: _number(f"posterior.{name}", q) for name, q in _entries("posterior", data["posterior"]).items()}
    magnitudes = {
        name: _interval(f"magnitudes.{name}", m) for name, m in _entries("magnitudes", data["magnitudes"]).items()
    }
    unknown = [name for name in (*causes, *magnitudes) if name not in CATALOGUE]
    if unknown:
        raise ValueError(f"it names the cause {shown(unknown[0])}, which the catalogue does not have")
    lacking = [name for name in causes if name not in magnitudes]
    if lacking:
        raise ValueError(f"magnitudes lacks {lacking[0]}")
    believed = "+".join(sorted(causes)) if verdict == "effect" else verdict
    if believed not in posterior or bool(causes) != (verdict == "effect"):
        raise ValueError(f"verdict {verdict}, causes and posterior do not agree")
    tolerances = _entries("tolerances", data.get("tolerances", {}))
    warnings = data.get("warnings", [])
    return Answer(
        case=_text("case", data["case"]), verdict=verdict, causes=causes, posterior=posterior,
        ambiguity=_names("ambiguity", data["ambiguity"]), magnitudes=magnitudes, where=_entries("where", data["where"]),
        reduction=_interval("reduction", data["reduction"], finite=verdict == "effect"),
        seconds=_number("seconds", data["seconds"]),
        tolerances={name: _number(f"tolerances.{name}", q) for name, q in tolerances.items()},
        details=_details(data.get("details", {})),
        warnings=[_text("warnings", text) for text in warnings] if isinstance(warnings, list) else [],
    )  # fmt: skip


def _details(details: Any) -> dict[str, Any]:
    """What the sentence and `apply` read of the details is checked here; beliefs are by whoever plans from them."""
    details = _entries("details", details)
    for key in ("tempering", "familiar"):
        _number(f"details.{key}", details.get(key, 1.0))
    _names("details.at_least", details.get("at_least", []))
    for name, value in _by_effect("details.with", details.get("with", {})).items():
        _number(f"details.with.{name}", value)
    for name, limit in _by_effect("details.detection", details.get("detection", {})).items():
        least = _entries(f"details.detection.{name}", limit).get("least", "missing")
        _number(f"details.detection.{name}.least", least, finite=False)
    nearest = details.get("nearest")
    if nearest:
        found = _entries("details.nearest", nearest)
        for key in ("removes", "free_forces_remove"):
            _number(f"details.nearest.{key}", found.get(key), finite=False)
        for name, m in _by_effect("details.nearest.magnitudes", found.get("magnitudes")).items():
            _interval(f"details.nearest.magnitudes.{name}", m)
    return details


def _by_effect(key: str, value: Any) -> dict[str, Any]:
    """An object whose names are effects of the catalogue."""
    entries = _entries(key, value)
    for name in entries:
        if name not in CATALOGUE:
            raise ValueError(f"{key} names {shown(name)}, which the catalogue does not have")
    return entries


def _entries(key: str, value: Any) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise ValueError(f"{key} is {shown(value)}, not an object")
    return value


def _names(key: str, value: Any) -> list[str]:
    if not isinstance(value, list):
        raise ValueError(f"{key} is {shown(value)}, not a list of names")
    return [_text(key, name) for name in value]


def _text(key: str, value: Any) -> str:
    if not isinstance(value, str):
        raise ValueError(f"{key} holds {shown(value)}, not a text")
    return value


def _number(key: str, value: Any, finite: bool = True) -> float:
    """A number; where it need not be finite, it may be missing too (NaN)."""
    if not finite and value is None:
        return math.nan
    return named_number(key, value)


def _interval(key: str, value: Any, finite: bool = True) -> Interval:
    entries = _entries(key, value)
    return Interval(*(_number(f"{key}.{end}", entries.get(end), finite) for end in ("estimate", "low", "high")))
