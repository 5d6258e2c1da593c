"""Scores and information of the last half minute, in blocks that are the longer the older they are.

A score is what a row's innovations say of each node's amplitude, information how much they can say: sums of G'nu and
G'G, with nu the innovations and G the signatures. Two blocks of each length 1, 2, 4, ... are kept; of three, the two
oldest are joined (Datar et al. 2002). So memory is bounded, and a change may have begun at any block's edge.
"""

from typing import NamedTuple

import numpy as np

LEVELS = 7  # lengths 1, 2, ..., 64 blocks
LONGEST = 2.0 ** (LEVELS - 1)
KEPT = 3  # of a length: then two of them are joined
SLOTS = 2 * ((KEPT - 1) * LEVELS + 1)  # on both sides of an edge


class Sums(NamedTuple):
    """Sums over rows; arrays of them have a leading axis."""

    rows: np.ndarray  # that counted
    energy: np.ndarray  # of squared innovations
    freedom: np.ndarray  # number of innovations
    score: np.ndarray  # [n]
    information: np.ndarray  # [n, n]


class History(NamedTuple):
    """Blocks newest first, and what came before them."""

    lengths: np.ndarray  # [SLOTS] in blocks, 0 where there is none
    blocks: Sums  # [SLOTS, ...]
    before: Sums  # of all that is older


def no_sums(n: int, *leading: int) -> Sums:
    """Zeros."""
    rows, energy, freedom = (np.zeros(leading) for _ in range(3))
    return Sums(rows, energy, freedom, np.zeros((*leading, n)), np.zeros((*leading, n, n)))


def no_history(n: int) -> History:
    """Nothing yet, of n nodes."""
    return History(np.zeros(SLOTS), no_sums(n, SLOTS), no_sums(n))


def with_block(history: History, block: Sums, forgetting: float, edge: float) -> History:
    """The history after one more block.

    Args:
        forgetting: factor on what came before, when a block joins it;
        edge: age [blocks] before this block since which the car is another one; no block reaches across it, and none
            joins what came before. 0: it is the same.
    """
    kept = history.lengths[history.lengths > 0.0]
    lengths = [1.0, *kept]
    blocks = [block, *(Sums(*(a[i] for a in history.blocks)) for i in range(len(kept)))]
    before = history.before
    newer = 1 + int(np.count_nonzero(np.cumsum(kept) <= edge + 0.5)) if edge > 0.0 else len(lengths)
    _joined(lengths, blocks, newer)
    if edge == 0.0 and np.count_nonzero(np.array(lengths) >= LONGEST) >= KEPT:
        lengths.pop()
        before = Sums(*(forgetting * a + b for a, b in zip(before, blocks.pop(), strict=True)))
    return History(_filled(lengths), _stacked(blocks, history.blocks), before)


def _joined(lengths: list[float], blocks: list[Sums], newer: int) -> None:
    """Joins, in place, the two oldest neighbours of a length of which there are too many, among the `newer` first.

    The longest ones are joined only where the slots would run out.
    """
    length = 1.0
    while length < LONGEST or len(lengths) > SLOTS:
        same = [i for i in range(newer) if lengths[i] == length or (lengths[i] > length >= LONGEST)]
        pairs = [i for i in same if i + 1 in same]
        if len(same) >= KEPT and pairs:
            first = pairs[-1]
            blocks[first] = Sums(*(a + b for a, b in zip(blocks[first], blocks.pop(first + 1), strict=True)))
            lengths[first] += lengths.pop(first + 1)
            newer -= 1
        elif length >= LONGEST:
            break
        length = min(2.0 * length, LONGEST)


def newest(history: History, blocks: float, edge: float) -> History:
    """The history with only so many of its last blocks (whole slots); what is older than the edge came before them.

    What lies between is left out: there the car was another one.
    """
    ages = np.cumsum(history.lengths)
    there = history.lengths > 0.0
    count = int(np.count_nonzero(there & (ages <= blocks)))
    old = there & (ages > edge + 0.5)
    before = Sums(*(b + a[old].sum(axis=0) for b, a in zip(history.before, history.blocks, strict=True)))
    sums = [Sums(*(a[i] for a in history.blocks)) for i in range(count)]
    lengths = [float(length) for length in history.lengths[:count]]
    return History(_filled(lengths), _stacked(sums, history.blocks), before)


def since(history: History) -> tuple[np.ndarray, Sums]:
    """Ages [m] in blocks, and the sums from each until now [m, ...], youngest first."""
    count = int(np.count_nonzero(history.lengths))
    return np.cumsum(history.lengths[:count]), Sums(*(np.cumsum(a[:count], axis=0) for a in history.blocks))


def until(history: History) -> Sums:
    """The sums of all that is older than each of those ages [m, ...]."""
    _, sums = since(history)
    return Sums(*(before + a[-1] - a for before, a in zip(history.before, sums, strict=True)))


def _filled(lengths: list[float]) -> np.ndarray:
    return np.array([*lengths, *([0.0] * (SLOTS - len(lengths)))])


def _stacked(blocks: list[Sums], like: Sums) -> Sums:
    out = Sums(*(np.zeros_like(a) for a in like))
    for i, block in enumerate(blocks):
        for a, b in zip(out, block, strict=True):
            a[i] = b
    return out


def packed(history: History) -> np.ndarray:
    """All numbers in one vector, of each symmetric matrix its lower half."""
    lower = np.tril_indices(history.before.score.size)
    parts = [history.lengths]
    for sums in (history.blocks, history.before):
        parts += [*(a.ravel() for a in sums[:4]), sums.information[..., lower[0], lower[1]].ravel()]
    return np.concatenate(parts)


def unpacked(vector: np.ndarray, n: int) -> History:
    """The inverse of `packed`."""
    lower, at = np.tril_indices(n), SLOTS
    found = []
    for leading in ((SLOTS,), ()):
        count, parts = int(np.prod(leading)), []
        for shape in ((), (), (), (n,), (n * (n + 1) // 2,)):
            size = int(np.prod(shape))
            parts.append(vector[at : at + count * size].reshape((*leading, *shape)))
            at += count * size
        information = np.zeros((*leading, n, n))
        information[..., lower[0], lower[1]] = parts[4]
        information[..., lower[1], lower[0]] = parts[4]
        found.append(Sums(parts[0], parts[1], parts[2], parts[3], information))
    return History(vector[:SLOTS], *found)
