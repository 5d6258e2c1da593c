"""What differs from one recording of a car to the next, and what a calibration on some of them leaves unknown.

Batteries empty, tyres warm up, wind turns, a sensor is aligned anew, and equations that do not follow the car ask for
other parameters on a circle than in a slalom. Blocks of time within a recording do not show that, whole recordings do:
each is one draw (Liang and Zeger 1986). A few recordings show little of it: what is known to vary from recording to
recording (`Effect.varies`) is taken to, by less than a gap; and by how much recordings differ is read off all that the
logs show together, since a few recordings differ in few directions, and the next one will in others.
"""

from collections.abc import Sequence

import numpy as np

from drift_drake.vehicle.catalogue import CATALOGUE
from drift_drake.vehicle.parameters import VehicleParameters

ALIKE = 4.0
"""Recordings that the belief that recordings differ alike in all that logs show is worth, beside those that were seen
(validation days and recordings)."""
SHARE = 0.5  # of the least gap, that an effect's standard deviation from recording to recording is: two are a gap


def everyday(names: Sequence[str], vehicle: VehicleParameters) -> np.ndarray:
    """Standard deviations [n] of effects from one recording to the next, whatever a calibration's recordings show."""
    return np.array([SHARE * CATALOGUE[n].least_for(vehicle) if CATALOGUE[n].varies else 0.0 for n in names])


def pulls(scores: np.ndarray, blocks: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """By how much each recording pulls the estimate away from that of the others, to first order [K, n].

    Args:
        scores: derivatives of half the squared errors of each recording, at the estimate [K, n]; blocks: of time in
            each [K]; covariance: inverse of the second derivatives of all, prior and all [n, n].
    """
    # What all recordings share is no difference between them: the estimate leaves it, whichever is left out.
    beyond = scores - np.outer(blocks / blocks.sum(), scores.sum(axis=0))
    return np.asarray(-beyond @ covariance)


def spread(pulled: np.ndarray) -> np.ndarray:
    """Covariance [n, n] of what single recordings ask for, from what each pulls the estimate by [K, n].

    Of an estimate from all K it is the K-th part. Zero of one recording, which shows none.
    """
    count = len(pulled)
    return np.asarray(count**2 / max(count - 1, 1) * pulled.T @ pulled)


def shrunk(seen: np.ndarray, alone: np.ndarray, information: np.ndarray, count: int, chance: float = 0.0) -> np.ndarray:
    """Covariance [n, n] from recording to recording, towards one that is alike in all directions that the logs show.

    In units of what the logs leave open: as many times that as has been seen over all directions, beyond chance (Ledoit
    and Wolf 2004, with that metric in place of the identity).

    Args:
        seen: of the recordings (`spread`) [n, n]; alone: covariance of the estimate, prior and logs [n, n];
        information: of the logs [n, n], without the prior; count: of the recordings; chance: how many times that would
            be seen of recordings that do not differ.
    """
    shown = alone @ information
    size = max(float(np.trace(np.linalg.solve(alone, seen)) / np.trace(shown)) - chance, 0.0)
    share = ALIKE / (ALIKE + count - 1.0)
    return np.asarray((1.0 - share) * seen + share * size * shown @ alone)
