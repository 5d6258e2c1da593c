"""Directions that logs cannot tell, on covariances made for the purpose."""

import numpy as np

from drift_drake.gap.identification.calibration import not_identified, tied

NAMES = ["mass", "torque", "friction"]


def test_a_parameter_that_stayed_at_its_prior_is_named_alone():
    (direction,) = not_identified(
        NAMES, np.array([10.0, 0.2, 0.1]), np.diag([10.0, 0.002, 0.001]) ** 2 + np.diag([0, 0, 0.0])
    )
    assert list(direction.parts) == ["mass"]
    assert "mass (100 % of the prior" in direction.sentence()


def test_a_combination_is_named_with_its_signs():
    """Mass and torque rise together: their ratio is identified, their product is not."""
    prior = np.array([1.0, 1.0, 1.0])
    both = np.array([1.0, 1.0, 0.0]) / np.sqrt(2.0)
    other = np.array([1.0, -1.0, 0.0]) / np.sqrt(2.0)
    covariance = 0.8 * np.outer(both, both) + 1e-4 * np.outer(other, other) + np.diag([0.0, 0.0, 1e-4])
    (direction,) = not_identified(NAMES, prior, covariance)
    assert set(direction.parts) == {"mass", "torque"}
    assert direction.sentence() in ("mass with torque (89 % of the priors' width is left)",
                                    "torque with mass (89 % of the priors' width is left)")  # fmt: skip
    deviation = np.sqrt(np.diag(covariance))
    ((a, b, q),) = tied(NAMES, covariance / np.outer(deviation, deviation))
    assert {a, b} == {"mass", "torque"}
    assert q > 0.99
