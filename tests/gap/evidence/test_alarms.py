"""The threshold of a gap: it follows the rate that is asked for, and what the car's own recordings say of it."""

import numpy as np
import pytest

from drift_drake.gap.evidence.alarms import false_alarm_rate, threshold
from drift_drake.gap.evidence.constants import RECORDINGS_WORTH


def test_a_threshold_rises_with_the_rate_of_false_alarms():
    at = [threshold(rate) for rate in (0.001, 0.01, 0.03, 0.05, 0.1, 0.2)]
    assert at == sorted(at)
    assert 0.0 < at[0] < at[-1] < 1.0


def test_the_rate_of_false_alarms_is_that_of_the_baselines_own_recordings():
    rate = false_alarm_rate(np.array([0.9, 0.01, 0.8, 0.95]), 0.05)
    assert {key: rate[key] for key in ("asked", "observed", "left_out", "alarms")} == {
        "asked": 0.05, "observed": 0.25, "left_out": 4, "alarms": 1
    }  # fmt: skip
    alone = false_alarm_rate(np.zeros(0), 0.05)
    assert (alone["observed"], alone["judged_at"]) == (None, 0.05)


@pytest.mark.parametrize(("alarms", "recordings"), [(1, 3), (4, 4), (30, 100)])
def test_a_car_whose_recordings_are_alarms_is_judged_at_a_lower_rate(alarms, recordings):
    left_out = np.where(np.arange(recordings) < alarms, 0.1, 0.9)
    expected = (0.05 * RECORDINGS_WORTH + alarms) / (RECORDINGS_WORTH + recordings)
    assert false_alarm_rate(left_out, 0.05)["judged_at"] == pytest.approx(0.05**2 / expected)


def test_a_car_without_an_alarm_is_judged_as_is_asked():
    assert false_alarm_rate(np.full(12, 0.9), 0.05)["judged_at"] == 0.05
