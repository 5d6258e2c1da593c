"""What formulas may be, and that they may be nothing else."""

import sys

import numpy as np
import pytest

from drift_drake.gap.logs.importing.formula import InvalidFormulaError, evaluate, names_in


def test_arithmetic_on_arrays():
    s = np.array([-1.0, 0.0, 2.0])
    values = {"s": s, "k": 3.0}
    np.testing.assert_allclose(
        evaluate("-k * tanh(s) ** 2 + maximum(s, 0) / 4", values), -3.0 * np.tanh(s) ** 2 + [0.0, 0.0, 0.5]
    )
    assert evaluate("2", {}) == 2


def test_names():
    assert names_in("a * tanh(b - 0.1) + a") == {"a", "b"}


@pytest.mark.parametrize(
    ("formula", "message"),
    [
        ("2 *", "is no formula"),
        ("s.real", "'s.real' in 's.real' is not allowed"),
        ("__import__('os')", "is not allowed"),
        ("open(s)", "is not allowed"),
        ("s[0]", "is not allowed"),
        ("'text'", "is not allowed"),
        ("s if s else 1", "is not allowed"),
        ("tanh(s, s)", r"tanh .* takes 1 argument"),
        ("s // 2", "is not allowed"),
        (990 * "-" + "1", "is nested too deep"),
        (300 * "(s+" + "s" + 300 * ")", "is no formula|is longer|nested too deep"),
        ("9" * 400, "a number without end"),
    ],
)
def test_what_is_not_allowed(formula, message):
    with pytest.raises(InvalidFormulaError, match=message):
        names_in(formula)


def test_the_longest_sum_is_a_formula():
    assert names_in("+".join(500 * ["s"])) == {"s"}


def test_nesting_is_limited_whatever_the_interpreter_allows():
    before = sys.getrecursionlimit()
    sys.setrecursionlimit(10_000)
    try:
        with pytest.raises(InvalidFormulaError, match="nested too deep"):
            names_in(990 * "-" + "1")
    finally:
        sys.setrecursionlimit(before)


def test_unknown_names():
    with pytest.raises(InvalidFormulaError, match="'w' in '2 \\* w' is not known; known are a, b"):
        evaluate("2 * w", {"a": 1.0, "b": 2.0})


@pytest.mark.parametrize("formula", ["w / 0", "w * 1e308 * 1e308", "exp(1e5 * w)", "w ** 1e9", "0 * w / w"])
def test_what_leaves_the_range_of_numbers_warns_of_nothing(formula):
    found = evaluate(formula, {"w": np.array([0.0, 1.0, 1e300])})
    assert np.isnan(found).any()
    assert not np.isinf(found).any()
