"""Steady turns of recordings: what is counted, and where."""

import numpy as np
import pytest

from drift_drake.car.log.table import Run
from experiments.other_worlds.hand_changes import NoDataError
from experiments.real.steady_turns import recordings, steady_turns, table


def turning(r, torque, v=0.7, seconds=8.0):
    """A run that turns with a constant yaw rate, at a constant speed."""
    t = np.arange(0.0, seconds, 0.02)
    full = np.ones(len(t))
    return Run(name="turning", t=t, delta_cmd=0.3 * full, tau_cmd=torque * full, r=r * full, v=v * full)


def test_torque_is_stated_by_direction_and_speed():
    (left,) = steady_turns(turning(1.3, 0.04))
    assert (left["turn"], left["speed_from"], left["speed_to"]) == ("left", 0.6, 0.8)
    assert left["torque"] == pytest.approx(0.04)
    assert left["yaw_rate"] == pytest.approx(1.3)
    assert left["seconds"] == pytest.approx(7.0, abs=0.1)  # one is averaged over
    (right,) = steady_turns(turning(-1.3, 0.05, v=1.6))
    assert (right["turn"], right["speed_from"]) == ("right", 1.5)
    assert "| a | right | 1.5 to 1.8 | 7 | 0.0500 (0.0500 to 0.0500) | 1.30 |" in table({"a": [right]})


def test_straight_or_accelerating_rows_do_not_count():
    assert steady_turns(turning(0.1, 0.04)) == []
    run = turning(1.3, 0.04)
    run.v[:] = 0.6 + 0.4 * run.t
    assert steady_turns(run) == []
    assert steady_turns(turning(1.3, 0.04, seconds=3.0)) == []


def test_a_folder_without_recordings_is_refused(tmp_path):
    with pytest.raises(NoDataError, match="has no recordings"):
        recordings(tmp_path)
