"""How far a car's samples are off what a learnt model predicts of them, relative to what it states.

The noise scales of a model are those of the cars that it was trained on. What a car of another structure does beyond
the features is noise to it, of another size and another one in a slide than on a straight. So one factor on all of the
stated noise is learnt from the car's own samples, each predicted by what was believed before it: the inverse-gamma
recursion with a discount (West and Harrison 1997, sections 4.5 and 10.8). A prediction (eq. 7) is then Student's.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import fdtri

from drift_drake.common.arrays import Array
from drift_drake.drive.learnt.features import STATE_COUNT

STANDS_FOR = 5.0  # samples, 0.5 s: the last ones that count. Of 5, 10, 20, 40 and all chosen on eight cars of draw 881
BEFORE = 2.0  # samples that the training is worth


class Noise(NamedTuple):
    """What is believed of the factor on a model's stated variances.

    Examples:
        >>> Noise().after(4.0 * 9.0).factor > 1.0
        True
    """

    degrees: float = BEFORE * STATE_COUNT  # of freedom
    squares: float = BEFORE * STATE_COUNT  # discounted sum of squared Mahalanobis distances

    @property
    def factor(self) -> float:
        """On the stated standard deviations."""
        return float(np.sqrt(self.squares / self.degrees))

    def after(self, squared_distance: float) -> "Noise":
        """After one sample more, so far from what was predicted and stated of it (`posterior.mahalanobis`)."""
        kept = np.exp(-1.0 / STANDS_FOR)
        return Noise(kept * self.degrees + STATE_COUNT, kept * self.squares + squared_distance)

    def squared_radius(self, share: float) -> float:
        """Squared Mahalanobis distance within which a share [-] of samples is predicted to be."""
        return self.factor**2 * STATE_COUNT * float(fdtri(STATE_COUNT, self.degrees, share))


def within(squared_distances: Array, share: float) -> NDArray[np.bool_]:
    """Which samples [n] are within the region that holds a share [-] of them by what those before them taught.

    Args:
        squared_distances: of a drive's samples [n], each by the belief before it (`quality.squared_distances`).
    """
    noise, out = Noise(), np.empty(len(squared_distances), dtype=bool)
    for i, squared in enumerate(squared_distances):
        out[i] = squared <= noise.squared_radius(share)
        noise = noise.after(float(squared))
    return out
