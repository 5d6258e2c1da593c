"""What the logs do not identify: directions of the unknowns whose posterior is not much narrower than the prior."""

import dataclasses
from collections.abc import Sequence

import numpy as np

LEFT = 0.5  # of the prior's standard deviation that is left
PART = 0.3  # of a direction's length that a parameter must hold to be named
SIMILAR = 0.95  # correlation beyond which two parameters are told only together


@dataclasses.dataclass(frozen=True)
class Direction:
    """A combination of parameters, in standard deviations of their priors, and the share of it that is left."""

    parts: dict[str, float]
    left: float

    def sentence(self) -> str:
        """The direction in words."""
        if len(self.parts) == 1:
            return f"{next(iter(self.parts))} ({100 * self.left:.0f} % of the prior's width is left)"
        sides = [" with ".join(name for name, q in self.parts.items() if q * sign > 0.0) for sign in (1.0, -1.0)]
        return f"{' against '.join(filter(None, sides))} ({100 * self.left:.0f} % of the priors' width is left)"


def not_identified(names: Sequence[str], prior: np.ndarray, covariance: np.ndarray) -> list[Direction]:
    """Combinations that stay as they were believed, the worst first.

    Args:
        prior: standard deviations [n]; covariance: of the posterior [n, n].
    """
    left, directions = np.linalg.eigh(covariance / np.outer(prior, prior))
    out = []
    for i in np.argsort(-left):
        if np.sqrt(max(left[i], 0.0)) <= LEFT:
            break
        v = directions[:, i] * np.sign(directions[np.argmax(np.abs(directions[:, i])), i])
        order = np.argsort(-np.abs(v))
        parts = {names[j]: float(v[j]) for j in order if abs(v[j]) > PART}
        out.append(Direction(parts, min(float(np.sqrt(left[i])), 1.0)))
    return out


def tied(names: Sequence[str], correlation: np.ndarray) -> list[tuple[str, str, float]]:
    """Pairs of parameters that are identified only together, the closest first."""
    pairs = [
        (names[i], names[j], float(correlation[i, j]))
        for i in range(len(names))
        for j in range(i)
        if abs(correlation[i, j]) > SIMILAR
    ]
    return sorted(pairs, key=lambda pair: -abs(pair[2]))
