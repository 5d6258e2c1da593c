"""What a calibration leaves unknown because its recordings differ: a covariance that is robust to clusters.

Batteries empty, tyres warm up, a sensor is mounted anew, and equations that do not follow the car ask for other
parameters on a circle than in a slalom. Blocks of time within a recording do not show that, whole recordings do: each
counts as one draw (Liang and Zeger 1986).
"""

import numpy as np


def pulls(scores: np.ndarray, blocks: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """By how much each recording pulls the estimate away from that of the others, to first order [K, n].

    Args:
        scores: derivatives of half the squared errors of each recording, at the estimate [K, n]; blocks: of time in
            each [K]; covariance: inverse of the second derivatives of all, prior and all [n, n].
    """
    # What all recordings share is no difference between them: the estimate leaves it, whichever is left out.
    beyond = scores - np.outer(blocks / blocks.sum(), scores.sum(axis=0))
    return np.asarray(-beyond @ covariance)


def covariance_between(pulled: np.ndarray) -> np.ndarray:
    """Covariance [n, n] of an estimate from what each of its recordings pulls it by [K, n]; zero of one recording."""
    count = len(pulled)
    return np.asarray(count / max(count - 1, 1) * pulled.T @ pulled)
