"""False alarms: the probability of none below which there is a gap, at a rate that the user asks for, on this car."""

from typing import Any

import numpy as np

from drift_drake.common.arrays import Array
from drift_drake.gap.evidence.constants import RECORDINGS_WORTH, THRESHOLDS

FALSE_ALARMS = 0.05  # rate that a user who asks for none gets


def threshold(false_alarms: float) -> float:
    """Probability of none below which there is a gap, at a rate of false alarms (interpolated in log odds)."""
    rates, at = np.array(list(THRESHOLDS)), np.array(list(THRESHOLDS.values()))
    odds = np.interp(_log_odds(np.array(false_alarms)), _log_odds(rates), _log_odds(at))
    return float(1.0 / (1.0 + np.exp(-odds)))


def false_alarm_rate(left_out: Array, asked: float) -> dict[str, Any]:
    """The rate that is asked for, what it was on a baseline's own recordings, and what this car is judged at.

    A car whose recordings would be alarms more often than the threshold promises is judged at as much less: the mean
    of a beta distribution, whose prior is the rate that is asked for, worth some recordings of other cars.

    Args:
        left_out: probability of none of each recording, left out in turn [K].
    """
    count, wrong = len(left_out), int(np.count_nonzero(left_out < threshold(asked)))
    expected = (RECORDINGS_WORTH * asked + wrong) / (RECORDINGS_WORTH + count)
    judged = asked * min(asked / expected, 1.0)
    return {"asked": asked, "observed": wrong / count if count else None, "left_out": count, "alarms": wrong,
            "judged_at": judged}  # fmt: skip


def _log_odds(p: np.ndarray) -> np.ndarray:
    p = np.clip(p, 1e-6, 1.0 - 1e-6)
    return np.asarray(np.log(p / (1.0 - p)))
