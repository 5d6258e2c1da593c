"""Terms of second derivatives by features, along the tangents d phi / dz of each stage, compiled.

Phi [4, 64] has the features of state i in row i, in that state's place, and D_a [4, 64] likewise their derivatives by
number a of z. A is a matrix [64, 64], the same for all stages, L one of each stage [4, 4].
"""

import numpy as np

from drift_drake.arrays import Array
from drift_drake.vehicle.compilation import compiled


def bent(tangents: Array, *terms: tuple[Array, Array]) -> Array:
    """Sum of tr(L D_a A D_b') [N, 10, 10]; tangents [N, 10, 4, 16], terms: (L [N, 4, 4], A), all symmetric."""
    states, width = tangents.shape[2:]
    by_state = np.ascontiguousarray(np.moveaxis(tangents, 2, 0)).reshape(states, -1, width)
    flat = (*tangents.shape[:2], states * width)
    mixed = np.zeros(flat)
    for left, matrix in terms:
        products = by_state @ matrix.reshape(states, width, -1)  # row j of D_a A [4, 10 N, 64]
        _mix(products, left, width, mixed.reshape(-1, states * width))
    found: Array = mixed @ tangents.reshape(flat).swapaxes(1, 2)
    return found


@compiled
def _mix(products: Array, left: Array, width: int, out: Array) -> None:
    """Adds what of L D_a A stands where D_b has entries."""
    states, count = products.shape[0], out.shape[0]
    each = count // left.shape[0]
    for m in range(count):
        factors, row = left[m // each], out[m]
        for j in range(states):
            through = products[j, m]
            for i in range(states):
                factor, first = factors[i, j], i * width
                for g in range(first, first + width):
                    row[g] += factor * through[g]


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
