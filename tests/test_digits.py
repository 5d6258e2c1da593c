"""Numbers as people write them."""

import pytest

from drift_drake.common.errors import significant


@pytest.mark.parametrize(
    ("value", "digits", "text"),
    [(110300.4, 4, "110300"), (182.3, 2, "180"), (0.00031, 2, "0.00031"), (-0.1172, 4, "-0.1172"), (0.0, 3, "0")],
)
def test_no_number_is_a_power_of_ten(value, digits, text):
    assert significant(value, digits) == text
