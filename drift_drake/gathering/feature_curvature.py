"""Terms of second derivatives by features, along the tangents d phi / dz of each stage, compiled.

Phi [4, 64] has the features of state i in row i, in that state's place, and D_a [4, 64] likewise their derivatives by
number a of z. A is a matrix [64, 64], the same for all stages, L one of each stage [4, 4].
"""

import numpy as np
from numpy.typing import NDArray

from drift_drake.vehicle.compilation import compiled

Array = NDArray[np.float64]


def bent(tangents: Array, left: Array, matrix: Array) -> Array:
    """tr(L D_a A D_b') [N, 10, 10]; tangents [N, 10, 4, 16], left: L [N, 4, 4], matrix: A; both symmetric."""
    count, directions, states, width = tangents.shape
    found = np.empty((count, directions, directions))
    through = np.empty((count, directions, states, width))
    _through(tangents, left, matrix, through)
    flat = (count, directions, states * width)
    np.matmul(through.reshape(flat), tangents.reshape(flat).swapaxes(1, 2), out=found)
    return found


@compiled
def _through(tangents: Array, left: Array, matrix: Array, out: Array) -> None:
    """What of L D_a A stands where D_b has entries."""
    count, directions, states, width = tangents.shape
    row = np.empty(states * width)
    for n in range(count):
        for a in range(directions):
            here = out[n, a]
            here[:] = 0.0
            for j in range(states):
                row[:] = 0.0
                for f in range(width):
                    factor, through = tangents[n, a, j, f], matrix[j * width + f]
                    for m in range(states * width):
                        row[m] += factor * through[m]
                for i in range(states):
                    for g in range(width):
                        here[i, g] += left[n, i, j] * row[i * width + g]


@compiled
def met(tangents: Array, rows: Array) -> Array:
    """D_a R' [N, 10, 4, 4] of rows R [N, 4, 64]."""
    count, directions, states, width = tangents.shape
    out = np.empty((count, directions, states, states))
    for n in range(count):
        for a in range(directions):
            for i in range(states):
                for j in range(states):
                    total = 0.0
                    for f in range(width):
                        total += tangents[n, a, i, f] * rows[n, j, i * width + f]
                    out[n, a, i, j] = total
    return out


def crossed(first: Array, second: Array) -> Array:
    """tr(F_a S_b) [N, 10, 10] of factors [N, 10, 4, 4]."""
    flat = (*first.shape[:2], -1)
    return first.reshape(flat) @ second.swapaxes(2, 3).reshape(flat).swapaxes(1, 2)
