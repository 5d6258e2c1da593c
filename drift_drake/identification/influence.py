"""Which recording an estimate hangs on."""

from collections.abc import Sequence

import numpy as np

MOVES = 0.5  # stated standard deviations of an estimate, beyond which a recording's pull is said
SAID = 3  # estimates a recording, the most moved first
ALONE = (
    "calibrated on one recording: by how much this car differs from one to the next is not known, and is taken as "
    "nothing when another day is judged; calibrate on several recordings, of different driving"
)


def influences(
    recordings: Sequence[str], names: Sequence[str], pulled: np.ndarray, deviations: np.ndarray
) -> list[str]:
    """A sentence for each recording without which estimates would be others.

    Args:
        recordings: names [K]; names: of the estimates [n]; pulled: by how much each recording pulls the
            estimates (`estimation.recordings.pulls`) [K, n]; deviations: that are stated of them [n].
    """
    if len(recordings) == 1:
        return [ALONE]
    out = []
    for recording, moved in zip(recordings, pulled, strict=True):
        size = np.abs(moved) / deviations
        first = [i for i in np.argsort(-size)[:SAID] if size[i] > MOVES]
        if first:
            parts = ", ".join(f"{names[i]} ({size[i]:.1f} standard deviations)" for i in first)
            out.append(f"{recording} alone holds the estimate of {parts}: the other recordings ask for another value")
    return out
