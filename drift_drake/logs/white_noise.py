"""The level of the white noise on a signal, from the signal alone."""

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
