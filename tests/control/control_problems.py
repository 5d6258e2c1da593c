"""Problems that several tests solve."""

import numpy as np
from numpy.typing import NDArray

from drift_drake.control.ocp import OcpData
from drift_drake.reference.trajectory import Reference

Array = NDArray[np.float64]


def ocp_data(reference: Reference, s: float, horizon: int, error: Array | None = None) -> OcpData:
    """The problem of a car at s [m] of a reference, off it by `error` [6], its command the reference's."""
    window = reference.horizon(s, 0.1, horizon)
    x = reference.state(s) + (np.zeros(6) if error is None else error)
    return OcpData(x, reference.input(s), window.x_ref, window.curvature, window.e_min, window.e_max)
