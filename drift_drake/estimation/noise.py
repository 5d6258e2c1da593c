"""Noise levels of a log's channels, from the log alone."""

import numpy as np

DIFFERENCES = 4  # order of the differences: motion at 100 Hz is smooth to them, white noise is not
CLIP = 4.0  # standard deviations beyond which a difference is the car's jerk, not noise


def white_noise_level(values: np.ndarray) -> float:
    """Standard deviation of the white noise on a smooth signal [n], robust against jumps.

    From the fourth differences: the noise's variance is multiplied by the sum of the squared binomial coefficients
    (70), a smooth motion's fourth difference is far smaller. Differences beyond `CLIP` deviations are left out.
    """
    fourth = np.diff(values, n=DIFFERENCES)
    fourth = fourth - np.median(fourth)
    spread = float(np.median(np.abs(fourth))) / 0.6744897501960817
    kept = fourth[np.abs(fourth) <= CLIP * spread]
    return float(np.sqrt(np.mean(kept**2) / 70.0)) if len(kept) else 0.0


def refined_levels(
    levels: np.ndarray, used: np.ndarray, innovations: np.ndarray, whitening: np.ndarray, most: float = 0.08
) -> np.ndarray:
    """Noise levels [9] corrected by a filter's innovations, by at most a share `most`.

    The residual after the update and the one before it have the measurement noise's variance as covariance
    (Desroziers et al. 2005). Bounded, since a wrong model's innovations would make noise of the gap.

    Args:
        levels: standard deviations that the filter used [9]; used: channels that count [9].
        innovations: whitened [rows, 9]; whitening: the matrices that whitened them [rows, 9, 9].
    """
    before = np.linalg.solve(whitening, innovations[..., None])[..., 0]
    after = np.einsum("kji,kj->ki", whitening, innovations)  # of the noise's variance
    ratio = np.sqrt(np.clip(np.mean(before * after, axis=0), (1.0 - most) ** 2, (1.0 + most) ** 2))
    return np.where(used, levels * ratio, levels)
