"""Arrays of numbers, as annotations name them."""

from typing import Any, TypeVarTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Arrays = TypeVarTuple("Arrays")
STILL = 1e-9  # spread of a signal that does not vary


def contiguous(*arrays: *Arrays) -> tuple[*Arrays]:
    """The arrays as compiled code takes them: for what is strided, read only or of integers it is compiled anew."""
    found: Any = tuple(np.require(array, float, ["C", "W"]) for array in list[Any](arrays))
    return found


def correlation(a: Array, b: Array) -> float:
    """Pearson's correlation of two signals [n] of any size; zero where one does not vary or holds no number."""
    if len(a) < 2 or not (np.isfinite(a).all() and np.isfinite(b).all()) or min(np.ptp(a), np.ptp(b)) < STILL:
        return 0.0
    return float(np.corrcoef(*(x / np.max(np.abs(x)) for x in (a, b)))[0, 1])
