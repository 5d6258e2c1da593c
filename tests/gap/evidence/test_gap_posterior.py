"""From evidences to probabilities: Occam, unknown, the ambiguity set."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.stats import norm

from drift_drake.gap.estimation.fit import Fit
from drift_drake.gap.evidence.constants import PRIORS
from drift_drake.gap.evidence.posterior import (
    PosteriorConstants,
    implausibility,
    log_prior,
    make_posterior,
    probabilities_of,
    read_constants,
)

CATALOGUE = 28
PAIR = ("aero_drag", "mass_error")


def fitted(names, theta=None):
    theta = np.zeros(12 + len(names)) if theta is None else theta
    return Fit(names, theta, 0.0, np.eye(len(theta)), 0.0, 1.0, 1)


def test_probabilities_sum_to_one_and_are_sorted():
    p = probabilities_of({(): 0.0, ("aero_drag",): 3.0, PAIR: 4.0}, 0.0, CATALOGUE, PosteriorConstants())
    assert sum(p.values()) == pytest.approx(1.0)
    assert list(p.values()) == sorted(p.values(), reverse=True)
    assert set(p) == {"none", "aero_drag", "aero_drag+mass_error", "unknown"}


def test_equal_evidence_prefers_fewer_effects():
    p = probabilities_of({(): 0.0, ("aero_drag",): 0.0, PAIR: 0.0}, 0.0, CATALOGUE, PosteriorConstants())
    assert p["none"] > p["aero_drag"] > p["aero_drag+mass_error"]


@pytest.mark.parametrize(("gain", "verdict"), [(0.0, "effect"), (1000.0, "unknown")])
def test_what_is_left_unexplained_decides_between_effect_and_unknown(gain, verdict):
    posterior = make_posterior(
        [(fitted(("aero_drag",)), 5000.0), (fitted(()), 0.0)], gain, CATALOGUE, PosteriorConstants()
    )
    assert posterior.verdict == verdict
    assert posterior.causes == (("aero_drag",) if verdict == "effect" else ())
    assert posterior.leading.names == ("aero_drag",)


def test_no_gap_is_none_and_the_ambiguity_set_holds_95_percent():
    hypotheses = [(fitted(("mass_error",)), 3.0), (fitted(("yaw_inertia_error",)), 3.0), (fitted(()), 0.0)]
    posterior = make_posterior(hypotheses, -3.0, CATALOGUE, PosteriorConstants())
    assert posterior.verdict == "none"
    assert sum(posterior.probabilities[name] for name in posterior.ambiguity) >= 0.95
    assert sum(posterior.probabilities[name] for name in posterior.ambiguity[:-1]) < 0.95


def test_deviations_far_beyond_tolerance_speak_for_unknown():
    theta = np.zeros(12)
    assert implausibility(fitted((), theta), PosteriorConstants()) == 0.0
    theta[6] = 15.0  # tolerances of friction
    assert implausibility(fitted((), theta), PosteriorConstants()) > 80.0


@pytest.mark.parametrize("constants", [PosteriorConstants(), read_constants(), PRIORS])
@pytest.mark.parametrize("catalogue", [2, CATALOGUE])
def test_the_priors_of_all_that_excludes_each_other_sum_to_one(constants, catalogue):
    """Those of a change were fitted one by one, and sum to a little more."""
    pairs = math.comb(catalogue, 2)
    known = sum(count * math.exp(log_prior(effects, catalogue, constants))
                for effects, count in enumerate((1, catalogue, pairs)))  # fmt: skip
    assert known + constants.prior_unknown == pytest.approx(1.0, abs=0.04 if constants is PRIORS else 1e-12)
    assert constants.prior_pair < constants.prior_single < 1.5 * constants.prior_none


def test_where_there_is_one_pair_at_most_it_has_all_of_the_pairs_prior():
    c = PosteriorConstants()
    assert math.exp(log_prior(2, 2, c)) == pytest.approx(c.prior_pair)
    assert math.exp(log_prior(2, 1, c)) == pytest.approx(c.prior_pair)


def test_evidence_counts_by_bayes_rule_and_unknown_pays_its_cost():
    """Odds by hand: evidence over the temperature, times priors; unknown has what is unexplained, less its cost."""
    c = PosteriorConstants(temperature=2.0, unknown_cost=3.0, unknown_share=0.01)
    p = probabilities_of({(): 1.0, ("aero_drag",): 9.0}, 5.0, 10, c)
    assert p["aero_drag"] / p["none"] == pytest.approx(math.exp(8.0 / 2.0) * (0.4 / 10) / 0.3)
    assert p["unknown"] / p["none"] == pytest.approx(math.exp((9.0 + 5.0 - 3.0 - 0.08 - 1.0) / 2.0) * 0.15 / 0.3)
    less = probabilities_of({(): 1.0, ("aero_drag",): 9.0}, -5.0, 10, c)
    assert less["unknown"] / less["none"] == pytest.approx(math.exp((9.0 - 3.0 - 0.08 - 1.0) / 2.0) * 0.15 / 0.3)


def test_a_deviation_is_implausible_by_the_ratio_of_two_normal_densities():
    theta = np.zeros(12)
    theta[3], theta[5] = 4.0, -7.0
    fit = dataclasses.replace(fitted((), theta), exactness=1.0)
    expected = sum(norm.logpdf(n, 0.0, 10.0) - norm.logpdf(n) for n in (4.0, -7.0))
    assert implausibility(fit, PosteriorConstants()) == pytest.approx(expected)


def test_the_shipped_constants_can_be_read():
    assert read_constants().temperature >= 1.0
