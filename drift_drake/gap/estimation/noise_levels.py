"""How noisy the readings of each channel are, and whether a day's are as noisy as its baseline's.

A wheel speed that is suddenly coarse, another sensor, or a filter in the recorder change no mean of the errors, but the
noise. It is judged where the baseline's own is white: what is left of a smoothed signal is the car's motion.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.special import logsumexp

from drift_drake.gap.estimation.windows import PREDICTED, WindowedRun
from drift_drake.gap.logs.noise import CLIP, fourth_differences, white_noise_level

NOT_WHITE = 0.0  # stands for a level where noise is not white
OF_WHITE = -0.8  # correlation of white noise's neighbouring fourth differences: -56 / 70
APART = 0.08  # from it, that is still white; a recording of 10 s at 100 Hz scatters by 0.02
SCATTER, COUNTS = (
    0.25,
    4.0,
)  # of a level's logarithm between recordings before these are seen, and recordings it is worth
CHANGES = 1.2  # standard deviation of a logarithm that has changed: threefold
SURE = 3.0  # [nats] of evidence, from which a change is said
LEAST_ROWS = 200
FURTHEST = 3.0  # of a logarithm: of a coarse signal most differences are zero


def is_white(values: np.ndarray) -> bool:
    """Whether the noise on a signal [n] is white: by its neighbouring fourth differences."""
    fourth, spread = fourth_differences(values)
    bounded = np.clip(fourth, -CLIP * spread, CLIP * spread)
    power = float(bounded @ bounded)
    return power > 0.0 and abs(float(bounded[1:] @ bounded[:-1]) / power - OF_WHITE) < APART


def log_levels(runs: Sequence[WindowedRun], white: bool) -> np.ndarray:
    """Logarithms of the noise [recordings, channels] by recording, of all `PREDICTED`; `NOT_WHITE` where there is none.

    Args:
        white: leave out recordings' channels whose noise is not white.
    """
    recordings = sorted({run.recording for run in runs})
    out = np.full((len(recordings), len(PREDICTED)), NOT_WHITE)
    for k, recording in enumerate(recordings):
        parts = [run for run in runs if run.recording == recording and len(run.y) >= LEAST_ROWS]
        for i in range(len(PREDICTED)):
            seen = [run.y[:, i] for run in parts if run.used[i]]
            if seen and not (white and not all(map(is_white, seen))):
                levels = [np.log(max(white_noise_level(y), 1e-12)) for y in seen]
                out[k, i] = float(np.average(levels, weights=[len(y) for y in seen]))
    return out


class NoiseChange(NamedTuple):
    """Whether the noise on a day's readings has changed, by channel of `PREDICTED`; zero where it is not judged."""

    ratios: np.ndarray  # logarithms of the day's noise over the baseline's [channels]
    evidence: np.ndarray  # log evidence of a change over that of none [channels]

    @property
    def log_evidence(self) -> float | None:
        """Of a change of one channel, any of them; None where none is judged."""
        judged = self.evidence[self.evidence != 0.0]
        return float(logsumexp(judged) - np.log(len(judged))) if len(judged) else None

    def sentences(self) -> list[str]:
        """Which readings are noisier or quieter than the baseline's, beyond chance."""
        return [
            f"the noise on {name} is {_times(ratio)} the baseline's: another sensor, coarser steps or a filter"
            for name, ratio, nats in zip(PREDICTED, self.ratios, self.evidence, strict=True)
            if nats > SURE
        ]


def _times(ratio: float) -> str:
    """A logarithm of a ratio in words; beyond `FURTHEST` it is cut."""
    cut = "" if abs(ratio) < FURTHEST else ("more than " if ratio > 0.0 else "less than ")
    return f"{cut}{np.exp(ratio):.2g} times"


def _log_t(x: float, free: float, scale: float) -> float:
    """Log density of Student's t with degrees of freedom and a squared scale, but for a constant of the former."""
    return -0.5 * (free + 1.0) * float(np.log1p(x**2 / (free * scale))) - 0.5 * float(np.log(scale))


def changed(baseline: np.ndarray, runs: Sequence[WindowedRun]) -> NoiseChange:
    """The change of the noise relative to a baseline's.

    Normal distributions, whose variance the baseline's recordings teach (Student's t).

    Args:
        baseline: white `log_levels` [recordings, channels]; runs: of the day.
    """
    day, count = log_levels(runs, white=False), len(baseline)
    ratios, evidence = np.zeros(len(PREDICTED)), np.zeros(len(PREDICTED))
    for i in range(len(PREDICTED)):
        now = day[day[:, i] != NOT_WHITE, i]
        if count and len(now) and np.all(baseline[:, i] != NOT_WHITE):
            own = baseline[:, i] - baseline[:, i].mean()
            free = COUNTS + count - 1.0
            variance = (COUNTS * SCATTER**2 + float(own @ own)) / free * (1.0 + 1.0 / count)
            ratios[i] = np.clip(now.mean() - baseline[:, i].mean(), -FURTHEST, FURTHEST)
            evidence[i] = _log_t(ratios[i], free, variance + CHANGES**2) - _log_t(ratios[i], free, variance)
    return NoiseChange(ratios, evidence)
