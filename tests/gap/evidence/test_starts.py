"""Where a search for one effect starts: scores may look normal far from the truth, errors do not."""

from types import SimpleNamespace

import numpy as np
import pytest

from drift_drake.car.parameters import VehicleParameters
from drift_drake.gap.diagnosis.calibrated.diagnose_change import candidates
from drift_drake.gap.estimation.prior import Range
from drift_drake.gap.evidence.hypotheses import Hypothesis
from drift_drake.gap.evidence.search import Curve

TRUTH = 0.12


class Clipped:
    """A search with one magnitude: scores fall to normal far off, where all errors are clipped."""

    def __init__(self):
        self.day = SimpleNamespace(constants=VehicleParameters().constants())
        self.scatter = SimpleNamespace(inverse=np.eye(1))
        self.ranges = {"steering_delay": Range(0.02, 0.5, 0.02, (0.02, 0.5))}

    def tried(self, *effects):
        far = [abs(one["steering_delay"] - TRUTH) for one in effects]
        return [(np.array([5.0 + 20.0 * off if off < 0.2 else 1.0]), min(off, 0.3) ** 2) for off in far]

    def nats(self, scores):
        return 0.5 * np.sum(np.square(scores), axis=-1)


@pytest.fixture(scope="module")
def curve():
    out = Curve("steering_delay", 0.0, [0.0], [np.array([7.0])])
    for q in (0.02, 0.1, 0.15, 0.25, 0.5):
        out = out.with_point(Clipped(), q)
    return out


def test_an_effect_starts_where_it_leaves_the_least_errors(curve):
    search = Clipped()
    assert curve.best(search)[0] == pytest.approx(0.5, abs=0.01)
    start = curve.start(search)
    assert start.magnitudes == pytest.approx([0.1])
    assert start.nats == pytest.approx(0.5 * (5.0 + 20.0 * 0.02) ** 2)
    assert curve.least_misfit(search) == (pytest.approx(0.02**2), pytest.approx(0.1))


def test_it_is_the_most_likely_magnitude_where_that_is_next_to_it():
    search = Clipped()
    curve = Curve("steering_delay", 0.0, [0.0], [np.array([7.0])])
    for q in (0.02, 0.1, 0.15):
        curve = curve.with_point(search, q)
    assert curve.start(search).magnitudes == curve.best(search)[0]


def hypothesis(name, q, deviation=0.01):
    return Hypothesis((name,), np.array([q]), np.array([[deviation**2]]), 1.0, -1.0)


def test_candidates_are_not_zero_and_none_is_there_twice():
    delay, lag, none = (
        hypothesis("steering_delay", 0.5),
        hypothesis("steering_lag", 0.1),
        hypothesis("mass_error", 0.01),
    )
    other = hypothesis("steering_delay", 0.1)
    found = candidates([lag, delay, none], [other, lag, none])
    assert found == [lag, delay, other]
