"""A drive's sums in blocks of time, the longer the older they are; a change may have begun at any block's edge."""

from collections.abc import Callable
from typing import Generic, NamedTuple, TypeVar

import numpy as np

LEVELS = 7  # lengths 1, 2, ..., 64 blocks
LONGEST = 2.0 ** (LEVELS - 1)
KEPT = 3  # of a length: then two of them are joined
SLOTS = 2 * ((KEPT - 1) * LEVELS + 1)  # on both sides of an edge

S = TypeVar("S", bound=tuple[np.ndarray, ...])
"""Sums over rows or windows, a named tuple of arrays; arrays of them have a leading axis."""


def of_parts(one: S, *others: S, by: Callable[..., np.ndarray]) -> S:
    """Sums made part by part of one or more of them."""
    return type(one)(*(by(*parts) for parts in zip(one, *others, strict=True)))


class History(NamedTuple, Generic[S]):
    """Blocks of the last half minute, newest first, the longer the older they are, and what came before them.

    Two blocks of each length 1, 2, 4, ... are kept; of three, the two oldest are joined (Datar et al. 2002). So memory
    is bounded, and a change may have begun at any block's edge.
    """

    lengths: np.ndarray  # [SLOTS] in blocks, 0 where there is none
    blocks: S  # [SLOTS, ...]
    before: S  # of all that is older


def no_history(nothing: S) -> History[S]:
    """Nothing yet; nothing: sums that are zero."""
    return History(np.zeros(SLOTS), _stacked([], nothing), nothing)


def with_block(history: History[S], block: S, forgetting: float, edge: float) -> History[S]:
    """The history after one more block.

    Args:
        forgetting: factor on what came before, when a block joins it;
        edge: age [blocks] before this block since which the car is another one; no block reaches across it, and none
            joins what came before. 0: it is the same.
    """
    kept = history.lengths[history.lengths > 0.0]
    lengths = [1.0, *kept]
    blocks = [block, *(_at(history, i) for i in range(len(kept)))]
    before = history.before
    newer = 1 + int(np.count_nonzero(np.cumsum(kept) <= edge + 0.5)) if edge > 0.0 else len(lengths)
    _joined(lengths, blocks, newer)
    if edge == 0.0 and np.count_nonzero(np.array(lengths) >= LONGEST) >= KEPT:
        lengths.pop()
        before = of_parts(before, blocks.pop(), by=lambda a, b: forgetting * a + b)
    return History(_filled(lengths), _stacked(blocks, before), before)


def _joined(lengths: list[float], blocks: list[S], newer: int) -> None:
    """Joins, in place, the two oldest neighbours of a length of which there are too many, among the `newer` first.

    The longest ones are joined only where the slots would run out.
    """
    length = 1.0
    while length < LONGEST or len(lengths) > SLOTS:
        same = [i for i in range(newer) if lengths[i] == length or (lengths[i] > length >= LONGEST)]
        pairs = [i for i in same if i + 1 in same]
        if len(same) >= KEPT and pairs:
            first = pairs[-1]
            blocks[first] = of_parts(blocks[first], blocks.pop(first + 1), by=np.add)
            lengths[first] += lengths.pop(first + 1)
            newer -= 1
        elif length >= LONGEST:
            break
        length = min(2.0 * length, LONGEST)


def newest(history: History[S], blocks: float, edge: float) -> History[S]:
    """The history with only so many of its last blocks (whole slots); what is older than the edge came before them.

    What lies between is left out: there the car was another one.
    """
    ages = np.cumsum(history.lengths)
    there = history.lengths > 0.0
    count = int(np.count_nonzero(there & (ages <= blocks)))
    before = older_than(history, edge)
    lengths = [float(length) for length in history.lengths[:count]]
    return History(_filled(lengths), _stacked([_at(history, i) for i in range(count)], before), before)


def since(history: History[S]) -> tuple[np.ndarray, S]:
    """Ages [m] in blocks, and the sums from each until now [m, ...], youngest first."""
    count = int(np.count_nonzero(history.lengths))
    return np.cumsum(history.lengths[:count]), of_parts(history.blocks, by=lambda a: np.cumsum(a[:count], axis=0))


def until(history: History[S]) -> S:
    """The sums of all that is older than each of those ages [m, ...]."""
    _, sums = since(history)
    return of_parts(history.before, sums, by=lambda before, a: before + a[-1] - a)


def older_than(history: History[S], edge: float) -> S:
    """The sums of all that is older than an edge [blocks]."""
    old = (history.lengths > 0.0) & (np.cumsum(history.lengths) > edge + 0.5)
    return of_parts(history.before, history.blocks, by=lambda before, a: before + a[old].sum(axis=0))


def _filled(lengths: list[float]) -> np.ndarray:
    return np.array([*lengths, *([0.0] * (SLOTS - len(lengths)))])


def _at(history: History[S], i: int) -> S:
    return of_parts(history.blocks, by=lambda a: a[i])


def _stacked(blocks: list[S], like: S) -> S:
    """Blocks in their slots; like: sums without a leading axis."""
    out = of_parts(like, by=lambda a: np.zeros((SLOTS, *a.shape)))
    for i, block in enumerate(blocks):
        for a, b in zip(out, block, strict=True):
            a[i] = b
    return out
