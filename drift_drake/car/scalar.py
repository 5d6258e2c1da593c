"""Scalar functions with one meaning on floats, arrays, complex numbers, AutoDiffXd, Expression and in compiled code.

The equations of motion are written once with these functions. Drake evaluates them on its own scalar types, NumPy on
batches, and numba compiles the same source, on floats, through the `overload`s below. Complex arguments serve the
complex-step derivative (Squire and Trapp 1998): comparisons look at real parts only.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numba.extending import overload, register_jitable
from numba.np.unsafe.ndarray import to_fixed_tuple
from pydrake.symbolic import Expression, if_then_else

from drift_drake.car.lanes import (
    ELEMENTARY,
    LANES,
    any_there,
    lanes,
    load_lanes,
    load_lanes_tuple,
    select_lanes,
    store_lanes,
)

STANDSTILL = 0.1  # [m/s] below which a car counts as standing

jitable = register_jitable(forceinline=True)
"""Marks a plain Python function as callable from compiled code; the function itself is left as it is.

It is compiled into what calls it, however long it is: the equations take some fifty numbers, which cost as much to hand
over as to compute with, and what the caller does not use of the results is not computed.
"""


def _on_objects(x: Any, ufunc: np.ufunc) -> Any:
    # NumPy takes the bits of an Expression for an invalid number and warns; its own method is the same function.
    return getattr(x, ufunc.__name__)() if isinstance(x, Expression) else ufunc(x)


def _elementary(plain: Callable[[float], float], ufunc: np.ufunc) -> Any:
    """NumPy's function on everything; `plain` on a float."""

    def function(x: Any) -> Any:
        return plain(x) if type(x) is float else _on_objects(x, ufunc)

    in_lanes = ELEMENTARY[plain.__name__]
    overload(function)(lambda x: (lambda x: in_lanes(x)) if x is lanes else (lambda x: ufunc(x)))
    return function


sin = _elementary(math.sin, np.sin)
cos = _elementary(math.cos, np.cos)
sqrt = _elementary(math.sqrt, np.sqrt)
exp = _elementary(math.exp, np.exp)
tanh = _elementary(math.tanh, np.tanh)
atan = _elementary(math.atan, np.arctan)


def select(a: Any, b: Any, if_less: Any, otherwise: Any) -> Any:
    """`if_less` where a < b, else `otherwise`; both branches are evaluated, so both must be finite."""
    if isinstance(a, np.ndarray) or isinstance(b, np.ndarray):
        return np.where(np.real(a) < np.real(b), if_less, otherwise)
    if isinstance(a, Expression) or isinstance(b, Expression):
        return if_then_else(a < b, _expression(if_less), _expression(otherwise))
    if isinstance(a, complex) or isinstance(b, complex):
        return if_less if a.real < b.real else otherwise
    return if_less if a < b else otherwise


def _expression(x: Any) -> Expression:
    return x if isinstance(x, Expression) else Expression(x)


@overload(select)
def _select(a, b, if_less, otherwise):  # type: ignore[no-untyped-def]
    if lanes in (a, b, if_less, otherwise):
        return lambda a, b, if_less, otherwise: select_lanes(a, b, if_less, otherwise)
    return lambda a, b, if_less, otherwise: if_less if a < b else otherwise


def fixed_tuple(values: Any, count: int) -> tuple[Any, ...]:
    """The first `count` numbers of an array as a tuple; compiled code needs `count` as a constant."""
    return tuple(values[:count])


@overload(fixed_tuple)
def _fixed_tuple(values, count):  # type: ignore[no-untyped-def]  # noqa: ARG001 (numba matches signatures)
    return lambda values, count: to_fixed_tuple(values, count)


def loaded_tuple(values: Any, first: int, count: int, like: Any) -> tuple[Any, ...]:
    """`count` numbers of an array from an index on, both constants where compiled; where `like` is LANES numbers, those
    of a flat array of them."""
    if np.ndim(like) == 1 and np.ndim(values) == 1:
        return load_lanes_tuple(values, first, count)
    return tuple(values[first : first + count])


@overload(loaded_tuple, jit_options={"forceinline": True})
def _loaded_tuple(values, first, count, like):  # type: ignore[no-untyped-def]  # noqa: ARG001
    if like is lanes:
        return lambda values, first, count, like: load_lanes_tuple(values, first, count)  # noqa: ARG005
    return lambda values, first, count, like: to_fixed_tuple(values[first:], count)  # noqa: ARG005


def loaded(values: Any, index: Any, like: Any) -> Any:
    """One of what `loaded_tuple` reads; its index need not be a constant."""
    return load_lanes(values, index) if np.ndim(like) == 1 and np.ndim(values) == 1 else values[index]


@overload(loaded, jit_options={"forceinline": True})
def _loaded(values, index, like):  # type: ignore[no-untyped-def]  # noqa: ARG001 (numba matches signatures)
    if like is lanes:
        return lambda values, index, like: load_lanes(values, index)  # noqa: ARG005
    return lambda values, index, like: values[index]  # noqa: ARG005


def length(values: Any, like: Any) -> int:
    """How many there are of what `loaded` reads."""
    return len(values) // LANES if np.ndim(like) == 1 and np.ndim(values) == 1 else len(values)


@overload(length, jit_options={"forceinline": True})
def _length(values, like):  # type: ignore[no-untyped-def]  # noqa: ARG001 (numba matches signatures)
    if like is lanes:
        return lambda values, like: len(values) // LANES  # noqa: ARG005
    return lambda values, like: len(values)  # noqa: ARG005


def stored(values: Any, index: int, value: Any) -> None:
    """Writes one of what `loaded_tuple` reads."""
    if np.ndim(value) == 1 and np.ndim(values) == 1:
        store_lanes(values, index, value)
    else:
        values[index] = value


@overload(stored, jit_options={"forceinline": True})
def _stored(values, index, value):  # type: ignore[no-untyped-def]  # noqa: ARG001 (numba matches signatures)
    if value is lanes:
        return lambda values, index, value: store_lanes(values, index, value)

    def store(values, index, value):  # type: ignore[no-untyped-def]
        values[index] = value

    return store


@jitable
def maximum(a: Any, b: Any) -> Any:
    return select(a, b, b, a)


@jitable
def minimum(a: Any, b: Any) -> Any:
    return select(a, b, a, b)


@jitable
def clip(x: Any, low: Any, high: Any) -> Any:
    """x held within [low, high]."""
    return minimum(maximum(x, low), high)


@jitable
def absolute(x: Any) -> Any:
    """|x|, with the derivative of the branch that x is on."""
    return select(x, 0.0, -x, x)


@jitable
def signed_floor(x: Any, least: Any) -> Any:
    """x, its magnitude at least `least` and its sign kept."""
    return select(x, 0.0, minimum(x, -least), maximum(x, least))


@jitable
def forwards(v: Any) -> Any:
    """1 for a speed [m/s] forwards, -1 for one backwards, between them across a standstill."""
    return clip(v / STANDSTILL, -1.0, 1.0)


@jitable
def norm2(x: Any, y: Any) -> Any:
    """Length of (x, y), smooth at the origin: the 1e-9 keeps the derivative finite there and changes no value."""
    return sqrt(x * x + y * y + 1e-18)


def anywhere(x: Any) -> bool:
    """Whether a number, or one of LANES, differs from zero."""
    return bool(np.any(x))


@overload(anywhere)
def _anywhere(x):  # type: ignore[no-untyped-def]
    return (lambda x: any_there(x)) if x is lanes else (lambda x: x != 0.0)


def switched(factor: Any, function: Any, x: Any) -> Any:
    """factor * function(x), of which compiled code leaves the function out where the factor is zero."""
    return factor * function(x)


@overload(switched)
def _switched(factor, function, x):  # type: ignore[no-untyped-def]  # noqa: ARG001 (numba matches signatures)
    return lambda factor, function, x: factor * function(x) if anywhere(factor) else factor * (0.0 * x)
