"""Whether the recordings of a baseline agree: which parameters they ask different values of, which recording is odd.

Each recording pulls an estimate away from that of the others (`scores.pulls`, the influence of leaving it out). Where
that is far more than chance, the equations lack something that one drive shows and another does not, or the car was
not the same. More recordings of the same kinds of driving do not average that out: the estimate is as uncertain as one
recording's differs from another's, however many there are.
"""

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np
from scipy.special import chdtri  # chi-square's; scipy.stats takes half a second to import

from drift_drake.gap.estimation.prediction_constants import CALIBRATED
from drift_drake.gap.estimation.prior import TWO_SIDED
from drift_drake.gap.estimation.problem import flat
from drift_drake.gap.estimation.scores import Day, pulls, spread
from drift_drake.gap.evidence.alarms import threshold
from drift_drake.gap.evidence.posterior import NONE
from drift_drake.gap.evidence.ranking import DayRanked
from drift_drake.gap.identification.calibration import Parameter
from drift_drake.gap.identification.estimate import Estimate

BY_CHANCE = 0.01  # probability that recordings which do not differ are called so, or odd


@dataclasses.dataclass(frozen=True)
class Agreement:
    """Of the estimates [n]."""

    apart: np.ndarray  # [n] variance of what single recordings ask for
    disagreed: np.ndarray  # [n] bool: it is more than chance, and so more than what the logs leave open otherwise
    furthest: np.ndarray  # [n] index of the recording that pulls the most


def agreement(pulled: np.ndarray, left: np.ndarray) -> Agreement:
    """Whether recordings agree about estimates.

    Args:
        pulled: by how much each recording pulls the estimates [K, n]; left: variances of the estimates [n] if the
            recordings do not differ, in the same units, `CALIBRATED` times what blocks of time show.
    """
    count = len(pulled)
    apart = np.diag(spread(pulled)).copy()
    if count < 2:
        return Agreement(apart, np.zeros(len(left), dtype=bool), np.zeros(len(left), dtype=int))
    chance = left * count / CALIBRATED  # of one recording, from the scatter of its blocks
    factor = float(chdtri(count - 1, BY_CHANCE)) / (count - 1)
    return Agreement(apart, apart > factor * chance, np.argmax(np.abs(pulled), axis=0))


def odd_parts(day: Day, asked: Sequence[DayRanked]) -> dict[str, str]:
    """Recordings, or stretches of the only one, that have a gap relative to the others, and what that is most like.

    Args:
        day: of the calibration, under the calibrated car; asked: what each of them says, left out (`asked_in_turn`).
    """
    names = sorted({run.recording for run in day.runs})
    names = stretch_names(day) if len(names) == 1 else names
    return {name: found.most_like for name, found in zip(names, asked, strict=False)
            if found.probabilities[NONE] < threshold(BY_CHANCE)}  # fmt: skip


def stretch_names(day: Day) -> list[str]:
    """Names of a day's stretches."""
    out, stretch = [], day.stretch
    for k in range(int(stretch.max()) + 1):
        run = day.runs[int(day.run[stretch == k][0])]
        at = np.concatenate([r.starts for r in day.runs])[stretch == k] * run.period
        whole = len(np.unique(stretch[day.run == day.run[stretch == k][0]])) == 1
        out.append(run.name if whole else f"{run.name} from {at[0]:.0f} to {at[-1]:.0f} s")
    return out


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


def sentences(disagreed: Mapping[str, str], odd: Mapping[str, str]) -> list[str]:
    """In words; disagreed: by parameter the recording that pulls it the most; odd: `odd_parts`."""
    by_recording: dict[str, list[str]] = {}
    for name, recording in disagreed.items():
        by_recording.setdefault(recording, []).append(name)
    out = [
        f"the recordings ask for different values of {', '.join(parts)}, {recording} the most: not identified, and the "
        f"interval is as wide as they differ; record more of that kind of driving, or leave {recording} out if the car "
        "was not the same"
        for recording, parts in by_recording.items()
    ]
    out += [
        f"{name} has a gap relative to the rest of the baseline, most like {like}: another car, load or setting, an "
        "effect that comes and goes, or a kind of driving that the others lack; leave it out, or record more of "
        "its kind"
        for name, like in odd.items()
    ]
    return out
