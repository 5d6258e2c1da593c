"""Blocks of sums: nothing is lost, memory is bounded, and no block reaches across the edge of a change."""

import numpy as np
import pytest

from drift_drake.gap.monitoring.evidence import Sums, no_sums
from drift_drake.gap.monitoring.history import SLOTS, no_history, since, until, with_block

N = 3


def block(i: int) -> Sums:
    g = np.random.default_rng(i).normal(size=(4, N))
    return Sums(np.array(4.0), np.array(float(i)), np.array(8.0), g.sum(axis=0), g.T @ g)


def filled(count: int):
    history = no_history(no_sums(N))
    for i in range(count):
        history = with_block(history, block(i), 1.0, 0.0)
    return history


@pytest.mark.parametrize("count", [1, 2, 3, 10, 100, 700])
def test_every_age_holds_the_sum_of_its_blocks(count):
    ages, recent = since(filled(count))
    older = until(filled(count))
    assert np.all(np.diff(ages) > 0.0)
    for i, age in enumerate(ages):
        whole = [block(j) for j in range(count)]
        part = whole[count - int(age) :]
        np.testing.assert_allclose(recent.score[i], sum(b.score for b in part), atol=1e-9)
        np.testing.assert_allclose(recent.information[i], sum(b.information for b in part), atol=1e-9)
        np.testing.assert_allclose(older.score[i] + recent.score[i], sum(b.score for b in whole), atol=1e-9)


def test_memory_is_bounded_and_old_blocks_are_long():
    history = filled(700)
    lengths = history.lengths[history.lengths > 0.0]
    assert len(lengths) <= SLOTS
    assert np.all(np.diff(lengths) >= 0.0)
    assert lengths[0] == 1.0


@pytest.mark.parametrize("edge_at", [3, 50, 333])
def test_no_block_reaches_across_an_edge(edge_at):
    history = filled(edge_at)
    for age in range(1, 600):
        history = with_block(history, block(age), 1.0, float(age - 1))
        if age > 1:  # the first block since is not known to be
            assert float(age) in np.cumsum(history.lengths)
