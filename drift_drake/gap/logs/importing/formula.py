"""Formulas of a mapping file, such as a recorder's static maps: arithmetic and a few functions on arrays, no more."""

import ast
import operator
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from drift_drake.common.errors import DriftDrakeError

BINARY: dict[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
}
UNARY: dict[type[ast.unaryop], Callable[[Any], Any]] = {ast.USub: operator.neg, ast.UAdd: operator.pos}
FUNCTION_NAMES = "abs arctan arctan2 cos exp hypot maximum minimum sign sin sqrt tan tanh"
FUNCTIONS: dict[str, np.ufunc] = {name: getattr(np, name) for name in FUNCTION_NAMES.split()}
LONGEST = 1000  # characters of a formula
DEEPEST = 500  # parts within one another: of the longest sum
SHOWN = 100  # of them in a message


class InvalidFormulaError(DriftDrakeError, ValueError):
    """A formula that cannot be used; the message says which part."""


def names_in(formula: str) -> set[str]:
    """Names that a formula reads.

    Raises:
        InvalidFormulaError: not a formula, or a part of it is not allowed.
    """
    tree = _parsed(formula)
    try:
        if _depth(tree) > DEEPEST:  # whatever depth the interpreter allows
            raise RecursionError
        _value(tree, None, formula)
    except (RecursionError, OverflowError):
        raise InvalidFormulaError(
            f"'{_start(formula)}' is nested too deep, or holds a number without end; write two formulas"
        ) from None
    called = {id(node.func) for node in ast.walk(tree) if isinstance(node, ast.Call)}
    return {node.id for node in ast.walk(tree) if isinstance(node, ast.Name) and id(node) not in called}


def evaluate(formula: str, values: Mapping[str, Any]) -> Any:
    """The formula on numbers or arrays; NaN where it is not finite.

    Raises:
        InvalidFormulaError: not a formula, a part of it is not allowed, or a name is missing.
    """
    try:
        with np.errstate(all="ignore"):  # what comes of it is no number, which is said below or of its column
            value = _value(_parsed(formula), values, formula)
    except (ArithmeticError, RecursionError):
        raise InvalidFormulaError(
            f"'{_start(formula)}' divides by zero, leaves the range of numbers or is nested too deep"
        ) from None
    if np.iscomplexobj(value):
        raise InvalidFormulaError(f"'{formula}' takes a root of a negative number")
    return np.where(np.isfinite(value), value, np.nan)


def _start(formula: str) -> str:
    return formula if len(formula) <= SHOWN else f"{formula[:SHOWN]} ..."


def _parsed(formula: str) -> ast.expr:
    if len(formula) > LONGEST:
        raise InvalidFormulaError(f"'{_start(formula)}' is longer than {LONGEST} characters; write two formulas")
    try:
        return ast.parse(formula, mode="eval").body
    except (SyntaxError, ValueError, MemoryError, RecursionError):
        raise InvalidFormulaError(
            f"'{_start(formula)}' is no formula; write one like '0.5 * tanh(2 * steering)'"
        ) from None


def _depth(tree: ast.expr) -> int:
    """Parts within one another, operators not counted."""
    count, level = 0, [tree]
    while level:
        count, level = count + 1, [part for node in level for part in ast.iter_child_nodes(node)
                                   if isinstance(part, ast.expr)]  # fmt: skip
    return count


def _value(node: ast.expr, values: Mapping[str, Any] | None, formula: str) -> Any:
    """Value of a node; without values, walks it to see that all parts are allowed."""
    match node:
        case ast.Constant(value=int() | float() as number):
            return float(number)  # whole numbers have powers without end
        case ast.Name(id=name):
            if values is None:
                return 1.0
            if name not in values:
                raise InvalidFormulaError(
                    f"'{name}' in '{formula}' is not known; known are {', '.join(sorted(values))}"
                )
            return values[name]
        case ast.BinOp(left=left, op=op, right=right) if type(op) in BINARY:
            a, b = _value(left, values, formula), _value(right, values, formula)
            return 1.0 if values is None else BINARY[type(op)](a, b)
        case ast.UnaryOp(op=op, operand=operand) if type(op) in UNARY:
            return UNARY[type(op)](_value(operand, values, formula))
        case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]) if name in FUNCTIONS:
            if len(arguments) != FUNCTIONS[name].nin:
                raise InvalidFormulaError(f"{name} in '{formula}' takes {FUNCTIONS[name].nin} argument(s)")
            numbers = [_value(argument, values, formula) for argument in arguments]
            return 1.0 if values is None else FUNCTIONS[name](*numbers)
    part = ast.unparse(node)
    raise InvalidFormulaError(
        f"'{part}' in '{formula}' is not allowed; use numbers, names, + - * / ** and {', '.join(FUNCTIONS)}"
    )
