"""The scalar functions mean the same on every type, compiled or not."""

import math

import numpy as np
import pytest
from pydrake.autodiffutils import AutoDiffXd
from pydrake.symbolic import Expression, Variable

from drift_drake.car import scalar
from drift_drake.car.compilation import compiled

UNARY = {"sin": math.sin, "cos": math.cos, "sqrt": math.sqrt, "exp": math.exp, "tanh": math.tanh, "atan": math.atan}
DERIVATIVE = {
    "sin": math.cos,
    "cos": lambda x: -math.sin(x),
    "sqrt": lambda x: 0.5 / math.sqrt(x),
    "exp": math.exp,
    "tanh": lambda x: 1.0 - math.tanh(x) ** 2,
    "atan": lambda x: 1.0 / (1.0 + x * x),
}


@pytest.mark.parametrize("name", UNARY)
def test_unary_functions_agree_on_all_types(name):
    function, expected, slope = getattr(scalar, name), UNARY[name](0.7), DERIVATIVE[name](0.7)
    assert type(function(0.7)) is float
    assert function(0.7) == expected
    np.testing.assert_allclose(function(np.array([[0.7, 0.7]])), [[expected, expected]], rtol=1e-15)
    result = function(AutoDiffXd(0.7, np.array([2.0])))
    assert result.value() == pytest.approx(expected, rel=1e-15)
    assert result.derivatives()[0] == pytest.approx(2.0 * slope, rel=1e-14)
    x = Variable("x")
    assert function(Expression(x)).Evaluate({x: 0.7}) == pytest.approx(expected, rel=1e-15)
    assert function(complex(0.7, 1e-30)).imag / 1e-30 == pytest.approx(slope, rel=1e-14)

    @compiled
    def run(x):
        return function(x)

    assert run(0.7) == pytest.approx(expected, rel=1e-15)


@pytest.mark.parametrize(("a", "b", "expected"), [(1.0, 2.0, 10.0), (2.0, 1.0, 20.0), (1.0, 1.0, 20.0)])
def test_select_takes_the_first_branch_only_below(a, b, expected):
    assert scalar.select(a, b, 10.0, 20.0) == expected
    assert scalar.select(np.array([a]), b, 10.0, 20.0).tolist() == [expected]
    assert scalar.select(a, np.array([b]), 10.0, 20.0).tolist() == [expected]
    assert scalar.select(AutoDiffXd(a, np.array([1.0])), b, 10.0, 20.0) == expected
    assert scalar.select(complex(a, 1e-30), b, 10.0, 20.0) == expected
    x = Variable("x")
    assert scalar.select(Expression(x), b, 10.0, 20.0).Evaluate({x: a}) == expected


def test_select_on_complex_numbers_looks_at_real_parts():
    assert scalar.select(complex(0.0, 5.0), 1.0, 1.0, 2.0) == 1.0
    assert scalar.select(complex(2.0, -5.0), complex(1.0, 9.0), 1.0, 2.0) == 2.0
    assert scalar.select(np.array([0.0 + 5.0j]), 1.0, 1.0, 2.0).tolist() == [1.0]


def test_clipping_and_extrema():
    assert [scalar.clip(x, -1.0, 2.0) for x in (-3.0, 0.5, 9.0)] == [-1.0, 0.5, 2.0]
    assert scalar.maximum(1.0, 2.0) == 2.0
    assert scalar.minimum(1.0, 2.0) == 1.0
    assert scalar.absolute(-3.0) == 3.0
    assert scalar.absolute(AutoDiffXd(-3.0, np.array([1.0]))).derivatives()[0] == -1.0
    np.testing.assert_array_equal(scalar.clip(np.array([-3.0, 0.5, 9.0]), -1.0, 2.0), [-1.0, 0.5, 2.0])


def test_norm_is_smooth_at_the_origin_and_exact_away_from_it():
    assert scalar.norm2(3.0, 4.0) == 5.0
    at_origin = scalar.norm2(AutoDiffXd(0.0, np.array([1.0])), AutoDiffXd(0.0, np.array([0.0])))
    assert at_origin.derivatives()[0] == 0.0
    assert at_origin.value() == pytest.approx(1e-9)


@pytest.mark.parametrize("factor", [0.0, 2.0])
def test_switched_is_the_product_also_where_compiled_code_leaves_the_function_out(factor):
    @compiled
    def run(factor, x):
        return scalar.switched(factor, scalar.tanh, x)

    assert run(factor, 0.7) == pytest.approx(scalar.switched(factor, scalar.tanh, 0.7), rel=1e-15)
    assert run(0.0, 0.7) == 0.0
