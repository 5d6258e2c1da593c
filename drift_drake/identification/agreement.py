"""Whether the recordings of a baseline agree: which parameters they ask different values of, which recording is odd.

Each recording pulls an estimate away from that of the others (`scores.pulls`, the influence of leaving it out). Where
that is far more than chance, the equations lack something that one drive shows and another does not, or the car was
not the same. More recordings of the same kinds of driving do not average that out: the estimate is as uncertain as one
recording's differs from another's, however many there are.
"""

import dataclasses
import itertools
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from drift_drake.estimation.baseline import Learnt, scatter_of
from drift_drake.estimation.normal import Normal
from drift_drake.estimation.prediction_constants import CALIBRATED
from drift_drake.estimation.prior import TWO_SIDED
from drift_drake.estimation.problem import flat
from drift_drake.estimation.robust_fit import robust_scales
from drift_drake.estimation.scores import BLOCK, Day, pulls, spread, summed
from drift_drake.identification.calibration import Parameter
from drift_drake.identification.estimate import Estimate

BY_CHANCE = 0.01  # probability that recordings which do not differ are called so
ODD, ODD_OF_FEW = 4.5, 10.0  # times the median of the others that a recording is from normal, to be named
FEW = 6  # recordings, up to which each is of a kind of driving of its own
LEAST_ODD = 2.5  # [nats] below which none is odd
LEAST_TO_COMPARE = 3  # pieces, of which one can be odd
PIECE, MOST_PIECES = 10.0, 12  # [s] at least, and how many
MOST_WINDOWS = 1200


@dataclasses.dataclass(frozen=True)
class Agreement:
    """Of the estimates [n]."""

    apart: np.ndarray  # [n] variance of what single recordings ask for
    disagreed: np.ndarray  # [n] bool: it is more than chance, and more than what the logs leave open otherwise
    furthest: np.ndarray  # [n] index of the recording that pulls the most


def agreement(pulled: np.ndarray, left: np.ndarray) -> Agreement:
    """Whether recordings agree about estimates.

    Args:
        pulled: by how much each recording pulls the estimates [K, n]; left: variances of the estimates [n] if the
            recordings do not differ, in the same units, `CALIBRATED` times what blocks of time show.
    """
    from scipy.stats import chi2  # slow to import

    count = len(pulled)
    apart = np.diag(spread(pulled)).copy()
    if count < 2:
        return Agreement(apart, np.zeros(len(left), dtype=bool), np.zeros(len(left), dtype=int))
    chance = left * count / CALIBRATED  # of one recording, from the scatter of its blocks
    factor = float(chi2.ppf(1.0 - BY_CHANCE, count - 1)) / (count - 1)
    return Agreement(apart, (apart > factor * chance) & (apart > left), np.argmax(np.abs(pulled), axis=0))


def odd_pieces(day: Day, pulled: np.ndarray, learn: Callable[[Day], Learnt]) -> dict[str, float]:
    """Recordings that differ from the others far more than these among themselves, and how many times more.

    Each is left out in turn, to first order, and asked as another day would be how far from normal it is for the car
    that the others show. Of fewer than three recordings, pieces of them.

    Args:
        day: of the calibration, under the calibrated car; pulled: by how much each recording pulls the effects, in
            units [K, n] (`scores.pulls`); learn: what is normal, from a day of calibration.
    """
    day = thinned_day(day)
    if len(pulled) >= LEAST_TO_COMPARE:
        names, piece = sorted({run.recording for run in day.runs}), day.recordings[day.run]
    else:
        names, piece = pieces(day)
        pulled = np.zeros((len(names), pulled.shape[1]))
    if len(names) < LEAST_TO_COMPARE:
        return {}
    nats = []
    for k in range(len(names)):
        # The car without the recording, to first order.
        e = day.errors - (day.jacobian[:, :, : pulled.shape[1]] @ pulled[k]).reshape(day.errors.shape) * robust_scales(
            day.errors
        )
        moved = dataclasses.replace(day, errors=e)
        nats.append(from_normal(part_of_day(moved, piece == k), learn(part_of_day(moved, piece != k)).normal))
    times = [nats[k] / max(float(np.median(np.delete(nats, k))), 1e-9) for k in range(len(names))]
    odd = ODD if len(names) >= FEW else ODD_OF_FEW
    return {name: q for name, q, own in zip(names, times, nats, strict=True) if q > odd and own > LEAST_ODD}


def thinned_day(day: Day) -> Day:
    """The day with `MOST_WINDOWS` windows at most, evenly chosen."""
    every = max(int(np.ceil(len(day.run) / MOST_WINDOWS)), 1)
    return part_of_day(day, np.arange(len(day.run)) % every == 0) if every > 1 else day


def pieces(day: Day) -> tuple[list[str], np.ndarray]:
    """Names of a day's runs, cut into pieces of `PIECE` seconds or more, and the piece [windows] that each is of."""
    ends = [float(run.starts[-1] * run.period) if len(run.starts) else 0.0 for run in day.runs]
    length = max(PIECE, sum(ends) / MOST_PIECES)
    names, piece = list[str](), list[np.ndarray]()
    for run, end in zip(day.runs, ends, strict=True):
        edges = np.linspace(0.0, end, max(int((end + BLOCK) // length), 1) + 1)
        at = np.searchsorted(edges, run.starts * run.period, side="right") - 1
        piece.append(len(names) + np.clip(at, 0, len(edges) - 2))
        names += [run.name if len(edges) == 2 else f"{run.name} from {a:.0f} to {b:.0f} s"
                  for a, b in itertools.pairwise(edges)]  # fmt: skip
    there, index = np.unique(np.concatenate(piece), return_inverse=True)
    return [names[k] for k in there], index


def part_of_day(day: Day, kept: np.ndarray) -> Day:
    """The windows of a day that are kept [windows] (bool)."""
    there, run = np.unique(day.run[kept], return_inverse=True)
    block = np.unique(day.block[kept], return_inverse=True)[1]
    runs = [dataclasses.replace(day.runs[i], starts=day.runs[i].starts[kept[day.run == i]]) for i in there]
    return dataclasses.replace(
        day, runs=runs, errors=day.errors[kept], jacobian=day.jacobian[kept], block=block, run=run,
        weights=day.weights[kept],
    )  # fmt: skip


def from_normal(day: Day, normal: Normal) -> float:
    """Half the squared distance of a day's scores from normal [nats]."""
    scatter = scatter_of(day, normal)
    scores = summed(day, normal, day.errors) - scatter.mean
    return float(0.5 * scores @ scatter.inverse @ scores)


def by_likelihood(
    found: Estimate, recordings: Sequence[str], at: np.ndarray, widened: np.ndarray
) -> tuple[Agreement, list[str]]:
    """The same of a fit by likelihood, and the recordings' names.

    Args:
        recordings: of each run; at: indices [n] in theta of the estimates; widened: what their standard deviations
            were multiplied by [n], since innovations hang together.
    """
    names, jacobian = sorted(set(recordings)), found.at.jacobian
    scores, rows = np.zeros((len(names), len(found.theta))), np.zeros(len(names))
    parts = jacobian.by_run(flat(found.problem, found.at.filtered.innovations))
    for recording, block, columns, e in zip(recordings, jacobian.blocks, jacobian.columns, parts, strict=True):
        k = names.index(recording)
        scores[k, columns] += block.T @ e
        rows[k] += len(e)
    pulled = pulls(scores, rows, found.covariance)[:, at]
    return agreement(pulled, CALIBRATED * np.diag(found.covariance)[at] * widened**2), names


def with_differences(
    parameters: Mapping[str, Parameter], found: Agreement, names: Sequence[str], factor: np.ndarray
) -> tuple[dict[str, Parameter], dict[str, str]]:
    """Parameters whose intervals are as wide as recordings differ, where they do, and which pulls those the most.

    Args:
        names: of the recordings; factor: a parameter's unit in those of `found` [n].
    """
    out, disagreed = dict(parameters), dict[str, str]()
    for i, (name, p) in enumerate(parameters.items()):
        if found.disagreed[i] and p.kind != "known":
            deviation = min(float(np.hypot(p.deviation, factor[i] * np.sqrt(found.apart[i]))), p.prior)
            more = TWO_SIDED * (deviation - p.deviation)
            low = max(p.low - more, 0.0) if p.low >= 0.0 else p.low - more
            out[name] = dataclasses.replace(p, deviation=deviation, low=low, high=p.high + more)
            disagreed[name] = names[found.furthest[i]]
    return out, disagreed


def sentences(disagreed: Mapping[str, str], odd: Mapping[str, float]) -> list[str]:
    """In words; disagreed: by parameter the recording that pulls it the most; odd: `odd_pieces`."""
    by_recording: dict[str, list[str]] = {}
    for name, recording in disagreed.items():
        by_recording.setdefault(recording, []).append(name)
    out = [
        f"the recordings ask for different values of {', '.join(parts)}, {recording} the most: not identified, and the "
        f"interval is as wide as they differ; record more of that kind of driving, or leave {recording} out if the car "
        "was not the same"
        for recording, parts in by_recording.items()
    ]
    if odd:
        out.append(
            f"{', '.join(odd)}: far from the rest of the baseline, {max(odd.values()):.0f} times as much as its other "
            "parts: another car, load or setting, an effect that comes and goes, or a kind of driving that the others "
            "lack; leave it out, or record more of its kind"
        )
    return out
