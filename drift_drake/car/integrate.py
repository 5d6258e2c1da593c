"""The classical Runge-Kutta step, of any car: compiled into whatever gives it a car's rates."""

from collections.abc import Callable
from typing import Any

import numpy as np

from drift_drake.car.lanes import LANES, load_lanes
from drift_drake.car.scalar import jitable


@jitable
def runge_kutta(rates: Callable[..., Any], x: Any, begin: Any, middle: Any, end: Any, h: Any, car: Any, k: Any,
                work: Any) -> None:  # fmt: skip
    """Advances x [n] by h [s], in place, on floats or complex numbers.

    The rates are called in one place, so that long ones are compiled in once. Sensitivities are states like others:
    x may be a matrix's flat view.

    Args:
        rates: `rates(x, command, car, out)` writes the rates of x to out, and may write more behind them.
        begin, middle, end: the command there, tuples of one type.
        car: handed to the rates.
        k, work: scratch, of as many numbers as the rates write, and [2, n].
    """
    for stage in range(4):
        command = begin if stage == 0 else (end if stage == 3 else middle)
        node = 0.0 if stage == 0 else (1.0 if stage == 3 else 0.5)
        for i in range(x.size):
            work[0, i] = x[i] if stage == 0 else x[i] + node * h * k[i]
        rates(work[0], command, car, k)
        weight = 1.0 if stage in (0, 3) else 2.0
        for i in range(x.size):
            work[1, i] = k[i] if stage == 0 else work[1, i] + weight * k[i]
    for i in range(x.size):
        x[i] += h / 6.0 * work[1, i]


@jitable
def ramp(u: Any, u_next: Any, share: Any) -> Any:
    """The command at a share of its way from u to u_next [2]."""
    return u[0] + share * (u_next[0] - u[0]), u[1] + share * (u_next[1] - u[1])


@jitable
def _gathered(values: Any, first: Any, out: Any) -> None:
    """Rows [N, n] from `first` on as lanes [n * LANES]; behind the last row it again."""
    for lane in range(LANES):
        row = values[min(first + lane, len(values) - 1)]
        for i in range(values.shape[1]):
            out[i * LANES + lane] = row[i]


@jitable
def paths(rates: Callable[..., Any], x: Any, u: Any, u_next: Any, curvature: Any, car: Any, dt: float, every: int,
          path: Any) -> None:  # fmt: skip
    """Steps of N cars, `LANES` of them at once, under inputs that go linearly from u to u_next in a time dt [s].

    Args:
        rates: as of `runge_kutta`, on `lanes`, its car what `curvature` has (`lanes.load_lanes`) and what `car` holds.
        x: [N, n]; u, u_next: [N, 2]; curvature: of the path [N] [1/m], or this and its heading [N, 2].
        car: a pair. every: sub-steps from one state that is written to the next.
        path: [K, N, n], written: the states after each K-th of dt.
    """
    size, substeps = x.shape[1], every * len(path)
    z, work, inputs = np.empty(size * LANES), np.empty((3, size * LANES)), np.empty((3, 2 * LANES))
    for first in range(0, len(x), LANES):
        _gathered(x, first, z)
        _gathered(u, first, inputs[0])
        _gathered(u_next, first, inputs[1])
        _gathered(curvature.reshape(len(x), -1), first, inputs[2])
        start = load_lanes(inputs[0], 0), load_lanes(inputs[0], 1)
        end = load_lanes(inputs[1], 0), load_lanes(inputs[1], 1)
        here = inputs[2], car[0], car[1]
        for sub in range(substeps):
            shares = sub / substeps, (sub + 0.5) / substeps, (sub + 1.0) / substeps
            runge_kutta(rates, z, ramp(start, end, shares[0]), ramp(start, end, shares[1]), ramp(start, end, shares[2]),
                        dt / substeps, here, work[2], work[:2])  # fmt: skip
            if (sub + 1) % every == 0:
                for n in range(first, min(first + LANES, len(x))):
                    for i in range(size):
                        path[sub // every, n, i] = z[i * LANES + n - first]
