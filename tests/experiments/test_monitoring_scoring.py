"""Delay, false alarms and isolation, on verdicts made up by hand."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from experiments.monitoring.by_windows import poisson
from experiments.monitoring.comparison import NoDrivesError, read_results
from experiments.monitoring.scoring import named_at, score, table, threshold

T = np.round(np.arange(0.5, 12.05, 0.1), 1)
ONSET = 6.0


def drive(leading: str, probability: float, alarm_at: float, truth: str = "mass_error") -> dict[str, Any]:
    """Verdicts on a drive with a change, of which `leading` is made responsible with a probability."""
    after = alarm_at <= T
    p = np.where(after, probability, 0.0)
    return {
        "t": T, "none": np.where(after, 0.01, 0.99), "leading": [leading] * len(T), "leading_probability": p,
        "true": p if leading == truth else 0.99 * (1.0 - p) * after,
        "truth": {"effect": truth, "onset": ONSET} if truth else {},
    }  # fmt: skip


def test_delay_naming_and_isolation() -> None:
    drives = [
        drive("mass_error", 0.95, 6.5),
        drive("mass_error", 0.6, 7.0),  # right, not sure
        drive("cg_shift", 0.9, 6.5),  # wrong, and sure of it
        drive("cg_shift", 0.5, 10.0),  # found after more than 3 s
        drive("mass_error", 0.0, 99.0),  # not found
    ]
    found = score(drives, "monitor", threshold(drives, "monitor"))
    assert (found.changed, found.detected, found.false_alarms_per_10_minutes) == (5, 0.8, 0.0)
    assert found.delay == pytest.approx(0.75)
    assert (found.isolation, found.isolation_at_end) == (0.4, 0.4)
    assert (found.named, found.named_right, found.naming_delay) == (2, 1, np.inf)
    assert "| 2 of 5 | 2 of 5 | 2, 1 right | - |" in table({"monitor": found})


def test_a_cause_is_named_once_it_has_led_for_five_verdicts() -> None:
    one = drive("mass_error", 0.95, 6.5)
    assert score([one], "monitor", 0.95).naming_delay == pytest.approx(0.9)  # verdicts at 0.5, 0.6, ... 0.9 s
    t, led = np.arange(10.0), np.array(["cg_shift"] * 4 + ["mass_error"] * 6)
    assert named_at(t, led, np.full(10, True)) == (8.0, "mass_error")
    assert named_at(t, led, t != 6.0) == (np.inf, "")  # six verdicts, with a break
    assert named_at(t, np.full(10, "unknown"), np.full(10, True)) == (np.inf, "")  # which takes twenty


def test_the_end_of_a_drive_is_judged_apart() -> None:
    """A cause that is wrong at 3 s and right at the end, and the other way round."""
    late, lost = drive("mass_error", 0.95, 6.5), drive("mass_error", 0.95, 6.5)
    late["leading"] = np.where(T < ONSET + 4.0, "cg_shift", "mass_error")
    lost["leading"] = np.where(T < ONSET + 4.0, "mass_error", "cg_shift")
    found = score([late, lost, drive("mass_error", 0.95, 6.5)], "monitor", 0.95)
    assert (found.isolation, found.isolation_at_end) == (pytest.approx(2 / 3), pytest.approx(2 / 3))
    assert (found.named, found.named_right) == (3, 2)


def test_alarms_before_the_change_are_false_and_apart_by_two_seconds() -> None:
    calm = drive("cg_shift", 0.9, 99.0, truth="")
    calm["none"] = np.where(np.isin(T, [2.0, 2.5, 3.0, 8.0]), 0.01, 0.99)
    found = score([calm, drive("mass_error", 0.9, 3.0)], "monitor", 0.95)
    assert found.false_alarms_per_10_minutes == pytest.approx(10.0 * 3 / ((T[-1] + ONSET) / 60.0))


def test_a_peer_s_threshold_is_what_it_reaches_without_a_change() -> None:
    one = drive("mass_error", 0.9, 6.5) | {"chi_square": np.where(T <= ONSET, 3.0, 9.0)}
    assert threshold([one], "chi_square") == 3.0
    assert score([one], "chi_square", 3.0).detected == 1.0


def test_a_folder_without_drives_is_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(NoDrivesError, match="has no drives of the seeds 5000 to 5001; make them with 'python -m"):
        read_results(tmp_path, "nominal", 5000, 2)


def test_intervals_of_counts_are_those_of_tables() -> None:
    """Garwood 1936, as tabled for radiation counts: of none up to 3.69, of three from 0.62 to 8.77."""
    np.testing.assert_allclose([poisson(0), poisson(3)], [(0.0, 3.69), (0.62, 8.77)], atol=0.005)
