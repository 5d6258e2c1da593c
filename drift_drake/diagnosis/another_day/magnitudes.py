"""Magnitudes of a hypothesis fitted where it stands.

The search takes the scores' derivatives at the calibrated car, for all hypotheses alike. Under a large change that car
is far off: errors are clipped there that are not once the change is put in, and tyres work elsewhere. Derivatives,
clipping and what is normal are therefore taken again at the car with the change, as Gauss and Newton's method does.
"""

import dataclasses
from collections.abc import Mapping

import numpy as np

from drift_drake.diagnosis.another_day.hypotheses import Hypothesis, Search, added_up, effects_of
from drift_drake.diagnosis.shared.ranges import clipped
from drift_drake.estimation.scores import make_day
from drift_drake.estimation.unknowns import added

ROUNDS, STEPS = 2, 2  # cars at which derivatives of the errors are taken, and Gauss-Newton steps from each
SHARES = (1.0, 0.5, 0.2)  # of a step, until one makes the scores more normal
NEAR = 1.0  # standard deviations from a car within which its derivatives serve
STEP = 0.05  # of the reach, for derivatives of the scores
SINGULAR = 1e12  # condition of the second derivatives, beyond which the logs do not show the magnitudes apart


def standing(search: Search, effects: Mapping[str, float]) -> Search:
    """The search with effects put into the car that it starts from."""
    day, normal = search.day, search.normal
    return search.on(make_day(day.runs, day.constants, added(day.own, effects), normal.names, normal.units, normal,
                              search.threads))  # fmt: skip


def refitted(search: Search, h: Hypothesis) -> Hypothesis:
    """The hypothesis with its most likely magnitudes and their covariance; as it is where the logs show neither.

    What it has beside its causes is fitted with them.
    """
    names, count = (*h.names, *h.beside), len(h.names)
    ranges = [search.ranges[name] for name in names]
    q = np.concatenate([h.magnitudes, list(h.beside.values())])
    covariance = np.zeros((0, 0))

    def effects(q: np.ndarray) -> dict[str, float]:
        beside = {name: float(x) for name, x in zip(names[count:], q[count:], strict=True)}
        return added_up(effects_of(names[:count], q[:count], h.follows_load, search.day), beside)

    for _ in range(ROUNDS if names else 0):
        at, began = effects(q), q
        there, without = standing(search, at), {name: -x for name, x in at.items()}

        def scores(q: np.ndarray, there: Search = there, without: Mapping[str, float] = without) -> np.ndarray:
            return there.scores(added_up(effects(q), without))

        s = scores(q)
        for _ in range(STEPS):
            slopes = np.empty((len(s), len(q)))
            for i, r in enumerate(ranges):
                step = STEP * r.high * (-1.0 if q[i] > 0.0 else 1.0)  # towards zero, which is within bounds
                slopes[:, i] = (scores(q + step * (np.arange(len(q)) == i)) - s) / step
            hessian = slopes.T @ there.scatter.inverse @ slopes
            if not np.all(np.isfinite(hessian)) or np.linalg.cond(hessian) > SINGULAR:
                return h
            covariance = np.linalg.inv(hessian)
            step_to = -covariance @ slopes.T @ there.scatter.inverse @ s
            for share in SHARES:
                trial = np.array([clipped(float(x), r) for x, r in zip(q + share * step_to, ranges, strict=True)])
                after = scores(trial)
                if there.nats(after) < there.nats(s):
                    q, s = trial, after
                    break
        if np.all(np.abs(q - began) < NEAR * np.sqrt(np.diag(covariance))):
            break
    beside = {name: float(x) for name, x in zip(names[count:], q[count:], strict=True)}
    return dataclasses.replace(h, magnitudes=q[:count], covariance=covariance[:count, :count], beside=beside)
