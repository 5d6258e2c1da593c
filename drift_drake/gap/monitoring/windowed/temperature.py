"""How much less evidence counts than under the null distribution, so that a car's own drives raise no alarm.

The statistic of Shiryaev and Roberts is a sum over onsets of likelihood ratios, in seconds; while nothing changes it
reaches a level of A seconds once in A seconds at most, in the mean (Pollak 1985). Where a car's errors have heavier
tails than the null distribution, as after steps of the steering, it comes higher. Evidence is divided by the least
temperature at which the statistic, over the calibration's own recordings, stays below the time that they took, and by
`beyond` more, since they are shorter than the time between false alarms.
"""

from collections.abc import Sequence

import numpy as np

from drift_drake.gap.monitoring.evidence import FALSE_ALARMS, HAZARD, EvidenceProblem
from drift_drake.gap.monitoring.history import no_history, of_parts, older_than, since, until, with_block
from drift_drake.gap.monitoring.monitor import FORGETTING
from drift_drake.gap.monitoring.windowed.null import Null, capped, judged, whitened
from drift_drake.gap.monitoring.windowed.sums import WindowSums

LEAST, MOST = 1.2, 100.0
"""The least was set on a sedan of others' simulators, on its hardest drives without a change."""
EXACT = 1.05  # factor to which it is found
FEWEST = 50  # windows that a calibration is taken to have

Scores = tuple[np.ndarray, np.ndarray, np.ndarray]  # ages [a], whitened scores [a, n], their mean [a, n, K]


def temperature_of(problem: EvidenceProblem, null: Null, recordings: Sequence[Sequence[WindowSums]]) -> float:
    """The temperature of a car's evidence, from the sums of its recordings' windows; null: of any temperature."""
    scores = [one for sums in recordings for one in scores_of(null._replace(temperature=1.0), sums)]
    count = max(len(scores), FEWEST)
    seconds, more = null.seconds * count, beyond(count, null.seconds)
    low, high = LEAST / more, MOST
    if largest(problem, null, scores, low) <= seconds:
        return LEAST
    while high > EXACT * low:
        middle = float(np.sqrt(low * high))
        low, high = (low, middle) if largest(problem, null, scores, middle) <= seconds else (middle, high)
    return more * high


def beyond(windows: int, seconds: float) -> float:
    """Factor on a temperature that so many windows show, each of so many seconds, for the default rate of false alarms.

    Errors are taken to have an exponential distribution's tails: the largest of n grows as log(n), and evidence, which
    is quadratic in it, as the square of that; the level that may be reached grows as the logarithm of time.
    """
    time = 3600.0 / FALSE_ALARMS
    grown = (np.log(time / seconds) / np.log(windows)) ** 2
    return float(max(grown * np.log(windows * seconds) / np.log(time), 1.0))


def scores_of(null: Null, sums: Sequence[WindowSums]) -> list[Scores]:
    """The whitened scores of each age after each window of a recording."""
    out = list[Scores]()
    if not sums:
        return out
    history = no_history(of_parts(sums[0], by=np.zeros_like))
    for one in sums:
        history = with_block(history, capped(null, older_than(history, 0.0), one), FORGETTING, 0.0)
        ages, recent = since(history)
        out.append((ages, *whitened(null, recent, until(history))))
    return out


def largest(problem: EvidenceProblem, null: Null, scores: Sequence[Scores], temperature: float) -> float:
    """The statistic's maximum [s] over all windows, at a temperature."""
    root = np.sqrt(temperature)
    none = min((judged(problem, null, ages, w / root, m / root).probabilities[0] for ages, w, m in scores), default=1.0)
    return float((1.0 - none) / max(none, 1e-300) / HAZARD)
