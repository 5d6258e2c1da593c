"""What a hypothesis leaves over: evidence against closed forms and quadrature."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from drift_drake.car.parameters import VehicleParameters
from drift_drake.gap.estimation.baseline import Scatter, Stretches
from drift_drake.gap.estimation.partial import partial_effects
from drift_drake.gap.estimation.prediction_constants import FACTORS
from drift_drake.gap.estimation.recordings_left_out import LeftOut
from drift_drake.gap.evidence.constants import OF_PARTIAL, SIZES, WIDER
from drift_drake.gap.evidence.left_out import asked_in_turn
from drift_drake.gap.evidence.left_over import left_over, log_mean, widened

NAMES = ("gyro_bias", "mass_error")
PARTS = partial_effects(NAMES)
SIZE = len(NAMES) + len(PARTS)


class Judged(LeftOut):
    """A recording left out whose scatter is given."""

    def __new__(cls, stretches, scatter):
        out = super().__new__(cls, stretches, None, None)
        out.scatter = scatter
        return out

    def at(self, scale, factors=(1.0,), main=0):
        c = np.repeat(scale * self.scatter.covariances, len(factors), axis=0)
        return Scatter(self.scatter.mean, c, self.scatter.information, main)


def scatter(seed=0):
    rng = np.random.default_rng(seed)
    root, other = rng.normal(size=(2, SIZE, SIZE))
    covariance = root @ root.T + np.eye(SIZE)
    return Scatter(np.zeros(SIZE), covariance[None], other @ other.T)


def test_evidence_of_a_partial_effect_is_that_of_a_wider_normal_distribution():
    s, x = scatter(), np.random.default_rng(1).normal(size=SIZE)
    own = multivariate_normal(np.zeros(SIZE), s.covariance).logpdf(x)
    by_direction = []
    for j in range(len(NAMES), SIZE):
        g = s.information[:, j]
        wider = [multivariate_normal(np.zeros(SIZE), s.covariance + tau**2 * np.outer(g, g)).logpdf(x) for tau in SIZES]
        by_direction.append(log_mean(np.array(wider) - own, 0))
    mixed = [multivariate_normal(np.zeros(SIZE), t * s.covariance).logpdf(x) - own for t in WIDER]
    expected = np.logaddexp(
        np.log(OF_PARTIAL) + log_mean(np.array(by_direction), 0), np.log(1 - OF_PARTIAL) + log_mean(np.array(mixed), 0)
    )
    found = left_over(x, s, NAMES, np.zeros((SIZE, 0)))
    assert found.gain == pytest.approx(expected)
    assert found.like == PARTS[int(np.argmax(by_direction))]


def test_what_a_magnitude_takes_up_is_no_evidence_of_something_else():
    s = scatter()
    x = 8.0 * s.information[:, len(NAMES)]
    assert left_over(x, s, NAMES, np.zeros((SIZE, 0))).gain > 10.0
    # The hypothesis' own magnitude does the same: the partial effect has nothing of its own to show.
    taken = left_over(0.0 * x, s, NAMES, s.information[:, [len(NAMES)]])
    assert taken.gain < 0.0


def test_a_gap_in_no_direction_of_the_catalogue_is_seen_by_its_size():
    assert widened(20.0, 20) < 0.0  # as normal scores scatter
    assert widened(400.0, 20) > 50.0
    assert widened(100.0, 20) > widened(100.0, 60)


def test_a_recording_like_the_others_has_no_gap_and_an_odd_one_has():
    rng, s = np.random.default_rng(2), scatter()
    draws = (np.linalg.cholesky(s.covariance) @ rng.normal(size=(SIZE, 5))).T
    draws[3] += 6.0 * s.information[:, 0]
    parts = [
        Judged(Stretches(x[None], s.information[None], np.ones(1), np.ones(1), np.zeros(1, dtype=int)), s)
        for x in draws
    ]
    units = np.array([0.01, 0.05])
    factors = np.full(len(FACTORS), -np.log(len(FACTORS)))
    distances = np.array([part.distance for part in parts])
    normal = SimpleNamespace(names=NAMES, units=units, factors=factors, main=0, left_out=distances)
    asked = asked_in_turn(SimpleNamespace(left_out=parts, normal=normal), VehicleParameters())
    found = np.array([one.probabilities["none"] for one in asked])
    assert int(np.argmin(found)) == 3
    assert found[3] < 0.05
    assert np.all(np.delete(found, 3) > 0.4)
