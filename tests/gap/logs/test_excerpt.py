"""Which part of a long recording its columns are compared by."""

import math

import numpy as np
import pandas as pd
import pytest

from drift_drake.gap.logs.importing.excerpt import excerpt
from drift_drake.gap.logs.importing.formats.topics import Topic

T = np.arange(0.0, 900.0, 0.1)
DRIVEN = (T > 400.0) & (T < 600.0)  # [s]; it stands before and after


def topic(start=50.0, **columns):
    noise = 0.01 * np.random.default_rng(0).normal(size=len(T))
    return Topic("", pd.DataFrame({"time": T + start, "v": np.where(DRIVEN, 10.0 + np.sin(T), 0.0) + noise, **columns}))


def test_the_part_in_which_most_moves():
    table = topic()
    found = excerpt([table], 100.0)
    assert found.start >= 390.0
    assert found.end <= 610.0
    assert found.end - found.start == pytest.approx(100.0)
    rows = found.topics[0].table
    assert rows["time"].iloc[0] == pytest.approx(50.0 + found.start, abs=0.11)
    assert len(rows) == pytest.approx(1000, abs=2)
    assert table.table["time"][found.topics[0].first_line - 2] == rows["time"].iloc[0]  # messages name the file's lines
    assert found.own == (0.0, math.inf)


def test_within_what_a_day_keeps():
    assert excerpt([topic()], 100.0, 650.0, 700.0)[1:3] == (650.0, 700.0)
    late = excerpt([topic()], 100.0, 0.0, 450.0)
    assert late.end <= 450.0
    assert late.start >= 340.0


def test_topics_of_one_clock_are_cut_at_the_same_time_and_others_after_their_own_start():
    same, other = topic(start=70.0), topic(start=1e6)
    found = excerpt([topic(), same, other], 100.0)
    firsts = [one.table["time"].iloc[0] for one in found.topics]
    assert firsts[0] == pytest.approx(firsts[1], abs=0.11)
    assert firsts[2] - 1e6 == pytest.approx(firsts[0] - 50.0, abs=0.11)


def test_a_recording_that_is_short_or_has_no_clock_stays_whole():
    table = topic()
    whole = excerpt([table], 1000.0)
    assert whole.topics == [table]
    assert whole.own == (0.0, math.inf)
    clockless = Topic("", pd.DataFrame({"a": np.sin(T), "b": np.cos(T)}))
    first = excerpt([clockless], 100.0, 20.0)
    assert first.topics == [clockless]
    assert first.own == (20.0, 120.0)
