"""Fits the constants of the diagnosis's posterior on answered cases whose labels are open."""

import dataclasses
import itertools
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from drift_drake.common.safe_files import write_text
from drift_drake.gap.evidence.posterior import PosteriorConstants, probabilities_of
from experiments.benchmarks.scores import UNKNOWNS, true_name

Record = tuple[dict[str, Any], dict[str, Any]]  # (label, evidences)

TEMPERATURES = (1.0, 1.5, 2.0, 3.0)
UNKNOWN_COSTS = (5.0, 10.0, 20.0, 40.0)
UNKNOWN_SHARES = (0.0, 0.001, 0.003, 0.01)
LEAST = 1e-4  # probability that the log score does not go below, so that one case does not decide


def probabilities(record: dict[str, Any], c: PosteriorConstants) -> dict[str, float]:
    """The posterior that some constants make of a case's evidences."""
    evidence = {tuple(name.split("+")) if name else (): e for name, e in record["evidence"].items()}
    return probabilities_of(evidence, record["unexplained"] + record["implausible"], record["catalogue"], c)


def log_score(records: Sequence[Record], c: PosteriorConstants) -> float:
    """Mean log probability of the truth."""
    p = [probabilities(raw, c).get(true_name(label), 0.0) for label, raw in records]
    return float(np.mean(np.log(np.maximum(p, LEAST))))


def standard_errors(records: Sequence[Record]) -> np.ndarray:
    """Errors of fitted magnitudes in their standard deviations, under the true hypothesis."""
    out = []
    for label, raw in records:
        name = true_name(label)
        if label["tier"] not in UNKNOWNS and name in raw["fits"]:
            for effect, (q, sigma) in raw["fits"][name].items():
                out.append((q - label["effects"][effect]) / sigma)
    return np.array(out)


def fitted_constants(records: Sequence[Record]) -> PosteriorConstants:
    """The constants with the best log score on a grid; intervals widened (never narrowed) to cover 95 %."""
    best, best_score = PosteriorConstants(), -np.inf
    for t, cost, part in itertools.product(TEMPERATURES, UNKNOWN_COSTS, UNKNOWN_SHARES):
        c = PosteriorConstants(temperature=t, unknown_cost=cost, unknown_share=part)
        score = log_score(records, c)
        if score > best_score + 1e-9:
            best, best_score = c, score
    errors = standard_errors(records)
    factor = max(float(np.quantile(np.abs(errors), 0.95)) / 1.96, 1.0) if len(errors) else 1.0
    return dataclasses.replace(best, interval_factor=factor)


def write_constants(c: PosteriorConstants, path: Path) -> None:
    """Writes the constants as YAML (`drift_drake/gap/evidence/calibration.yaml` is such a file)."""
    write_text(path, yaml.safe_dump(dataclasses.asdict(c), sort_keys=False))
