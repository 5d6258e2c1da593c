"""Which effects could be mistaken for the one that is named: they do almost the same on the rows since the change.

What an effect does is known to a share of it alone, less so on a car that the equations do not follow. Two effects
whose whitened signatures differ by less than that, whatever their magnitudes, are one group to the monitor, however
probable the equations make one of the two.
"""

import numpy as np

from drift_drake.monitoring.evidence import EvidenceProblem, whitened
from drift_drake.monitoring.history import History, Sums, since, until

APART = 0.3  # relative difference of two signatures below which they are one group


def mistakable(problem: EvidenceProblem, history: History, edge: float, name: str) -> tuple[str, ...]:
    """The effects in one group with the effect `name`, which leads; itself left out.

    Args:
        edge: age [blocks] of the change.
    """
    ages, recent = since(history)
    if name not in problem.names or not len(ages):
        return ()
    i = int(np.argmin(np.abs(ages - edge)))
    w, m = (a[0] for a in whitened(problem, *(Sums(*(a[i : i + 1] for a in s)) for s in (recent, until(history)))))
    unit = m / np.maximum(np.linalg.norm(m, axis=0), 1e-12)
    own = np.flatnonzero(problem.member[:, problem.names.index(name)])
    fits = unit.T @ w
    leading = own[np.argmax(np.where(problem.signed[own], np.abs(fits[own]), fits[own]))]
    sign = np.sign(fits[leading]) if problem.signed[leading] else 1.0
    cosine = sign * (unit.T @ unit[:, leading])
    like = np.where(problem.signed, np.abs(cosine), cosine) >= np.sqrt(1.0 - APART**2)
    return tuple(n for j, n in enumerate(problem.names) if n != name and np.any(like & (problem.member[:, j] > 0.0)))
