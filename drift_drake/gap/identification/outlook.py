"""Which change a diagnosis could name after a baseline like this one, and after one of more such recordings.

To first order in the magnitudes: an effect shifts the scores by its column of the information, and is named where that
is far enough from none and from what the effect most like it does. What a baseline leaves unknown shrinks with each
further recording of the same kinds of driving; what its drives do not show, no number of them brings.
"""

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np

from drift_drake.car.effects.catalogue import CATALOGUE, LIMITS
from drift_drake.car.parameters import VehicleParameters
from drift_drake.common.errors import significant
from drift_drake.gap.estimation.baseline import scatter_of, with_partial
from drift_drake.gap.estimation.normal import Normal
from drift_drake.gap.estimation.prior import REACH, named_from
from drift_drake.gap.estimation.scores import Day, block_information

TIMES = (1, 2, 4)  # as many recordings as there are
SINGULAR = 1e-9  # of a scatter's largest direction, below which it is none
WORTH_SAYING = 0.85  # of a limit, down to which twice the recordings must bring it
MOST_SAID = 5

Outlook = dict[str, list[float | None]]  # by effect the least magnitude after `TIMES` as many recordings


def outlook(day: Day, normal: Normal, left: np.ndarray, vehicle: VehicleParameters) -> Outlook:
    """Detection limits of a day like that of the calibration, after `TIMES` as many recordings like its own.

    Args:
        day: of the calibration, under the calibrated car; normal: its baseline; left: standard deviations
            [n] of what the car may deviate by (`baseline.left_of`), in the units of `normal`.
    """
    information = block_information(day, normal.scales, normal.precision)
    columns = []
    for times in TIMES:
        unknown = unknown_after(normal.left_open, with_partial(left, len(information), len(normal.of_kind)), times)
        after = dataclasses.replace(normal, left_open=unknown)
        columns.append(limits(information, scatter_of(day, after).covariance, normal, vehicle))
    return {name: [column[name] for column in columns] for name in columns[0]}


def unknown_after(unknown: np.ndarray, prior: np.ndarray, times: float) -> np.ndarray:
    """Covariance [n, n] of what is left unknown after so many times the logs; prior: deviations [n] before any."""
    share, directions = np.linalg.eigh(unknown / np.outer(prior, prior))
    share = np.clip(share, 1e-12, 1.0)
    left = share / (share + times * (1.0 - share))
    return np.asarray((directions * left) @ directions.T * np.outer(prior, prior))


def limits(
    information: np.ndarray, covariance: np.ndarray, normal: Normal, vehicle: VehicleParameters
) -> dict[str, float | None]:
    """The least magnitude of each effect that would be named, None beyond its reach; a rate limit is not judged.

    Args:
        information: of the day, in units [n, n]; covariance: of its scores where nothing has changed [n, n].
    """
    deviation = np.sqrt(np.diag(covariance))
    spread, directions = np.linalg.eigh(covariance / np.outer(deviation, deviation))
    root = np.where(spread > SINGULAR * spread[-1], 1.0 / np.sqrt(np.maximum(spread, 1e-300)), 0.0)
    shifts = (root[:, None] * directions.T) @ (information[:, : len(normal.names)] / deviation[:, None])
    size = np.maximum(np.linalg.norm(shifts, axis=0), 1e-150)
    alike = np.abs(shifts.T @ shifts) / np.outer(size, size) - np.eye(len(size))
    out: dict[str, float | None] = {}
    for name, unit, least in zip(normal.names, normal.units, named_from(alike.max(axis=0)) / size, strict=True):
        if name not in LIMITS:
            info = CATALOGUE[name]
            magnitude = max(float(least * unit), info.least_for(vehicle))
            reach = REACH * max(abs(end) for end in info.range_for(vehicle))
            out[name] = magnitude if magnitude <= reach else None
    return out


def gains(found: Mapping[str, Sequence[float | None]]) -> list[str]:
    """Effects that more recordings like these would show earlier, the one that gains the most first."""

    def share(name: str) -> float:
        now, twice, _ = found[name]
        return 1.0 if twice is None else 0.0 if now is None else twice / now

    return [name for name in sorted(found, key=share) if share(name) < WORTH_SAYING]


def sentences(found: Mapping[str, Sequence[float | None]], recordings: int) -> list[str]:
    """What more recordings would bring, in words; nothing where they bring little."""
    parts = []
    for name in gains(found)[:MOST_SAID]:
        now, twice, _ = (None if q is None else significant(q, 2) for q in found[name])
        parts.append(f"{name} from {twice}{CATALOGUE[name].suffix} on ({'not at all' if now is None else now} now)")
    if not parts:
        return []
    more = f"{recordings} more recording{'s' if recordings > 1 else ''} like these"
    return [f"{more} would let a diagnosis of a later log name {', '.join(parts)}"]


def never(found: Mapping[str, Sequence[float | None]]) -> list[str]:
    """Effects that no number of such recordings would show."""
    return [name for name, column in found.items() if all(q is None for q in column)]
