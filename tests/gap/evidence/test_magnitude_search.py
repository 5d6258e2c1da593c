"""The search for an effect's magnitude: curves of scores, farther ranges, what logs do not exclude."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import quad

from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.car.parameters import VehicleParameters
from drift_drake.gap.diagnosis.calibrated.posterior import evidence_over, not_excluded, tells_from_zero
from drift_drake.gap.estimation.baseline import Scatter
from drift_drake.gap.estimation.prior import Range, at_end
from drift_drake.gap.evidence.constants import PRIORS
from drift_drake.gap.evidence.hypotheses import Hypothesis
from drift_drake.gap.evidence.ranking import ranked
from drift_drake.gap.evidence.search import Curve, Search, follow

CAR = VehicleParameters()


class Linear:
    """A search whose scores are linear in one magnitude, with a truth."""

    vehicle = CAR

    def __init__(self, slope, truth):
        self.slope, self.truth = np.array(slope), truth
        self.scatter = Scatter(np.zeros(len(slope)), np.eye(len(slope))[None], np.eye(len(slope)))
        self.ranges = {"mass_error": Range(-0.2, 0.3, 0.02, (-0.2, 0.3))}
        self.day = SimpleNamespace(constants=CAR.constants())

    def scores(self, effects):
        return self.slope * (effects.get("mass_error", 0.0) - self.truth)

    def tried(self, *effects):
        return [(self.scores(one), one.get("mass_error", 0.0) ** 2) for one in effects]

    def nats(self, scores):
        return 0.5 * np.sum(np.square(scores), axis=-1)


@pytest.mark.parametrize("truth", [0.13, -0.07])
def test_a_curve_finds_the_magnitude_and_its_variance(truth):
    search = Linear([30.0, 40.0], truth)
    curve = Curve("mass_error", False, [0.0], [search.scores({})])
    for q in (-0.2, -0.1, 0.1, 0.2, 0.3):
        curve = curve.with_point(search, q)
    assert curve.with_point(search, 0.1) is curve
    found = curve.refined(search).hypothesis(search)
    assert found.magnitudes[0] == pytest.approx(truth, abs=1e-3)
    assert found.covariance[0, 0] == pytest.approx(1.0 / 50.0**2)
    assert found.nats == pytest.approx(0.0, abs=1e-2)


def test_a_curve_never_says_a_magnitude_that_is_no_gap():
    search = Linear([30.0, 40.0], 0.003)
    curve = Curve("mass_error", False, [0.0], [search.scores({})])
    for q in (-0.2, 0.2):
        curve = curve.with_point(search, q)
    assert abs(curve.best(search)[0]) >= 0.02 * (1.0 - 1e-9)


@pytest.mark.parametrize(("truth", "found"), [(0.55, 0.55), (-0.45, -0.45), (5.0, 1.0)])
def test_a_magnitude_beyond_the_reach_is_followed_as_far_as_any_vehicles(truth, found):
    search = Linear([30.0, 40.0], truth)
    curve = Curve("mass_error", False, [0.0], [search.scores({})])
    for q in (-0.2, 0.2, 0.3):
        curve = curve.with_point(search, q)
    assert follow(search, curve).hypothesis(search).magnitudes[0] == pytest.approx(found, abs=2e-3)
    assert at_end(found, search.ranges["mass_error"]) == (truth == 5.0)
    near = Linear([30.0, 40.0], 0.1)
    follow(near, Curve("mass_error", False, [0.0, 0.3], [near.scores({}), near.scores({"mass_error": 0.3})]))
    assert near.ranges["mass_error"].high == 0.3


def blunt_curve(search):
    curve = Curve("mass_error", 0.0, [0.0], [search.scores({})])
    for q in (-0.2, -0.1, 0.1, 0.2, 0.3):
        curve = curve.with_point(search, q)
    return curve


@pytest.mark.parametrize("truth", [0.0, 0.05, -0.3])
def test_evidence_of_what_is_not_excluded_is_integrated_over_its_magnitudes(truth):
    search = Linear([3.0, 4.0], truth)
    r = search.ranges["mass_error"]

    def density(q):
        return np.exp(-search.nats(search.scores({"mass_error": q}))) / r.width

    whole = quad(density, r.low, -r.least)[0] + quad(density, r.least, r.high)[0]
    assert evidence_over(blunt_curve(search), search)[0] == pytest.approx(np.log(whole), abs=0.02)


def test_what_logs_show_is_not_among_what_they_do_not_exclude():
    blunt, sharp = Linear([3.0, 4.0], 0.05), Linear([30.0, 40.0], 0.1)
    blunt.curves, sharp.curves = [blunt_curve(blunt)], [blunt_curve(sharp)]
    (h,) = not_excluded(blunt, [curve.hypothesis(blunt) for curve in blunt.curves])
    assert h.names == ("mass_error",)
    assert not tells_from_zero(h)
    assert not_excluded(sharp, [curve.hypothesis(sharp) for curve in sharp.curves]) == []


def test_what_is_not_excluded_makes_none_less_certain_and_is_not_named():
    search = Linear([3.0, 4.0], 0.05)
    search.curves = [blunt_curve(search)]
    none = Hypothesis((), np.zeros(0), np.zeros((0, 0)), 0.0, 0.0)
    alone = ranked([none], 1, PRIORS).probabilities
    found = ranked([none, *not_excluded(search, [curve.hypothesis(search) for curve in search.curves])], 1, PRIORS)
    assert found.verdict == "none"
    assert found.probabilities["none"] < alone["none"]
    # A single effect's whole prior relative to that of none: the logs say nothing of either.
    assert found.probabilities["mass_error"] / found.probabilities["none"] == pytest.approx(
        CATALOGUE["mass_error"].daily * PRIORS.prior_single / PRIORS.prior_none, rel=0.3)  # fmt: skip


def test_a_pair_of_which_one_does_nothing_is_none():
    search = Linear([30.0, 40.0], 0.1)
    search.ranges["gyro_bias"] = Range(-0.1, 0.1, 0.01, (-0.1, 0.1))
    seed = Hypothesis(("mass_error",), np.array([0.1]), np.array([[0.01**2]]), 1.0, -1.0)
    assert Search._pair(search, seed, "gyro_bias", 0.05) is None
