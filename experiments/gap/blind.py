"""The blind check of the diagnosis: cases with withheld effects, answers, and only then the labels.

    python -m experiments.gap.blind make --out runs/gap_blind --count 40     cases from Drake plants, labels sealed
    python -m experiments.gap.blind answer --out runs/gap_blind              diagnoses them
    python -m experiments.gap.blind score --out runs/gap_blind               opens the labels, scores the answers
    python -m experiments.gap.blind calibrate --out runs/gap_calibration     the posterior's constants, on other cases

Tiers: exact (one effect, the vehicle file exact), tolerance (one effect, the file off within tolerance), none, pair,
family (an effect that the catalogue never had), removed (one effect, which the diagnosis's catalogue is made to lack).
The seed is drawn by the operating system and sealed with the labels; their hash is in the manifest with the cases.
`answer` and `score` write a table of all cases, results.parquet (results.csv without pyarrow).
"""

import base64
import dataclasses
import hashlib
import json
import secrets
import sys
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import tyro

from diagrams.command import run_command
from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.car.log.table import write_run
from drift_drake.car.parameters import VehicleParameters
from drift_drake.common.executors import run_jobs
from drift_drake.common.run_folder import is_done, write_results_table
from drift_drake.common.safe_files import write_bytes, write_text
from drift_drake.gap.diagnosis.answers.answer import answer_row, read_answer
from drift_drake.gap.diagnosis.diagnose import answer_folder
from drift_drake.gap.diagnosis.likelihood.diagnose import Diagnosis
from experiments.benchmarks.compiled_cases import make_case
from experiments.benchmarks.drake_cases import drake_case
from experiments.benchmarks.scores import score_text, scores
from experiments.benchmarks.truths import Truth, drawn_truth
from experiments.gap.pictures import draw_scores
from experiments.made import SpreadConfig, write_report

TIERS = {"exact": 0.25, "tolerance": 0.3, "none": 0.15, "pair": 0.15, "family": 0.075, "removed": 0.075}


@dataclasses.dataclass(frozen=True)
class Make(SpreadConfig):
    """Make cases from Drake plants and seal their labels."""

    out: Path
    count: int = 40
    compiled: bool = False
    """The compiled plant in place of Drake's: faster, for calibration."""
    seed: int | None = None
    """For repeatable development cases; by default the operating system draws it."""


@dataclasses.dataclass(frozen=True)
class Respond(SpreadConfig):
    """Diagnose the cases; the labels stay sealed."""

    out: Path


@dataclasses.dataclass(frozen=True)
class Score:
    """Open the labels and score the answers."""

    out: Path
    partial: bool = False
    """Of a set that was broken off: score what is answered. The rest can then no longer be answered blind."""


@dataclasses.dataclass(frozen=True)
class Calibrate(SpreadConfig):
    """Fit the posterior's constants on cases of their own (made and answered if they are not there yet)."""

    out: Path
    count: int = 60
    seed: int = 20_000


def tier_list(count: int) -> list[str]:
    """Tiers of `count` cases, in the shares of TIERS, mixed."""
    edges = np.cumsum(list(TIERS.values()))
    places = (np.arange(count) + 0.5) / count
    return [list(TIERS)[int(np.searchsorted(edges, p * edges[-1]))] for p in places]


def case_truth(tier: str, rng: np.random.Generator, vehicle: VehicleParameters) -> tuple[Truth, list[str]]:
    """What a case hides, and what the diagnosis's catalogue is to lack."""
    drawn = "tolerance" if tier == "removed" and rng.uniform() < 0.5 else "exact" if tier == "removed" else tier
    truth = drawn_truth(rng, drawn, vehicle)
    return truth, sorted(truth.effects) if tier == "removed" else []


def make_one(name: str, tier: str, seed: Sequence[int], out: Path, compiled: bool) -> dict[str, Any]:
    """Makes one case folder; returns its label."""
    vehicle = VehicleParameters()
    rng = np.random.default_rng(list(seed))
    truth, without = case_truth(tier, rng, vehicle)
    runs = (make_case if compiled else drake_case)(truth, vehicle, rng)
    folder = out / "cases" / name
    folder.mkdir(parents=True, exist_ok=True)
    for run in runs:
        write_run(run, folder / f"{run.name}.csv")
    return {"case": name, "tier": tier, "without": without, **dataclasses.asdict(truth)}


def _make_one(job: tuple[str, str, tuple[int, int], Path, bool]) -> dict[str, Any]:
    return make_one(*job)


def make(command: Make) -> None:
    """Makes cases, a manifest and the sealed labels."""
    seed = command.seed if command.seed is not None else secrets.randbits(63)
    tiers = tier_list(command.count)
    order = np.random.default_rng(seed).permutation(command.count)
    command.out.mkdir(parents=True, exist_ok=True)
    labels: list[dict[str, Any]] = []
    jobs = [
        (hashlib.sha256(f"{seed}-{place}".encode()).hexdigest()[:8], tiers[i], (seed, place), command.out,
         command.compiled)
        for place, i in enumerate(order)
    ]  # fmt: skip
    run_jobs(command.run_on, _make_one, jobs, lambda _job, label: labels.append(label), "case", tasks_per_worker=20)
    text = json.dumps({"seed": seed, "labels": sorted(labels, key=lambda label: str(label["case"]))})
    sealed = base64.b64encode(zlib.compress(text.encode()))
    write_bytes(command.out / "labels.sealed", sealed)
    VehicleParameters().to_yaml(command.out / "vehicle.yaml")
    manifest = {
        "labels_sha256": hashlib.sha256(sealed).hexdigest(),
        "cases": {label["case"]: {"without": label["without"]} for label in labels},
    }
    write_text(command.out / "manifest.json", json.dumps(manifest, indent=1, sort_keys=True))


def answer_one(folder: Path, without: Sequence[str]) -> tuple[str, dict[str, Any]]:
    """Diagnoses one case; returns the answer's JSON and the evidences behind it."""
    vehicle = VehicleParameters.from_yaml(folder.parent.parent / "vehicle.yaml")
    catalogue = [name for name in CATALOGUE if name not in without]
    diagnosis = answer_folder(folder, vehicle, workers=1, catalogue=catalogue)
    assert isinstance(diagnosis, Diagnosis)  # without a calibration
    evidence = {"+".join(f.names): e for f, e in diagnosis.found}
    fits = {"+".join(f.names): {n: [f.magnitudes[n], f.deviations[n]] for n in f.names} for f, _ in diagnosis.found}
    raw = {
        "evidence": evidence,
        "fits": fits,
        "unexplained": diagnosis.answer.details["unexplained_nats"],
        "implausible": diagnosis.answer.details["implausible_nats"],
        "catalogue": len(catalogue),
    }
    return diagnosis.answer.to_json(), raw


def _answer_one(job: tuple[Path, tuple[str, ...]]) -> tuple[str, dict[str, Any]]:
    return answer_one(*job)


def answer(command: Respond) -> None:
    """Writes an answer for each case that has none."""
    manifest = json.loads((command.out / "manifest.json").read_text())
    (command.out / "answers").mkdir(exist_ok=True)
    (command.out / "evidence").mkdir(exist_ok=True)
    jobs = [
        (command.out / "cases" / name, tuple(case["without"]))
        for name, case in sorted(manifest["cases"].items())
        if not is_done(command.out / "answers" / f"{name}.json")
    ]

    def write(job: tuple[Path, tuple[str, ...]], answered: tuple[str, dict[str, Any]]) -> None:
        text, raw = answered
        write_text(command.out / "evidence" / f"{job[0].name}.json", json.dumps(raw))
        write_text(command.out / "answers" / f"{job[0].name}.json", text)

    run_jobs(command.run_on, _answer_one, jobs, write, "case")
    answers = [read_answer(command.out / "answers" / f"{name}.json") for name in sorted(manifest["cases"])]
    write_results_table(command.out, [answer_row(one) for one in answers])


def opened(out: Path, partial: bool = False) -> list[dict[str, Any]]:
    """Labels of a set of cases whose answers are all there, or of those that have one.

    Raises:
        SystemExit: an answer is missing, or the labels are not those that were sealed.
    """
    manifest = json.loads((out / "manifest.json").read_text())
    missing = [name for name in manifest["cases"] if not is_done(out / "answers" / f"{name}.json")]
    if missing and not partial:
        sys.exit(f"{out}: {len(missing)} cases have no answer yet; run 'answer' before the labels are opened")
    sealed = (out / "labels.sealed").read_bytes()
    if hashlib.sha256(sealed).hexdigest() != manifest["labels_sha256"]:
        sys.exit(f"{out}: labels.sealed is not what the manifest's hash was made of")
    labels: list[dict[str, Any]] = json.loads(zlib.decompress(base64.b64decode(sealed)))["labels"]
    return [label for label in labels if label["case"] not in missing]


def answered(out: Path, partial: bool = False) -> list[tuple[dict[str, Any], dict[str, Any]]]:
    """(label, answer) of each case."""
    return [
        (label, json.loads((out / "answers" / f"{label['case']}.json").read_text())) for label in opened(out, partial)
    ]


def scored_row(out: Path, label: dict[str, Any]) -> dict[str, Any]:
    """A case's answer and what it hid."""
    hidden = {f"true_{name}": size for name, size in label["effects"].items()}
    truth = {"tier": label["tier"], "true_causes": "+".join(sorted(label["effects"])), **hidden}
    return answer_row(read_answer(out / "answers" / f"{label['case']}.json")) | truth


def score(command: Score) -> None:
    """Prints and writes the scores, and draws their pictures."""
    pairs = answered(command.out, command.partial)
    result = scores(pairs)
    write_text(command.out / "scores.json", json.dumps(result, indent=1))
    text = score_text(result)
    write_report(command.out, text, command)
    draw_scores(pairs, command.out)
    write_results_table(command.out, [scored_row(command.out, label) for label, _ in pairs])


def calibrate(command: Calibrate) -> None:
    """Fits and prints the posterior's constants."""
    from experiments.gap.calibration import fitted_constants, write_constants

    if not (command.out / "manifest.json").exists():
        make(Make(command.out, command.count, compiled=True, seed=command.seed, run_on=command.run_on))
    answer(Respond(command.out, run_on=command.run_on))
    records = []
    for label in opened(command.out):
        records.append((label, json.loads((command.out / "evidence" / f"{label['case']}.json").read_text())))
    constants = fitted_constants(records)
    write_constants(constants, command.out / "calibration.yaml")
    print((command.out / "calibration.yaml").read_text())


Command = (
    Annotated[Make, tyro.conf.subcommand("make")]
    | Annotated[Respond, tyro.conf.subcommand("answer")]
    | Annotated[Score, tyro.conf.subcommand("score")]
    | Annotated[Calibrate, tyro.conf.subcommand("calibrate")]
)


def main(command: Make | Respond | Score | Calibrate) -> None:
    """Makes, answers, scores or calibrates."""
    if isinstance(command, Make):
        make(command)
    elif isinstance(command, Respond):
        answer(command)
    elif isinstance(command, Score):
        score(command)
    else:
        calibrate(command)


if __name__ == "__main__":
    run_command(main, Command, __doc__)
