"""Which estimates are uncertain because the recordings of a calibration ask for different values."""

from collections.abc import Sequence

import numpy as np

MOST = 0.5  # of an estimate's variance, above which the recordings' differences are said to be what makes it uncertain
ALONE = (
    "calibrated on one recording: by how much this car differs from one to the next is not known, but for what varies "
    "on any car (biases, grade, wind, rolling resistance); calibrate on several recordings, of different driving"
)


def differences(
    recordings: Sequence[str], names: Sequence[str], pulled: np.ndarray, between: np.ndarray, total: np.ndarray
) -> list[str]:
    """Sentences on estimates that the recordings disagree about.

    Args:
        recordings: names [K]; names: of the estimates [n]; pulled: by how much each recording pulls the estimates
            (`estimation.recordings.pulls`) [K, n]; between: variances of the estimates from that [n]; total: their
            variances in all [n], in the same units.
    """
    if len(recordings) == 1:
        return [ALONE]
    by_recording: dict[str, list[str]] = {}
    for i, name in enumerate(names):
        if between[i] > MOST * total[i]:
            by_recording.setdefault(recordings[int(np.argmax(np.abs(pulled[:, i])))], []).append(name)
    return [
        f"the recordings ask for different values of {', '.join(parts)}, {recording} the most, which is most of what "
        "makes them uncertain; more recordings of that kind of driving would tell"
        for recording, parts in by_recording.items()
    ]
