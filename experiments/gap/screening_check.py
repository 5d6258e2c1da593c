"""How often the screening of logs finds what is wrong with them, and how often it finds fault with good ones.

    python -m experiments.gap.screening_check --out runs/screening --data ../shared/data

Simulated cases (none, one or two effects, the nominal off within tolerance) and real logs, where they are there, get
one mistake each: a bad sample in a column and row by chance, or a wrong unit, sign or clock in all runs. Counted are
mistakes that were found, and those named right: the column, the kind, and the rows or the factor. A log that is
refused with a sentence on the column's unit counts as named.
"""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from diagrams.command import run_command
from drift_drake.car.log.table import InvalidLogError, Run
from drift_drake.car.parameters import VehicleParameters
from drift_drake.common.run_folder import make_run_folder, write_json, write_versions
from drift_drake.gap.logs.importing.importer import import_recordings
from drift_drake.gap.logs.importing.mapping import read_mapping
from drift_drake.gap.logs.screening.screened import Screened, screened
from drift_drake.gap.logs.screening.suspicions import Suspicion, suspicions
from experiments.benchmarks.compiled_cases import make_case
from experiments.benchmarks.log_mutations import SAMPLES, Planted, unit_mistakes, with_bad_sample, with_factors
from experiments.benchmarks.truths import Truth, drawn_truth
from experiments.made import write_report
from experiments.real.logs import RACER, RIM_SPEED, SMALL_CAR

TIERS = ("none", "exact", "tolerance", "pair")
HEAVY = 3.0  # factor on the mass of another car
SAME_FACTOR = 0.35  # of a logarithm, within which a factor is the right one: steering ratios are estimates
NO_MISTAKE = "no mistake"
OTHER_CAR, OTHER_UNIT = "a run of a car thrice as heavy", "one run with v in km/h"


@dataclasses.dataclass(frozen=True)
class Config:
    """Simulated and real logs with mistakes put in."""

    out: Path | None = None
    """Run folder."""
    cases: int = 36
    """Simulated cases."""
    data: Path | None = None
    """Folder with `dart/` and `revs_250lm/`, where it is there."""
    real_repeats: int = 12
    """Bad samples of each kind in each real case."""
    seed: int = 0


@dataclasses.dataclass
class Count:
    """Outcomes of one mistake."""

    tried: int = 0
    found: int = 0
    right: int = 0
    false: int = 0  # with something reported that was not put in

    def add(self, found: bool, right: bool, false: bool) -> None:
        """One more outcome."""
        self.tried += 1
        self.found += found
        self.right += right
        self.false += false


Counts = dict[str, Count]


def simulated(config: Config) -> list[tuple[list[Run], VehicleParameters, Truth]]:
    """Cases of all tiers in turn, with what they hide."""
    vehicle = VehicleParameters()
    cases = []
    for number in range(config.cases):
        rng = np.random.default_rng([config.seed, number])
        truth = drawn_truth(rng, TIERS[number % len(TIERS)], vehicle)
        cases.append((make_case(truth, vehicle, rng), vehicle, truth))
    return cases


def recorded(data: Path) -> list[tuple[str, list[Run], VehicleParameters]]:
    """The small car's and the racer's logs as their presets import them."""
    small = read_mapping("dart")
    small = dataclasses.replace(small, formulas={**small.formulas, **RIM_SPEED})
    cases = [
        (name, import_recordings(sorted((data / "dart" / name).glob("*.csv")), small)[0], SMALL_CAR)
        for name in ("floor_a", "floor_b", "free_driving")
    ]
    racer = import_recordings(sorted((data / "revs_250lm").glob("*.csv")), read_mapping("revs_250lm"))[0]
    return [*cases, ("racer", racer, RACER)]


def try_samples(runs: Sequence[Run], rng: np.random.Generator, counts: Counts, known: int = 0) -> None:
    """One bad sample of each kind; `known`, the number that the runs have of their own, are no false alarms."""
    for name in SAMPLES:
        changed, planted = with_bad_sample(runs, name, rng)
        found, right, others = judged_sample(screened(changed)[0], planted)
        counts.setdefault(name, Count()).add(found, right, others > known)


def judged_sample(clean: Sequence[Screened], planted: Planted) -> tuple[bool, bool, int]:
    """Whether the bad sample was found, and named right, and how many others were reported."""
    all_bad = [(i, part) for i, one in enumerate(clean) for part in one.bad]
    floors = [(i, name) for i, one in enumerate(clean) for name in one.noise_floor]
    if planted.kind == "rounding":
        found = (planted.run, planted.column) in floors
        return found, found, len(all_bad) + len(floors) - found
    at = [
        part for i, part in all_bad
        if i == planted.run and part.column == planted.column
        and part.start < planted.stop and planted.start < part.stop
    ]  # fmt: skip
    covered = sum(min(part.stop, planted.stop) - max(part.start, planted.start) for part in at)
    beyond = sum(part.stop - part.start for part in at) - covered
    # A reading may happen to be the frozen value, or a spike's last row to lie with its neighbours.
    right = bool(at) and abs(planted.stop - planted.start - covered) <= 1 and beyond <= 1
    return bool(at), right, len(all_bad) - len(at) + len(floors)


def try_units(runs: Sequence[Run], vehicle: VehicleParameters, counts: Counts) -> None:
    """Each unit, sign and clock that the columns allow and that this vehicle could show."""
    for name, factors in unit_mistakes(vehicle).items():
        if any(factor == 1.0 or run.column(column) is None for run in runs for column, factor in factors.items()):
            continue
        count = counts.setdefault(name, Count())
        try:
            suspected = suspicions(with_factors(runs, factors), vehicle)
        except InvalidLogError as error:
            named = any(f"column {column} " in str(error) for column in factors)
            count.add(True, named and "looks like" in str(error), False)
            continue
        right = [s for s in suspected if s.column in factors and _same(s.factor, factors[s.column])]
        count.add(bool(suspected), len(right) == len(factors), len(right) < len(suspected))


def _same(factor: float | None, truth: float) -> bool:
    return factor is not None and factor * truth > 0.0 and abs(np.log(factor / truth)) < SAME_FACTOR


def try_odd_runs(runs: Sequence[Run], heavy: Sequence[Run], vehicle: VehicleParameters, counts: Counts) -> None:
    """One run of another car, one run with a column in another unit."""
    odd = len(runs) // 2
    other = dataclasses.replace(heavy[odd % len(heavy)], name=runs[odd].name)
    in_other_unit = with_factors([runs[odd]], {"v": 3.6})[0]
    for name, run in ((OTHER_CAR, other), (OTHER_UNIT, in_other_unit)):
        suspected = suspicions([*runs[:odd], run, *runs[odd + 1 :]], vehicle)
        named = [s for s in suspected if s.column is None and s.sentence.startswith(f"{run.name} ")]
        counts.setdefault(name, Count()).add(bool(suspected), bool(named), len(named) < len(suspected))


def untouched(runs: Sequence[Run], vehicle: VehicleParameters, counts: Counts) -> tuple[list[str], list[Suspicion]]:
    """What is reported of good logs."""
    _, sentences = screened(runs)
    suspected = suspicions(runs, vehicle)
    wrong = bool(sentences or suspected)
    counts.setdefault(NO_MISTAKE, Count()).add(wrong, not wrong, wrong)
    return sentences, suspected


def run(config: Config) -> dict[str, Any]:
    """Counts by mistake, of simulated and of real logs, and what was reported of those left as they are."""
    counts: Counts = {}
    said: dict[str, list[str]] = {}

    def note(name: str, found: tuple[list[str], list[Suspicion]]) -> None:
        sentences, suspected = found
        if sentences or suspected:
            said[name] = sentences + [s.sentence for s in suspected]

    for number, (runs, vehicle, truth) in enumerate(simulated(config)):
        rng = np.random.default_rng([config.seed, number, 1])
        note(f"simulated {number} ({truth.effects})", untouched(runs, vehicle, counts))
        try_samples(runs, rng, counts)
        try_units(runs, vehicle, counts)
        heavy = dataclasses.replace(truth, deviations=truth.deviations | {"mass": HEAVY - 1.0})
        try_odd_runs(runs, make_case(heavy, vehicle, rng), vehicle, counts)
    real: Counts = {}
    for number, (name, runs, vehicle) in enumerate(recorded(config.data) if config.data is not None else []):
        note(name, untouched(runs, vehicle, real))
        known = sum(len(one.bad) + len(one.noise_floor) for one in screened(runs)[0])
        for repeat in range(config.real_repeats):
            try_samples(runs, np.random.default_rng([config.seed, number, repeat, 2]), real, known)
        try_units(runs, vehicle, real)
    return {
        "simulated": {name: dataclasses.asdict(count) for name, count in counts.items()},
        "real": {name: dataclasses.asdict(count) for name, count in real.items()},
        "reported of logs as they are": said,
    }


def table(counts: Mapping[str, Mapping[str, int]]) -> str:
    """A table in Markdown."""
    rate: Callable[[int, int], str] = lambda part, of: f"{100.0 * part / of:.0f} %"  # noqa: E731
    lines = ["| mistake | tried | found | named right | something else reported |", "| --- | --- | --- | --- | --- |"]
    for name, c in counts.items():
        rates = " | ".join(rate(c[key], c["tried"]) for key in ("found", "right", "false"))
        lines.append(f"| {name} | {c['tried']} | {rates} |")
    return "\n".join(lines)


def main(config: Config) -> None:
    """Writes counts and tables."""
    folder = make_run_folder("screening_check", config.out)
    write_json(folder / "config.json", config)
    write_versions(folder)
    found = run(config)
    write_json(folder / "screening_check.json", found)
    text = "\n\n".join(f"{name} logs\n\n{table(found[name])}" for name in ("simulated", "real") if found[name])
    write_report(folder, text, config)
    print(text)
    for name, sentences in found["reported of logs as they are"].items():
        print(f"{name}: {'; '.join(sentences)}")


if __name__ == "__main__":
    run_command(main, Config, __doc__)
