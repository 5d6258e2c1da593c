"""Which driving a calibration knows: windows that are near to one of its own, in all that says how hard they are."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from drift_drake.gap.monitoring.windowed.sums import FEATURES

MOST = 400  # points, evenly chosen
KNOWN = 0.97  # quantile of the distance of a calibration's own windows from its other recordings'
APART = 15  # windows of the only recording that are not near each other, either side
LARGEST = 1e6


class KnownDriving(NamedTuple):
    """The driving of a calibration's windows, in standard deviations of it."""

    points: np.ndarray  # [k, FEATURES]
    size: np.ndarray  # [FEATURES]
    limit: float  # distance beyond which a window is unlike all of them


def familiar_of(driving: Sequence[np.ndarray]) -> KnownDriving:
    """The driving of recordings, each [windows, FEATURES]."""
    whole = np.concatenate(driving)
    size = np.maximum(whole.std(axis=0), 1e-9 + 1e-3 * np.abs(whole).max(axis=0))
    at = np.repeat(np.arange(len(driving)), [len(part) for part in driving])
    order = np.arange(len(whole))
    found = []
    for i in order:
        other = at != at[i] if len(driving) > 1 else np.abs(order - i) > APART
        if np.any(other):
            found.append(np.min(np.linalg.norm((whole[other] - whole[i]) / size, axis=1)))
    limit = float(np.quantile(found, KNOWN)) if found else 1.0
    return KnownDriving(whole[:: max(int(np.ceil(len(whole) / MOST)), 1)], size, max(limit, 1e-3))


def unlike(familiar: KnownDriving, driving: np.ndarray) -> int | None:
    """Index of the feature by which a window's driving [FEATURES] is off the nearest point; None where it is known."""
    off = (familiar.points - driving) / familiar.size
    distances = np.linalg.norm(off, axis=1)
    nearest = int(np.argmin(distances))
    return int(np.argmax(np.abs(off[nearest]))) if distances[nearest] > familiar.limit else None


def harder(index: int) -> str:
    """The feature in words."""
    return FEATURES[index]
