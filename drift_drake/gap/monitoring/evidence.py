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
from drift_drake.gap.monitoring.history import History, newest, since, until

HAZARD = 1.0 / 600.0  # [1/s] of a change
GAP_AT_START = 0.1  # probability that the simulator lacks something from the first row on
NONE_OF_THE_CATALOGUE = 0.1  # probability that a change is
SHAPE_ERROR = 0.15  # relative error of what an effect does (see `gap.diagnosis.calibrated.posterior`)
AMPLITUDE_OF_UNKNOWN = 1.0  # of each node in an unknown gap, one standard deviation
RIDGE = 1e-3  # of a score's variance: no signature is exact to more than that
RECENT = 1.5  # [s]
TRUSTED = 0.5  # probability of none, from which on the simulator may be believed
FALSE_ALARMS = 0.3  # an hour, that a user who asks for none gets
NAMED = 0.8  # probability, from which on a cause is


def alarm_at(false_alarms: float) -> float:
    """Probability of none below which a change is reported, at a rate of false alarms [1/h].

    The posterior odds of a change are the hazard times the statistic of Shiryaev and Roberts, the sum over onsets of
    likelihood ratios. Less the time that has passed, that is a martingale while nothing changes, so that a threshold
    of A seconds is not passed more often than once in A seconds in the mean (Pollak 1985).
    """
    return float(1.0 / (1.0 + HAZARD * 3600.0 / false_alarms))


ALARM = alarm_at(FALSE_ALARMS)
REFUTED = -float(np.log(3600.0 / FALSE_ALARMS))  # [nats] of an effect against none, below which it has ended


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


def no_sums(n: int, *leading: int) -> Sums:
    """Zeros."""
    rows, energy, freedom = (np.zeros(leading) for _ in range(3))
    return Sums(rows, energy, freedom, np.zeros((*leading, n)), np.zeros((*leading, n, n)))


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

    @property
    def labels(self) -> tuple[str, ...]:
        """Names of the posterior's entries: none, the effects, unknown."""
        return (NONE, *self.names, UNKNOWN)


class Verdict(NamedTuple):
    """The posterior and what goes with its leading effect."""

    probabilities: np.ndarray  # none, the effects in the order of `names`, unknown
    magnitude: float  # of the leading effect
    low: float  # 95 % interval
    high: float
    age: float  # [s] since the change
    edge: float  # [blocks] the most probable of the ages
    shown: np.ndarray  # [n] standard deviations that an amplitude of one shifts the scores by, at the best of the ages

    def at(self, t: float) -> np.ndarray:
        """As a monitor's state holds it: the probabilities, magnitude and interval, and the time of the change [s]."""
        return np.concatenate([self.probabilities, [self.magnitude, self.low, self.high, t - self.age]])


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


def nothing_seen(problem: EvidenceProblem) -> Verdict:
    """The verdict before there is anything to judge."""
    p = np.zeros(len(problem.names) + 2)
    p[0], nan = 1.0, float("nan")
    return Verdict(p, nan, nan, nan, nan, 0.0, np.zeros(len(problem.nodes)))


def verdict_of(problem: EvidenceProblem, history: History[Sums], block: float) -> Verdict:
    """The posterior at the end of a history of blocks of `block` seconds."""
    ages, recent = since(history)
    if not len(ages):
        return nothing_seen(problem)
    w, m = whitened(problem, recent, until(history))
    begun = np.log(HAZARD * np.diff(ages, prepend=0.0) * block)
    if not np.any(history.before.rows):
        begun[-1] = np.logaddexp(begun[-1], np.log(GAP_AT_START))
    return concluded(problem, w, m, begun, ages, block)


def concluded(
    problem: EvidenceProblem, w: np.ndarray, m: np.ndarray, begun: np.ndarray, ages: np.ndarray, block: float
) -> Verdict:
    """The posterior from whitened scores, whose mean is m times the amplitudes of the nodes.

    Args:
        w, m: of each age [m, s], [m, s, n]; begun: log prior odds that a change began at each age [m]; ages: [blocks].
    """
    b = np.einsum("mij,mi->mj", m, w)
    explained = 0.5 * b**2 / np.maximum(squares(m), 1e-12) * (problem.signed | (b > 0.0))
    temper = 1.0 + 2.0 * SHAPE_ERROR**2 * float(np.max(explained)) / len(problem.nodes)
    log_factor, amplitude, precision = amplitudes(problem, squares(m) / temper, b / temper)
    joint = begun[:, None] + log_factor + problem.log_prior + np.log(1.0 - NONE_OF_THE_CATALOGUE)
    unknown = begun + _unknown(m, w, temper) + np.log(NONE_OF_THE_CATALOGUE)
    found = _verdict(problem, joint, unknown, amplitude, precision, ages, block)
    return found._replace(shown=np.sqrt(np.max(squares(m), axis=0)))


def squares(m: np.ndarray) -> np.ndarray:
    """Squared shifts [m, n] of whitened scores by amplitudes of one [m, s, n]."""
    return np.asarray(np.einsum("mij,mij->mj", m, m))


def amplitudes(problem: EvidenceProblem, a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Log evidence of each node against no change, and its amplitude's mode and precision [m, n].

    Args:
        a, b: curvature and slope of the log likelihood by the amplitude, at zero [m, n].
    """
    mean, deviation = problem.mean, problem.deviation
    precision = a + 1.0 / deviation**2
    amplitude = (b + mean / deviation**2) / precision
    log_factor = (
        0.5 * amplitude**2 * precision - 0.5 * (mean / deviation) ** 2 - 0.5 * np.log(precision * deviation**2)
        + np.where(problem.signed, 0.0, log_ndtr(amplitude * np.sqrt(precision)) - log_ndtr(mean / deviation))
    )  # fmt: skip
    return log_factor, amplitude, precision


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
        age, edge = float(other @ ages / other.sum()) * block, float(ages[np.argmax(other)])
        return Verdict(p, nan, nan, nan, age, edge, np.zeros(0))
    own = np.flatnonzero(problem.member[:, leading])
    share = weight[:, own] / by_effect[leading]
    nodes = [problem.nodes[i] for i in own]
    q = np.array([[node.magnitude_at(x) for node, x in zip(nodes, row, strict=True)] for row in amplitude[:, own]])
    spread = np.array([node.magnitude for node in nodes]) / np.sqrt(precision[:, own])
    mean = float(np.sum(share * q))
    half = TWO_SIDED * float(np.sqrt(np.sum(share * (spread**2 + (q - mean) ** 2))))
    by_age = share.sum(axis=1) if other.sum() < by_effect[leading] else other / other.sum()
    edge = float(ages[int(np.argmax(by_age))])
    return Verdict(p, mean, mean - half, mean + half, float(by_age @ ages) * block, edge, np.zeros(0))


def renewed(
    problem: EvidenceProblem, history: History[Sums], verdict: Verdict, block: float
) -> tuple[History[Sums], Verdict]:
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


def _nats(problem: EvidenceProblem, recent: History[Sums], verdict: Verdict) -> float:
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
