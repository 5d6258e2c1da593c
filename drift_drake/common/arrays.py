"""Arrays of numbers, as annotations name them."""

from typing import Any, TypeVarTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Arrays = TypeVarTuple("Arrays")


def contiguous(*arrays: *Arrays) -> tuple[*Arrays]:
    """The arrays as compiled code takes them: what is strided, or of integers, it would be compiled for anew."""
    found: Any = tuple(np.ascontiguousarray(array, dtype=float) for array in list[Any](arrays))
    return found
