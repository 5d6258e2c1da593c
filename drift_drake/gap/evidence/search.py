"""Which change explains scores relative to a baseline: `none`, single effects and pairs, with magnitudes.

A hypothesis puts its effects into the calibrated car, predicts the day's windows anew and asks how normal the scores
of the errors that are left are (`gap.estimation.scores`). Scores are nearly linear in a magnitude, so that a few
predictions, interpolated, find its most likely value.
"""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from drift_drake.car.effects.catalogue import LIMITS
from drift_drake.car.parameters import VehicleParameters
from drift_drake.gap.estimation.baseline import Scatter, scatter_of
from drift_drake.gap.estimation.effort import is_slow
from drift_drake.gap.estimation.normal import Normal
from drift_drake.gap.estimation.prior import at_end, clipped, farther, range_of, tried_first
from drift_drake.gap.estimation.scores import Day, summed, to_first_order
from drift_drake.gap.evidence.hypotheses import FOLLOWING, Hypothesis, concluded, effects_of
from drift_drake.gap.evidence.left_over import LeftOver, left_over

FINE = 24  # interpolated magnitudes between two of the grid
REFINED, ROUNDS = 8, 3  # leading hypotheses whose magnitudes are predicted anew, and how often
SEEDS, PARTNERS, PAIR_STEPS = 3, 4, 4  # singles that pairs are grown from, partners each, Gauss-Newton steps
TINY = 1e-3  # of a unit, for differences
SHARES = (0.0, 0.5, 1.0)  # of stiffness in proportion to the load that are tried
AT_ONCE = 8  # effects whose curves are predicted together
REMOVED = 0.99  # of the mean squared error that an effect must leave, to be said to remove any
CLOSEST = 3  # effects that leave the least errors of all, which are candidates whatever their scores
EXTENSIONS = 2  # of the reach of a leading hypothesis


class Search:
    """Hypotheses of one day, fitted.

    Attributes:
        ranges: of the effects' magnitudes, by name; `singles` widens those whose most likely magnitude is at an end.
        curves: of every single effect, once `singles` has been asked.
        judged: cars with effects that were judged: these, and the day relative to that car (`changed_car`).
        windows: that the day would have if a slow simulator were asked for all.
    """

    def __init__(self, day: Day, normal: Normal, vehicle: VehicleParameters, catalogue: Sequence[str],
                 threads: int = 2) -> None:  # fmt: skip
        self.day, self.normal, self.vehicle = day, normal, vehicle
        self.scatter: Scatter = scatter_of(day, normal)
        self.ranges = {name: range_of(name, vehicle) for name in catalogue}
        self.threads = threads
        self.curves: list[Curve] = []
        self.judged: dict[tuple[str, ...], tuple[Mapping[str, float], Day]] = {}
        self.windows = len(day.errors)

    def on(self, day: Day) -> "Search":
        """The same search, in the same ranges, on other windows."""
        other = Search(day, self.normal, self.vehicle, list(self.ranges), self.threads)
        other.ranges = dict(self.ranges)
        return other

    def scores(self, effects: Mapping[str, float], kept: np.ndarray | None = None) -> np.ndarray:
        """Scores less their normal mean [m] once effects are added, of the blocks that are kept [blocks] (bool)."""
        return self._scores(self.day.errors_with(effects) if effects else self.day.errors, kept)

    def _scores(self, e: np.ndarray, kept: np.ndarray | None = None) -> np.ndarray:
        part = 1.0 if kept is None else float(np.mean(kept))
        return summed(self.day, self.normal, e, kept) - part * self.scatter.mean

    def tried(self, *effects: Mapping[str, float]) -> list[tuple[np.ndarray, float]]:
        """Scores less their normal mean [m] once each of some effects is added, and the mean capped square of the
        errors."""
        found = self.day.errors_with_each(effects, self.threads)
        return [(self._scores(e), float(np.mean(self.normal.squares(e)))) for e in found]

    def nats(self, scores: np.ndarray) -> np.ndarray:
        """Half the squared distance from normal of scores [..., m]."""
        return np.asarray(0.5 * np.einsum("...i,ij,...j->...", scores, self.scatter.inverse, scores))

    def none(self) -> Hypothesis:
        """Nothing has changed."""
        scores = self.scores({})
        nats, rest = float(self.nats(scores)), self.left_over(scores, np.zeros((len(scores), 0)))
        return Hypothesis((), np.zeros(0), np.zeros((0, 0)), nats, -nats, scores=len(scores), left_over=rest,
                          by_factor=self.scatter.log_densities(scores) + nats)  # fmt: skip

    def left_over(self, scores: np.ndarray, slopes: np.ndarray) -> LeftOver:
        """What scores less their normal mean [m] leave over, of magnitudes with slopes [m, k]."""
        return left_over(scores, self.scatter, self.normal.names, slopes)

    def singles(self, progress: Callable[[float], None]) -> list[Hypothesis]:
        """Every single effect with its most likely magnitude, the best refined; best first."""
        at_zero = self.scores({})
        variants = [
            (name, follows) for name in self.ranges for follows in (SHARES if name in FOLLOWING else SHARES[:1])
        ]
        curves = list[Curve]()
        for first in range(0, len(variants), AT_ONCE):
            curves += self._curves(variants[first : first + AT_ONCE], at_zero)
            progress(len(curves) / len(variants))
        ranked = sorted(curves, key=lambda curve: curve.best(self)[1])
        with ThreadPoolExecutor(self.threads) as pool:
            refined = list(pool.map(lambda curve: curve.refined(self), ranked[:REFINED]))
        refined = [follow(self, curve) for curve in refined]
        self.curves = [*refined, *ranked[REFINED:]]
        found = [curve.hypothesis(self) for curve in self.curves]
        best: dict[str, Hypothesis] = {}
        for h in sorted(found, key=lambda h: -h.log_evidence):
            best.setdefault(h.names[0], h)
        return sorted(best.values(), key=lambda h: -h.log_evidence)

    def closest(self) -> list[Hypothesis]:
        """The single effects that leave the least errors, less than none, whatever their scores; after `singles`."""
        without = float(np.mean(self.normal.squares(self.day.errors)))
        curves = [curve for curve in self.curves if curve.least_misfit(self)[0] < without]
        curves = sorted(curves, key=lambda curve: -curve.least_misfit(self)[0])
        best = {curve.name: curve for curve in curves}  # the last of each name
        return [curve.start(self) for curve in list(best.values())[-CLOSEST:]]

    def _curves(self, variants: Sequence[tuple[str, float]], at_zero: np.ndarray) -> list["Curve"]:
        """Of effects, by name and share in proportion to the load, the magnitudes that a search begins with."""
        # A limit of zero is no limit at all.
        curves = [Curve(name, follows, *(([], []) if name in LIMITS else ([0.0], [at_zero])))
                  for name, follows in variants]  # fmt: skip
        first = [self._first(*variant) for variant in variants]
        curves = [curve.with_scores(by_derivatives) for curve, (_, by_derivatives) in zip(curves, first, strict=True)]
        return self._predicted(curves, [some for some, _ in first])

    def _predicted(self, curves: Sequence["Curve"], magnitudes: Sequence[Sequence[float]]) -> list["Curve"]:
        """The curves with magnitudes of each predicted, but those that were."""
        out = list(curves)
        asked = [(i, q) for i, some in enumerate(magnitudes) for q in some if q not in curves[i].misfits]
        found = self.tried(*(out[i].effects(self, q) for i, q in asked))
        for (i, q), one in zip(asked, found, strict=True):
            out[i] = out[i].with_found(q, *one)
        return out

    def complete(self) -> list["Curve"]:
        """The curves of single effects, with what they have by derivatives (`singles`) predicted too."""
        for first in range(0, len(self.curves), AT_ONCE):
            some = self.curves[first : first + AT_ONCE]
            magnitudes = [[q for q in curve.magnitudes if q != 0.0] for curve in some]
            self.curves[first : first + AT_ONCE] = self._predicted(some, magnitudes)
        return self.curves

    def _first(self, name: str, follows: float = 0.0) -> tuple[list[float], dict[float, np.ndarray]]:
        """(magnitudes of an effect that are predicted first, scores [m] by derivatives at those that are not).

        Of two signs the likelier one by derivatives is predicted, and the other one where it removes errors: scores of
        errors that are clipped may mislead. Else the other's scores are those of errors that are linear in it.
        """
        day, few = self.day, is_slow(self.day.constants)
        magnitudes = sorted({float(q) for q in tried_first(self.ranges[name], few)})
        unit = effects_of((name,), np.ones(1), follows, day)
        if not unit.keys() <= set(self.normal.names) or magnitudes[0] > 0.0:
            return magnitudes, {}
        slope = to_first_order(day, self.normal, unit)
        least = [max(q for q in magnitudes if q < 0.0), min(q for q in magnitudes if q > 0.0)]
        there = {q: day.errors + q * slope for q in (magnitudes if few else least)}
        scores = {q: self._scores(e) for q, e in there.items()}
        likeliest = min(there, key=lambda q: float(self.nats(scores[q])))
        squares = {q: float(np.mean(self.normal.squares(e))) for q, e in there.items()}
        closest = min(squares, key=lambda q: squares[q])
        if not few and squares[closest] > REMOVED * float(np.mean(self.normal.squares(day.errors))):
            closest = likeliest
        asked = [q for q in magnitudes if q * likeliest > 0.0 or q * closest > 0.0]
        if few or len(asked) == len(magnitudes):
            return asked, {}
        return asked, {q: scores[q] if q in scores else self._scores(day.errors + q * slope)
                       for q in magnitudes if q not in asked}  # fmt: skip

    def pairs(self, singles: Sequence[Hypothesis], progress: Callable[[float], None]) -> list[Hypothesis]:
        """Pairs grown from the best singles, jointly fitted; best first."""
        names = [h.names[0] for h in singles]
        magnitude = {h.names[0]: float(h.magnitudes[0]) for h in singles}
        slopes = {name: self._slope(name, magnitude[name]) for name in names}
        jobs: dict[tuple[str, str], tuple[Hypothesis, str, float]] = {}
        for seed in singles[:SEEDS]:
            at = self.scores(seed.effects(self.day))
            gains = []
            for name in names:
                if name != seed.names[0]:
                    q, gain = self._partner(name, at, slopes[name])
                    gains.append((gain, name, q))
            for _, name, q in sorted(gains, reverse=True)[:PARTNERS]:
                first, second = sorted((seed.names[0], name))
                jobs.setdefault((first, second), (seed, name, q))
        out = []
        with ThreadPoolExecutor(self.threads) as pool:
            for done, h in enumerate(pool.map(lambda job: self._pair(*job), jobs.values())):
                progress((done + 1) / len(jobs))
                out.append(h)
        return sorted((h for h in out if h is not None), key=lambda h: -h.log_evidence)

    def _slope(self, name: str, single: float) -> np.ndarray:
        """Change of the scores per magnitude of an effect [m], over its most likely one alone."""
        r = self.ranges[name]
        unit = single if abs(single) >= r.least else max(r.least, TINY * r.high)
        return np.asarray((self.scores({name: unit}) - self.scores({})) / unit)

    def _partner(self, name: str, at: np.ndarray, slope: np.ndarray) -> tuple[float, float]:
        """Magnitude that a second effect would have at scores `at`, to first order, and the nats that it gains."""
        curvature = float(slope @ self.scatter.inverse @ slope)
        q = -float(slope @ self.scatter.inverse @ at) / max(curvature, 1e-300)
        q = clipped(q, self.ranges[name])
        return q, float(self.nats(at) - self.nats(at + slope * q))

    def _pair(self, seed: Hypothesis, name: str, start: float) -> Hypothesis | None:
        names = (*seed.names, name)
        order = np.argsort(names)
        follows = seed.follows_load
        q = np.array([float(seed.magnitudes[0]), start])
        s = self.scores(effects_of(names, q, follows, self.day))
        ranges = [self.ranges[n] for n in names]
        highs, slopes = np.array([r.high for r in ranges]), np.zeros((len(s), 2))
        for count in range(PAIR_STEPS):
            if count == 0 or not is_slow(self.day.constants):  # a slow simulator's slopes serve all steps
                steps = np.where(q + 0.05 * highs <= highs, 0.05 * highs, -0.05 * highs)
                moved = self.tried(*(effects_of(names, x, follows, self.day) for x in q + np.diag(steps)))
                slopes = (np.stack([after for after, _ in moved], axis=-1) - s[:, None]) / steps
            hessian = slopes.T @ self.scatter.inverse @ slopes
            if np.min(np.diag(hessian)) <= 0.0:
                return None  # one of the two does nothing here
            step2 = -np.linalg.solve(hessian + 1e-9 * np.diag(np.diag(hessian)), slopes.T @ self.scatter.inverse @ s)
            for share in (1.0, 0.5, 0.2):
                trial = np.array([clipped(float(x), r) for x, r in zip(q + share * step2, ranges, strict=True)])
                after = self.scores(effects_of(names, trial, follows, self.day))
                if self.nats(after) < self.nats(s):
                    break
            else:
                break
            gained = float(self.nats(s) - self.nats(after))
            q, s = trial, after
            if gained < 0.05:
                break
        hessian = slopes.T @ self.scatter.inverse @ slopes
        if not np.all(np.isfinite(hessian)) or np.linalg.cond(hessian) > 1e12:
            return None
        covariance = np.linalg.inv(hessian)
        names, q, covariance = tuple(names[i] for i in order), q[order], covariance[np.ix_(order, order)]
        return concluded(names, q, covariance, float(self.nats(s)), [self.ranges[n] for n in names], follows)


@dataclasses.dataclass(frozen=True)
class Curve:
    """Scores of one effect over its magnitudes, linear in between."""

    name: str
    follows: float
    magnitudes: list[float]  # ascending
    scores: list[np.ndarray]
    misfits: Mapping[float, float] = dataclasses.field(default_factory=dict)  # mean squared errors by magnitude

    def lacks(self, magnitude: float) -> bool:
        """Whether a magnitude has not been predicted yet."""
        return all(abs(magnitude - q) >= 1e-12 for q in (0.0, *self.misfits))

    def effects(self, search: Search, magnitude: float) -> Mapping[str, float]:
        """What the car has in addition."""
        return effects_of((self.name,), np.array([magnitude]), self.follows, search.day)

    def with_point(self, search: Search, magnitude: float) -> "Curve":
        """The curve with one more magnitude predicted."""
        if not self.lacks(magnitude):
            return self
        return self.with_found(magnitude, *search.tried(self.effects(search, magnitude))[0])

    def with_scores(self, scores: Mapping[float, np.ndarray]) -> "Curve":
        """The curve with magnitudes whose scores [m] are known without a prediction."""
        points = sorted({**dict(zip(self.magnitudes, self.scores, strict=True)), **scores}.items())
        return dataclasses.replace(self, magnitudes=[q for q, _ in points], scores=[s for _, s in points])

    def with_found(self, magnitude: float, s: np.ndarray, misfit: float) -> "Curve":
        """The curve with one more magnitude, its scores [m] and mean squared errors."""
        return dataclasses.replace(self.with_scores({magnitude: s}), misfits={**self.misfits, magnitude: misfit})

    def fine(self) -> tuple[np.ndarray, np.ndarray]:
        """Interpolated magnitudes [k] and scores [k, m]."""
        at, s = np.array(self.magnitudes), np.array(self.scores)
        share = np.linspace(0.0, 1.0, FINE)[None, :, None]
        q = (1.0 - share[..., 0]) * at[:-1, None] + share[..., 0] * at[1:, None]
        return q.ravel(), ((1.0 - share) * s[:-1, None] + share * s[1:, None]).reshape(-1, s.shape[1])

    def best(self, search: Search) -> tuple[float, float]:
        """Most likely magnitude that is a gap, and its nats."""
        q, s = self.fine()
        nats = np.where(search.ranges[self.name].allows(q), search.nats(s), np.inf)
        i = int(np.argmin(nats))
        return float(q[i]), float(nats[i])

    def refined(self, search: Search) -> "Curve":
        """The curve predicted anew where it is most likely, until that stays."""
        curve = self
        for _ in range(ROUNDS):
            q, before = curve.best(search)
            curve = curve.with_point(search, q)
            if abs(curve.best(search)[1] - before) < 0.1:
                break
        return curve

    def least_misfit(self, search: Search) -> tuple[float, float]:
        """The least mean squared error of the magnitudes that were tried and are a gap, and that magnitude."""
        there = [(x, q) for q, x in self.misfits.items() if search.ranges[self.name].allows(np.array(q))]
        return min(there, default=(np.inf, 0.0))

    def start(self, search: Search) -> Hypothesis:
        """The hypothesis where the least errors are left: its most likely magnitude, if that is next to there.

        Scores are nearly linear around the calibrated car alone. Where an effect makes errors that are clipped, they
        may look normal far from the true magnitude, and not at it.
        """
        q = self.least_misfit(search)[1]
        i = self.magnitudes.index(q)
        low, high = self.magnitudes[max(i - 1, 0)], self.magnitudes[min(i + 1, len(self.magnitudes) - 1)]
        best = self.best(search)[0]
        return self.hypothesis(search, None if low <= best <= high else clipped(q, search.ranges[self.name]))

    def hypothesis(self, search: Search, magnitude: float | None = None) -> Hypothesis:
        """The single effect at its most likely magnitude, or at another; its variance from the scores' slope there."""
        at = np.array(self.magnitudes)
        if magnitude is None:
            q, nats = self.best(search)
        else:
            there = np.array([np.interp(magnitude, at, s) for s in np.transpose(self.scores)])
            q, nats = magnitude, float(search.nats(there))
        i = int(np.clip(np.searchsorted(at, q), 1, len(at) - 1))
        # Over a stretch of the curve: neighbours that refinement put close together say little of the slope.
        low, high = max(i - 2, 0), min(i + 1, len(at) - 1)
        slope = (self.scores[high] - self.scores[low]) / (at[high] - at[low])
        variance = 1.0 / max(float(slope @ search.scatter.inverse @ slope), 1e-300)
        return concluded((self.name,), np.array([q]), np.array([[variance]]), nats, [search.ranges[self.name]],
                         self.follows)  # fmt: skip


def follow(search: Search, curve: Curve) -> Curve:
    """Predicts a curve farther out while its most likely magnitude is at its end, and widens `search.ranges` so far.

    But for a rate limit, which acts the less there.
    """
    for _ in range(EXTENSIONS if curve.name not in LIMITS else 0):
        r, q = search.ranges[curve.name], curve.best(search)[0]
        wider = farther(curve.name, r, search.vehicle)
        if not at_end(q, r) or wider == r:
            break
        search.ranges[curve.name] = wider
        end = wider.high if q > 0.0 else wider.low
        curve = curve.with_point(search, 0.5 * (q + end)).with_point(search, end).refined(search)
    return curve
