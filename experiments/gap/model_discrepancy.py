"""Does a diagnosis tell a new gap from a calibrated car's model discrepancy? Simulated cars, two days each.

    python -m experiments.gap.model_discrepancy --out runs/model_discrepancy

Every car does something that neither the nominal equations nor the catalogue have (`gap.strange_effects`, or
tyres of another shape). It is calibrated on the first day's drives (`identify`). On the second day it is diagnosed as
it is, and with one catalogued effect added, by the criterion that it was calibrated by, as `diagnose --calibration`
does. A car that is done is kept: start again to go on.
"""

import dataclasses
import time
from typing import Any

import numpy as np

from diagrams.command import run_command
from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.car.given_vehicle import single_track_of
from drift_drake.car.log.table import Run
from drift_drake.car.parameters import VehicleParameters
from drift_drake.common.run_folder import write_json
from drift_drake.gap.diagnosis.calibrated.diagnose_change import diagnose_change
from drift_drake.gap.diagnosis.likelihood.diagnose import diagnose
from drift_drake.gap.identification.calibration import Identification
from drift_drake.gap.identification.identify import identify
from experiments.benchmarks.compiled_cases import make_case
from experiments.benchmarks.intervals import binomial
from experiments.benchmarks.truths import Truth, drawn_deviations, drawn_magnitude
from experiments.made import RunConfig, begun, tabulated, write_report
from experiments.settings import Results, each_vehicle

DISCREPANCIES = {  # the least and the largest magnitude; a sign is drawn for the compliance steer and the brake
    "tyre_curve": (0.05, 0.3),
    "aligning_moment": (0.01, 0.03),
    "rear_compliance_steer": (0.0006, 0.002),
    "grabbing_brake": (100.0, 300.0),
    "driveline_oscillation": (0.05, 0.15),
    "slippery_patch": (0.05, 0.15),
}
SIGNED = ("rear_compliance_steer", "grabbing_brake")


@dataclasses.dataclass(frozen=True)
class Config(RunConfig):
    """Gaps of the second day in addition to the discrepancy."""

    vehicles: int = 12
    duration: float = 12.0
    """Of each of a day's four drives [s]."""
    seed: int = 31


@dataclasses.dataclass(frozen=True)
class Days:
    """What a car is every day, and what is added to it on the second."""

    baseline: Truth
    changed: Truth


def drawn_days(rng: np.random.Generator, index: int, vehicle: VehicleParameters) -> Days:
    """One car; misfits take turns."""
    kind = list(DISCREPANCIES)[index % len(DISCREPANCIES)]
    sign = -1.0 if kind in SIGNED and rng.uniform() < 0.5 else 1.0
    strange = {kind: sign * float(rng.uniform(*DISCREPANCIES[kind]))}
    deviations = drawn_deviations(rng, vehicle.tolerance)
    name = str(rng.choice(list(CATALOGUE)))
    effect = {name: drawn_magnitude(rng, name, vehicle.tolerance)}
    return Days(Truth({}, strange, deviations), Truth(effect, strange, deviations))


def asked(found: Identification, runs: list[Run]) -> dict[str, Any]:
    """What a diagnosis of the calibrated car says of the second day's runs."""
    began, c = time.process_time(), found.calibration
    if c.normal is not None:
        answer = diagnose_change(runs, found.vehicle, c.normal, own=found.effects, workers=1).answer
    else:
        car = single_track_of(found.vehicle)
        answer = diagnose(runs, car, workers=1, process_scale=c.trust.process, noise_scale=c.trust.noise,
                          own=found.effects, tempering=c.tempering, discrepancy=c.discrepancy).answer  # fmt: skip
    return {
        "sentence": answer.sentence(),
        "name": "+".join(answer.causes) or answer.verdict,
        "probability": next(iter(answer.posterior.values())),
        "posterior": answer.posterior,
        "ambiguity": answer.ambiguity,
        "magnitudes": answer.magnitudes,
        "seconds": time.process_time() - began,
    }


def one_vehicle(config: Config, index: int) -> dict[str, Any]:
    """Two days of one car."""
    vehicle = VehicleParameters()
    rng = np.random.default_rng([config.seed, index])
    days = drawn_days(rng, index, vehicle)
    found = identify(make_case(days.baseline, vehicle, rng, config.duration), vehicle, watching=False)
    answers = {}
    for day, truth in (("changed", days.changed), ("same", days.baseline)):
        runs = make_case(truth, vehicle, np.random.default_rng([config.seed, index, 2]), config.duration)
        answers[day] = asked(found, runs)
    return {
        "misfit": days.baseline.strange,
        "effect": days.changed.effects,
        "criterion": found.calibration.criterion,
        "answers": answers,
    }


def numbers(results: list[dict[str, Any]]) -> dict[str, Any]:
    """Counts of right answers, of `unknown` and of magnitudes within their intervals."""
    out: dict[str, Any] = {"vehicles": len(results)}
    for key in results[0]["answers"]:
        answers = [r["answers"][key] for r in results]
        truths = ["none" if key == "same" else next(iter(r["effect"])) for r in results]
        right = sum(a["name"] == truth for a, truth in zip(answers, truths, strict=True))
        out[key] = {
            "right": right,
            "share_right": binomial(right, len(results), "wilson"),
            "unknown": sum(a["name"] == "unknown" for a in answers),
            "in_ambiguity_set": sum(truth in a["ambiguity"] for a, truth in zip(answers, truths, strict=True)),
            "magnitudes_held": [
                sum(m["low"] <= r["effect"][name] <= m["high"] for m in [a["magnitudes"][name]])
                for r, a, name in zip(results, answers, truths, strict=True) if name in a["magnitudes"]
            ],
        }  # fmt: skip
    return out


def table(results: Results) -> str:
    """A row a car, in Markdown: what it does every day, what was added, and each answer; wrong ones in bold."""
    columns = ["persistent mismatch", "calibrated by", "added on day two", "answer", "nothing added: answer"]
    rows = []
    for r in results:
        cells = [_listed(r["misfit"]), r["criterion"], _listed(r["effect"])]
        cells += [_answered(r["answers"][day], truth)
                  for day, truth in (("changed", next(iter(r["effect"]))), ("same", "none"))]  # fmt: skip
        rows.append(cells)
    return "\n".join(tabulated(columns, rows))


def _listed(magnitudes: dict[str, float]) -> str:
    return ", ".join(f"{name} {value:.3g}" for name, value in magnitudes.items())


def _answered(answer: dict[str, Any], truth: str) -> str:
    probability = f"{answer['probability']:.2f}"
    if answer["name"] != truth:
        also = " (truth in the ambiguity set)" if truth in answer["ambiguity"] else ""
        return f"**{answer['name'].replace('+', ' with ')}**, {probability}{also}"
    found = [f" {m['estimate']:.3g} ({m['low']:.3g} to {m['high']:.3g})" for m in answer["magnitudes"].values()]
    return f"{answer['name']}{''.join(found)}, {probability}"


def counts(found: dict[str, Any]) -> str:
    """`numbers` in Markdown."""
    rows = []
    for way, part in found.items():
        if way != "vehicles":
            _, low, high = part["share_right"]
            right = f"{part['right']} of {found['vehicles']} ({low:.2f} to {high:.2f})"
            rows.append((way, right, part["unknown"], part["in_ambiguity_set"]))
    return "\n".join(tabulated(("day two", "right", "unknown", "truth in the ambiguity set"), rows))


def main(config: Config) -> None:
    """Does the cars that are not done yet, and sums up."""
    folder = begun("model_discrepancy", config)
    results: Results = []
    for results in each_vehicle(folder, config, config.vehicles, one_vehicle):
        write_json(folder / "numbers.json", numbers(results))
    text = f"{table(results)}\n\n{counts(numbers(results))}"
    write_report(folder, text, config)


if __name__ == "__main__":
    run_command(main, Config, __doc__)
