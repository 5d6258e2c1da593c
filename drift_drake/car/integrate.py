"""The classical Runge-Kutta step, of any car: compiled into whatever gives it a car's rates."""

from collections.abc import Callable
from typing import Any

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
