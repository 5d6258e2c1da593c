"""What a log is like before anything is estimated from it: rates, columns, noise, bad samples, driving."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from drift_drake.logs.noise import white_noise_level
from drift_drake.logs.screening.screened import MEASURED, screened
from drift_drake.logs.table import OPTIONAL, Run


@dataclasses.dataclass(frozen=True)
class RunQuality:
    """One run. noise: white noise by column (SI, one standard deviation); bad: rows without a measurement by column;
    reached: the largest speed [m/s], lateral acceleration v r [m/s^2], sideslip [rad], steering [rad] and rate of
    steering [rad/s] (99 % of the rows stay below)."""

    name: str
    seconds: float
    rate: float  # [Hz]
    missing: list[str]
    noise: dict[str, float]
    bad: dict[str, int]
    reached: dict[str, float]


def quality(runs: Sequence[Run]) -> tuple[list[RunQuality], list[str]]:
    """Each run's quality, and sentences on bad samples."""
    clean, sentences = screened(runs)
    found = []
    for run, one in zip(runs, clean, strict=True):
        bad: dict[str, int] = {}
        for part in one.bad:
            bad[part.column] = bad.get(part.column, 0) + part.stop - part.start
        columns = {name: values for name in MEASURED if (values := one.run.column(name)) is not None}
        noise = {name: white_noise_level(values) for name, values in columns.items() if name not in ("x", "y", "psi")}
        missing = [name for name in OPTIONAL if run.column(name) is None]
        length = len(run) * run.period
        found.append(RunQuality(run.name, length, 1.0 / run.period, missing, noise, bad, reached(one.run)))
    return found, sentences


def reached(run: Run) -> dict[str, float]:
    """How far 99 % of the rows go."""

    def most(values: np.ndarray) -> float:
        return float(np.quantile(np.abs(values), 0.99))

    out = {"speed": most(run.v), "lateral acceleration": most(run.v * run.r)}
    if run.beta is not None:
        out["sideslip"] = most(run.beta)
    return out | {"steering": most(run.delta_cmd), "steering rate": most(np.gradient(run.delta_cmd, run.period))}
