"""From scores to the posterior over what has changed, since when, and by how much.

The summed scores of the rows since an age are normal: their covariance is the information, and what the tolerances of
the car add that the rows before that age have left unknown; their mean is the information times the node's amplitude.
So each node's evidence against no change is an integral over a normal cut at zero, in closed form. A change may come
at any moment with the same hazard, and the oldest age also stands for a gap that was there from the start.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.special import log_ndtr

from drift_drake.car.effects.catalogue import CATALOGUE, LIMITS
from drift_drake.gap.estimation.prior import TWO_SIDED
from drift_drake.gap.evidence.posterior import NONE, UNKNOWN
from drift_drake.gap.monitoring.bank import FORCES, Node

LEVELS = 7  # lengths 1, 2, ..., 64 blocks
LONGEST = 2.0 ** (LEVELS - 1)
KEPT = 3  # of a length: then two of them are joined
SLOTS = 2 * ((KEPT - 1) * LEVELS + 1)  # on both sides of an edge
HAZARD = 1.0 / 600.0  # [1/s] of a change
GAP_AT_START = 0.1  # probability that the simulator lacks something from the first row on
NONE_OF_THE_CATALOGUE = 0.1  # probability that a change is
SHAPE_ERROR = 0.15  # relative error of what an effect does (see `gap.diagnosis.calibrated.posterior`)
AMPLITUDE_OF_UNKNOWN = 1.0  # of each node in an unknown gap, one standard deviation
RIDGE = 1e-3  # of a score's variance: no signature is exact to more than that
RECENT = 1.5  # [s]
TRUSTED = 0.5  # probability of none, from which on the simulator may be believed
ALARM = 0.05  # probability of none, below which a change is reported
NAMED = 0.8  # probability, from which on a cause is
REFUTED = -5.0  # [nats] of an effect against none, below which it has ended


class Sums(NamedTuple):
    """Sums over rows; arrays of them have a leading axis.

    A score is what a row's innovations say of each node's amplitude, information how much they can say: sums of G'nu
    and G'G, with nu the innovations and G the signatures.
    """

    rows: np.ndarray  # that counted
    energy: np.ndarray  # of squared innovations
    freedom: np.ndarray  # number of innovations
    score: np.ndarray  # [n]
    information: np.ndarray  # [n, n]


class History(NamedTuple):
    """Blocks of the last half minute, newest first, the longer the older they are, and what came before them.

    Two blocks of each length 1, 2, 4, ... are kept; of three, the two oldest are joined (Datar et al. 2002). So memory
    is bounded, and a change may have begun at any block's edge.
    """

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


class EvidenceProblem(NamedTuple):
    """What is judged: the nodes, and how the car may be off within its tolerances."""

    nodes: tuple[Node, ...]
    names: tuple[str, ...]  # of the effects
    member: np.ndarray  # [n, effects] 1 where the node is the effect's
    log_prior: np.ndarray  # [n] of each node once something of the catalogue has changed; minus infinity for forces
    mean: np.ndarray  # [n] of the amplitude; likewise
    deviation: np.ndarray  # [n]
    signed: np.ndarray  # [n] bool
    tolerance: np.ndarray  # [n] standard deviation of each node's amplitude within the vehicle file's tolerances
    excess: np.ndarray  # [n, n] covariance of scores beyond white innovations, by roots of information


class Verdict(NamedTuple):
    """The posterior and what goes with its leading effect."""

    probabilities: np.ndarray  # none, the effects in the order of `names`, unknown
    magnitude: float  # of the leading effect
    low: float  # 95 % interval
    high: float
    age: float  # [s] since the change
    edge: float  # [blocks] the most probable of the ages


def evidence_problem(nodes: Sequence[Node], tolerance: np.ndarray) -> EvidenceProblem:
    """The problem of nodes where innovations are white."""
    names = tuple(dict.fromkeys(node.name for node in nodes if node.name not in FORCES))
    member = np.array([[node.name == name for name in names] for node in nodes], dtype=float)
    daily = np.array([CATALOGUE[name].daily for name in names])
    with np.errstate(divide="ignore"):
        log_prior = np.log(member @ (daily / daily.sum() / member.sum(axis=0)))
    mean, deviation, signed = (np.array([getattr(node, key) for node in nodes]) for key in
                               ("mean", "deviation", "signed"))  # fmt: skip
    n = len(nodes)
    return EvidenceProblem(tuple(nodes), names, member, log_prior, mean, deviation, signed, tolerance,
                   np.zeros((n, n)))  # fmt: skip


def residual_scores(problem: EvidenceProblem, recent: Sums, older: Sums) -> tuple[np.ndarray, np.ndarray]:
    """Scores [m, n] less what the tolerances that the older rows show explain, and their covariance [m, n, n]."""
    t = np.flatnonzero(problem.tolerance > 0.0)
    prior = np.diag(1.0 / problem.tolerance[t] ** 2)
    worth = 1.0 / (1.0 + np.diag(problem.excess)[t].mean()) if len(t) else 1.0
    left = np.linalg.inv(prior + worth * older.information[:, t[:, None], t])
    deviations = np.einsum("mij,mj->mi", left, worth * older.score[:, t])
    by = recent.information[:, :, t]
    score = recent.score - np.einsum("mij,mj->mi", by, deviations)
    covariance = recent.information + by @ left @ by.swapaxes(1, 2)
    root = np.sqrt(np.einsum("mii->mi", recent.information))
    covariance = covariance + root[:, :, None] * problem.excess * root[:, None, :]
    at = np.arange(score.shape[1])
    covariance[:, at, at] *= 1.0 + RIDGE
    covariance[:, at, at] += 1e-9
    return score, covariance


def whitened(problem: EvidenceProblem, recent: Sums, older: Sums) -> tuple[np.ndarray, np.ndarray]:
    """Whitened scores w [m, n], and their mean [m, n, n] by amplitudes: w = M a + white noise."""
    score, covariance = residual_scores(problem, recent, older)
    root = np.linalg.cholesky(covariance)
    both = np.linalg.solve(root, np.concatenate([score[:, :, None], recent.information], axis=2))
    return both[:, :, 0], both[:, :, 1:]


def verdict_of(problem: EvidenceProblem, history: History, block: float) -> Verdict:
    """The posterior at the end of a history of blocks of `block` seconds."""
    ages, recent = since(history)
    if not len(ages):
        p = np.zeros(len(problem.names) + 2)
        p[0] = 1.0
        return Verdict(p, np.nan, np.nan, np.nan, np.nan, 0.0)
    w, m = whitened(problem, recent, until(history))
    a, b = np.einsum("mij,mij->mj", m, m), np.einsum("mij,mi->mj", m, w)
    mean, deviation, signed = problem.mean, problem.deviation, problem.signed
    explained = 0.5 * b**2 / np.maximum(a, 1e-12) * (signed | (b > 0.0))
    temper = 1.0 + 2.0 * SHAPE_ERROR**2 * float(np.max(explained)) / len(problem.nodes)
    a, b = a / temper, b / temper
    precision = a + 1.0 / deviation**2
    amplitude = (b + mean / deviation**2) / precision
    log_factor = (
        0.5 * amplitude**2 * precision - 0.5 * (mean / deviation) ** 2 - 0.5 * np.log(precision * deviation**2)
        + np.where(signed, 0.0, log_ndtr(amplitude * np.sqrt(precision)) - log_ndtr(mean / deviation))
    )  # fmt: skip
    unknown = _unknown(m, w, temper)
    spans = np.diff(ages, prepend=0.0) * block
    begun = np.log(HAZARD * spans)
    if not np.any(history.before.rows):
        begun[-1] = np.logaddexp(begun[-1], np.log(GAP_AT_START))
    joint = begun[:, None] + log_factor + problem.log_prior + np.log(1.0 - NONE_OF_THE_CATALOGUE)
    return _verdict(problem, joint, begun + unknown + np.log(NONE_OF_THE_CATALOGUE), amplitude, precision, ages, block)


def _unknown(m: np.ndarray, w: np.ndarray, temper: float) -> np.ndarray:
    """Log evidence [m] of any mixture of all nodes, of either sign, against no change."""
    inner = np.eye(m.shape[2]) + AMPLITUDE_OF_UNKNOWN**2 * m.swapaxes(1, 2) @ m
    root = np.linalg.cholesky(inner)
    projected = np.linalg.solve(root, AMPLITUDE_OF_UNKNOWN * np.einsum("mij,mi->mj", m, w)[:, :, None])[:, :, 0]
    price = np.sum(np.log(np.einsum("mii->mi", root)), axis=1)
    return np.asarray(0.5 * np.sum(projected**2, axis=1) / temper - price)


def _verdict(
    problem: EvidenceProblem, joint: np.ndarray, unknown: np.ndarray, amplitude: np.ndarray, precision: np.ndarray,
    ages: np.ndarray, block: float,
) -> Verdict:  # fmt: skip
    """Marginals of joint log posteriors [m, n] of ages and nodes, of `unknown` [m], against zero for none."""
    top = max(0.0, float(joint.max()), float(unknown.max()))
    weight, other = np.exp(joint - top), np.exp(unknown - top)
    by_effect = weight.sum(axis=0) @ problem.member
    p = np.array([np.exp(-top), *by_effect, other.sum()])
    p /= p.sum()
    leading = int(np.argmax(by_effect))
    if by_effect[leading] == 0.0:  # nothing but unknown counts
        nan = float("nan")
        return Verdict(p, nan, nan, nan, float(other @ ages / other.sum()) * block, float(ages[np.argmax(other)]))
    own = np.flatnonzero(problem.member[:, leading])
    share = weight[:, own] / by_effect[leading]
    nodes = [problem.nodes[i] for i in own]
    q = np.array([[node.magnitude_at(x) for node, x in zip(nodes, row, strict=True)] for row in amplitude[:, own]])
    spread = np.array([node.magnitude for node in nodes]) / np.sqrt(precision[:, own])
    mean = float(np.sum(share * q))
    half = TWO_SIDED * float(np.sqrt(np.sum(share * (spread**2 + (q - mean) ** 2))))
    by_age = share.sum(axis=1) if other.sum() < by_effect[leading] else other / other.sum()
    edge = float(ages[int(np.argmax(by_age))])
    return Verdict(p, mean, mean - half, mean + half, float(by_age @ ages) * block, edge)


def labels(problem: EvidenceProblem) -> tuple[str, ...]:
    """Names of the posterior's entries."""
    return (NONE, *problem.names, UNKNOWN)


def renewed(problem: EvidenceProblem, history: History, verdict: Verdict, block: float) -> tuple[History, Verdict]:
    """The history that counts, and the verdict on it, after a verdict that the car has changed.

    Once the last moments are normal, though the effect that was named would have shown in them, the change is over.
    Where all rows since have no single cause, but the last moments have one, those alone count from then on.
    """
    recent = newest(history, RECENT / block, verdict.edge)
    if not recent.lengths.any() or verdict.edge * block <= RECENT:
        return history, verdict
    now = verdict_of(problem, recent, block)
    unknown = verdict.probabilities[-1] >= verdict.probabilities[1:-1].max()
    if now.probabilities[0] >= TRUSTED and (unknown or _nats(problem, recent, verdict) < REFUTED):
        return recent, now
    if unknown and now.probabilities[1:-1].max() >= NAMED:
        return recent, now
    return history, verdict


def _nats(problem: EvidenceProblem, recent: History, verdict: Verdict) -> float:
    """Log likelihood of the leading effect with its magnitude against none, of a recent history."""
    _, sums = since(recent)
    w, m = (a[-1] for a in whitened(problem, sums, until(recent)))
    out = []
    for i in np.flatnonzero(problem.member[:, int(np.argmax(verdict.probabilities[1:-1]))]):
        node = problem.nodes[i]
        ratio = node.magnitude / verdict.magnitude if node.name in LIMITS else verdict.magnitude / node.magnitude
        if ratio > 0.0 or node.signed:
            out.append(float(ratio * (m[:, i] @ w) - 0.5 * ratio**2 * (m[:, i] @ m[:, i])))
    return max(out, default=0.0)
