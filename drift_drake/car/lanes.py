"""Eight numbers at once: what compiled code computes a car's equations with on a vector register.

A sensitivity or a calibration predicts thousands of short windows by the same equations. Elementary functions of one
number are most of what that costs; on a register of numbers they are polynomials, at about the cost of one. They
agree with those of one number to a few units in the last place. `car.scalar` takes these functions where a
number is `LANES` of them.
"""

import math
import operator
from collections.abc import Callable
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils, errors
from numba.core.typing.templates import ConcreteTemplate, infer_global, signature
from numba.extending import intrinsic, lower_builtin, models, overload, register_model

LANES = 8
DOUBLES = ir.VectorType(ir.DoubleType(), LANES)
WHOLE = ir.VectorType(ir.IntType(64), LANES)
ROUNDING = 1.5 * 2.0**52  # added and taken off again it leaves a whole number
PI_HIGH, LN2_HIGH = round(math.pi * 2.0**30) / 2.0**30, round(math.log(2.0) * 2.0**30) / 2.0**30
PI_LOW, LN2_LOW = math.pi - PI_HIGH + 1.2246467991473532e-16, math.log(2.0) - LN2_HIGH + 2.3190468138462996e-17
LARGEST_EXPONENT = 700.0
NARROW, WIDE = math.sqrt(2.0) - 1.0, math.sqrt(2.0) + 1.0  # tan(pi/8), tan(3 pi/8)


def _fitted(function: Callable[[np.ndarray], np.ndarray], largest: float, degree: int) -> list[float]:
    """Coefficients of a polynomial on [0, largest], at the zeros of Chebyshev's, that rounding alone is off by."""
    fit = np.polynomial.Chebyshev.interpolate(function, degree, domain=[0.0, largest])
    return [float(c) for c in fit.convert(kind=np.polynomial.Polynomial).coef]


SIN = _fitted(lambda z: np.sinc(np.sqrt(z) / np.pi), 0.25 * np.pi**2, 8)  # sin(x) / x of x^2
ATAN = _fitted(lambda z: np.arctan(np.sqrt(z)) / np.sqrt(z), NARROW**2, 11)  # atan(x) / x of x^2
EXP = [1.0 / math.factorial(k) for k in range(13)]  # of |x| up to ln(2) / 2


class Lanes(types.Type):
    """The type of LANES numbers in compiled code."""

    def __init__(self) -> None:
        super().__init__(name="Lanes")


lanes = Lanes()


@register_model(Lanes)
class _Model(models.PrimitiveModel):
    def __init__(self, manager: Any, of: Any) -> None:
        super().__init__(manager, of, DOUBLES)


def _vector(builder: Any, value: Any) -> Any:
    """A value as a vector: a number is every lane's."""
    if value.type == DOUBLES:
        return value
    one = builder.insert_element(ir.Constant(DOUBLES, ir.Undefined), value, ir.Constant(ir.IntType(32), 0))
    return builder.shuffle_vector(one, ir.Constant(DOUBLES, ir.Undefined),
                                  ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES))  # fmt: skip


def _llvm(builder: Any, name: str, count: int) -> Any:
    """LLVM's own function of `count` vectors."""
    kind = ir.FunctionType(DOUBLES, [DOUBLES] * count)
    return cgutils.get_or_insert_function(builder.module, kind, f"llvm.{name}.v{LANES}f64")


class _Value:
    """A vector that is being computed, with Python's operators."""

    def __init__(self, builder: Any, value: Any) -> None:
        self.builder, self.value = builder, value

    def of(self, other: Any) -> Any:
        return other.value if isinstance(other, _Value) else ir.Constant(DOUBLES, [float(other)] * LANES)

    def __add__(self, other: Any) -> "_Value":
        return _Value(self.builder, self.builder.fadd(self.value, self.of(other)))

    def __sub__(self, other: Any) -> "_Value":
        return _Value(self.builder, self.builder.fsub(self.value, self.of(other)))

    def __mul__(self, other: Any) -> "_Value":
        return _Value(self.builder, self.builder.fmul(self.value, self.of(other)))

    def __truediv__(self, other: Any) -> "_Value":
        return _Value(self.builder, self.builder.fdiv(self.value, self.of(other)))

    def where(self, other: Any, if_less: Any, otherwise: Any) -> "_Value":
        """`if_less` in the lanes where this is below `other`, else `otherwise`."""
        less = self.builder.fcmp_ordered("<", self.value, self.of(other))
        return _Value(self.builder, self.builder.select(less, self.of(if_less), self.of(otherwise)))

    def polynomial(self, coefficients: list[float]) -> "_Value":
        add = _llvm(self.builder, "fmuladd", 3)
        out = self.of(coefficients[-1])
        for c in coefficients[-2::-1]:
            out = self.builder.call(add, [out, self.value, self.of(c)])
        return _Value(self.builder, out)

    def rounded(self) -> "_Value":
        return self + ROUNDING - ROUNDING


def _sin(x: _Value, quarter: float = 0.0) -> _Value:
    """sin(x), or cos(x) a quarter turn on."""
    turns = (x * (1.0 / math.pi) - quarter).rounded()
    odd = turns - (turns * 0.5).rounded() * 2.0
    sign = (odd * odd * -2.0 + 1.0) * (1.0 - 4.0 * quarter)
    half = turns + quarter
    rest = x - half * PI_HIGH - half * PI_LOW
    return sign * rest * (rest * rest).polynomial(SIN)


def _cos(x: _Value) -> _Value:
    return _sin(x, 0.5)


def _atan(x: _Value) -> _Value:
    size = x.where(0.0, x * -1.0, x)
    above = _Value(x.builder, size.of(NARROW))
    beyond = _Value(x.builder, size.of(WIDE))
    over = beyond.where(size, -1.0, above.where(size, size - 1.0, size))
    under = beyond.where(size, size, above.where(size, size + 1.0, 1.0))
    base = beyond.where(size, 0.5 * math.pi, above.where(size, 0.25 * math.pi, 0.0))
    share = over / under
    angle = base + share * (share * share).polynomial(ATAN)
    return x.where(0.0, angle * -1.0, angle)


def _exp(x: _Value) -> _Value:
    least = x.where(-LARGEST_EXPONENT, -LARGEST_EXPONENT, x)
    within = _Value(x.builder, x.of(LARGEST_EXPONENT)).where(least, LARGEST_EXPONENT, least)
    doublings = (within * (1.0 / math.log(2.0))).rounded()
    rest = within - doublings * LN2_HIGH - doublings * LN2_LOW
    # What is no number is none of the polynomial's either; its exponent has to be one.
    whole = doublings.where(2.0 * LARGEST_EXPONENT, doublings, 0.0)
    b = x.builder
    bits = b.shl(b.add(b.fptosi(whole.value, WHOLE), ir.Constant(WHOLE, [1023] * LANES)),
                 ir.Constant(WHOLE, [52] * LANES))  # fmt: skip
    return rest.polynomial(EXP) * _Value(b, b.bitcast(bits, DOUBLES))


def _tanh(x: _Value) -> _Value:
    size = x.where(0.0, x * -1.0, x)
    value = _Value(x.builder, x.of(1.0)) - _Value(x.builder, x.of(2.0)) / (_exp(size * 2.0) + 1.0)
    return x.where(0.0, value * -1.0, value)


def _sqrt(x: _Value) -> _Value:
    return _Value(x.builder, x.builder.call(_llvm(x.builder, "sqrt", 1), [x.value]))


def _function(of: Any) -> Any:
    """An elementary function of LANES numbers, for compiled code."""

    @intrinsic
    def function(_context, x):  # type: ignore[no-untyped-def]
        return lanes(x), lambda _, builder, __, arguments: of(_Value(builder, arguments[0])).value

    return function


ELEMENTARY = {name: _function(of) for name, of in (("sin", _sin), ("cos", _cos), ("atan", _atan), ("exp", _exp),
                                                   ("tanh", _tanh), ("sqrt", _sqrt))}  # fmt: skip
"""By the name of the function of one number."""


def _arithmetic(operation: Any, compute: Callable[[Any, Any, Any], Any]) -> None:
    """Has compiled code take LANES numbers, or a number for each of them, on either side of an operator."""
    pairs = [(lanes, lanes), (lanes, types.float64), (types.float64, lanes)]

    @infer_global(operation)
    class _Template(ConcreteTemplate):
        cases = [signature(lanes, *pair) for pair in pairs]  # noqa: RUF012

    def lowered(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        return compute(builder, *(_vector(builder, value) for value in arguments))

    for pair in pairs:
        lower_builtin(operation, *pair)(lowered)


_arithmetic(operator.add, lambda builder, a, b: builder.fadd(a, b))
_arithmetic(operator.sub, lambda builder, a, b: builder.fsub(a, b))
_arithmetic(operator.mul, lambda builder, a, b: builder.fmul(a, b))
# By the reciprocal, which a loop takes once of what stays the same in it.
_arithmetic(
    operator.truediv, lambda builder, a, b: builder.fmul(a, builder.fdiv(ir.Constant(DOUBLES, [1.0] * LANES), b))
)
_arithmetic(operator.pow, lambda builder, a, b: builder.call(_llvm(builder, "pow", 2), [a, b]))


@infer_global(operator.neg)
class _Negative(ConcreteTemplate):
    cases = [signature(lanes, lanes)]  # noqa: RUF012


@lower_builtin(operator.neg, lanes)
def _negative(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
    return builder.fneg(arguments[0])


@intrinsic
def select_lanes(_context, a, b, if_less, otherwise):  # type: ignore[no-untyped-def]
    """`if_less` in the lanes where a < b, else `otherwise`; each a number or LANES of them."""

    def lowered(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        kinds = zip(arguments, signature.args, strict=True)
        values = [x if kind is lanes else context.cast(builder, x, kind, types.float64) for x, kind in kinds]
        if a is lanes or b is lanes:
            values[:2] = (_vector(builder, x) for x in values[:2])
        less = builder.fcmp_ordered("<", *values[:2])
        return builder.select(less, *(_vector(builder, x) for x in values[2:]))

    return lanes(a, b, if_less, otherwise), lowered


@intrinsic
def any_there(_context, x):  # type: ignore[no-untyped-def]
    """Whether a lane differs from zero."""

    def lowered(_context, builder, _signature, arguments):  # type: ignore[no-untyped-def]
        there = builder.fcmp_unordered("!=", arguments[0], ir.Constant(DOUBLES, [0.0] * LANES))
        bits = ir.IntType(LANES)
        return builder.icmp_unsigned("!=", builder.bitcast(there, bits), ir.Constant(bits, 0))

    return types.boolean(x), lowered


@intrinsic
def _multiply_add(_context, factor, x, added):  # type: ignore[no-untyped-def]
    def lowered(_context, builder, _signature, arguments):  # type: ignore[no-untyped-def]
        return builder.call(_llvm(builder, "fmuladd", 3), [_vector(builder, value) for value in arguments])

    return lanes(factor, x, added), lowered


def _place(context: Any, builder: Any, kind: Any, array: Any, index: Any) -> Any:
    """Where the LANES numbers of an index lie in a flat array."""
    data = context.make_array(kind)(context, builder, array).data
    at = builder.gep(data, [builder.mul(index, ir.Constant(index.type, LANES))])
    return builder.bitcast(at, DOUBLES.as_pointer())


@intrinsic
def _load_lanes(_context, array, index):  # type: ignore[no-untyped-def]
    def lowered(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        index = context.cast(builder, arguments[1], signature.args[1], types.intp)
        return builder.load(_place(context, builder, signature.args[0], arguments[0], index), align=8)

    return lanes(array, index), lowered


@intrinsic
def _load_lanes_tuple(_context, array, first, count):  # type: ignore[no-untyped-def]
    if not all(isinstance(number, types.IntegerLiteral) for number in (first, count)):
        raise errors.RequireLiteralValue("first and count")
    begin, many = first.literal_value, count.literal_value
    kind = types.UniTuple(lanes, many)

    def lowered(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        places = (_place(context, builder, signature.args[0], arguments[0], ir.Constant(ir.IntType(64), begin + i))
                  for i in range(many))  # fmt: skip
        return context.make_tuple(builder, kind, [builder.load(place, align=8) for place in places])

    return kind(array, first, count), lowered


@intrinsic
def _store_lanes(_context, array, index, value):  # type: ignore[no-untyped-def]
    def lowered(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        index = context.cast(builder, arguments[1], signature.args[1], types.intp)
        value = arguments[2] if signature.args[2] is lanes else context.cast(
            builder, arguments[2], signature.args[2], types.float64)  # fmt: skip
        place = _place(context, builder, signature.args[0], arguments[0], index)
        builder.store(_vector(builder, value), place, align=8)
        return context.get_dummy_value()

    return types.void(array, index, value), lowered


overload(abs)(lambda x: (lambda x: select_lanes(x, 0.0, -x, x)) if x is lanes else None)


# The four as functions, which plain Python computes on arrays of LANES numbers.


def multiply_add(factor: Any, x: Any, added: Any) -> Any:
    """factor * x + added of LANES numbers x and added, rounded once where the processor can."""
    return factor * x + added


def load_lanes(array: Any, index: Any) -> Any:
    """The LANES numbers of an index, of a flat array [count * LANES] in one piece."""
    return array[index * LANES : (index + 1) * LANES].copy()


def load_lanes_tuple(array: Any, first: int, count: int) -> tuple[Any, ...]:
    """Those of `count` indices from `first` on, both constants where compiled."""
    return tuple(load_lanes(array, first + i) for i in range(count))


def store_lanes(array: Any, index: Any, value: Any) -> None:
    """Writes what `load_lanes` reads."""
    array[index * LANES : (index + 1) * LANES] = value


# fmt: off
overload(multiply_add)(lambda factor, x, added: lambda factor, x, added: _multiply_add(factor, x, added))  # noqa: ARG005
overload(load_lanes)(lambda array, index: lambda array, index: _load_lanes(array, index))  # noqa: ARG005
overload(load_lanes_tuple)(
    lambda array, first, count: lambda array, first, count: _load_lanes_tuple(array, first, count))  # noqa: ARG005
overload(store_lanes)(lambda array, index, value: lambda array, index, value: _store_lanes(array, index, value))  # noqa: ARG005
