"""Noise levels of a log's channels, from a filter's innovations."""

import numpy as np

MOST = 0.08  # share by which a level is corrected


def refined_levels(levels: np.ndarray, used: np.ndarray, innovations: np.ndarray, whitening: np.ndarray) -> np.ndarray:
    """Noise levels [9] corrected by a filter's innovations, by at most a share `MOST`.

    The residual after the update and the one before it have the measurement noise's variance as covariance
    (Desroziers et al. 2005). Bounded, since a wrong model's innovations would make noise of the gap.

    Args:
        levels: standard deviations that the filter used [9]; used: channels that count [9].
        innovations: whitened [rows, 9]; whitening: the matrices that whitened them [rows, 9, 9].
    """
    before = np.linalg.solve(whitening, innovations[..., None])[..., 0]
    after = np.einsum("kji,kj->ki", whitening, innovations)  # of the noise's variance
    ratio = np.sqrt(np.clip(np.mean(before * after, axis=0), (1.0 - MOST) ** 2, (1.0 + MOST) ** 2))
    return np.where(used, levels * ratio, levels)
