"""Directions that logs cannot identify, on covariances made for the purpose."""

import numpy as np

from drift_drake.gap.identification.calibration import Direction, grouped, not_identified, tied

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


def test_many_that_are_not_identified_are_said_in_few_sentences():
    single = [Direction({name: 1.0}, left) for name, left in (("roll_stiffness", 1.0), ("mass", 0.9), ("height", 0.62))]
    combined = [Direction({name: 0.7, "friction": -0.7}, 0.8 - 0.01 * i) for i, name in enumerate("abcdef")]
    disagreed = {"drag": "run_1", "friction": "run_2", "lag": "run_1"}
    assert grouped([*single, *combined], disagreed) == [
        "roll_stiffness, mass, height (62 to 100 % of each prior's width is left)",
        "6 combinations (75 to 80 % of the priors' width is left), the worst: a against friction; b against friction; "
        "c against friction",
        "drag, lag (the recordings ask for different values, run_1 the most)",
        "friction (the recordings ask for different values, run_2 the most)",
    ]
    assert grouped([single[1], combined[0]], {}) == [single[1].sentence(), combined[0].sentence()]
    assert grouped([], {}) == []
