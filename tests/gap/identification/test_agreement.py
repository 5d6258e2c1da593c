"""Whether recordings agree, on made-up pulls: chance, names, widened intervals, words."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import chi2, norm

from drift_drake.gap.estimation.prediction_constants import CALIBRATED
from drift_drake.gap.evidence.alarms import threshold
from drift_drake.gap.identification import agreement as module
from drift_drake.gap.identification.agreement import (
    BY_CHANCE,
    Agreement,
    agreement,
    by_likelihood,
    odd_parts,
    sentences,
    stretch_names,
    with_differences,
)
from drift_drake.gap.identification.calibration import Parameter


def pulled_by(asked: np.ndarray) -> np.ndarray:
    """What each of K recordings of one length pulls the mean of all by [K, n]: a K-th of what it asks for beyond it."""
    return (asked - asked.mean(axis=0)) / len(asked)


@pytest.mark.parametrize("count", [2, 5])
def test_recordings_differ_where_their_variance_is_beyond_chance(count: int) -> None:
    """Normal recordings that do not differ have a chi-squared sum of squares: the limit is its 99 % quantile."""
    asked = np.random.default_rng(count).normal(size=(count, 1))
    sample, own = float(np.var(asked, ddof=1)), 1.0  # of what one recording's blocks of time show
    beyond = chi2.ppf(1.0 - BY_CHANCE, count - 1) / (count - 1) * own / sample
    left = np.array([CALIBRATED * own / count])
    for factor, differs in ((0.98, False), (1.02, True)):
        found = agreement(pulled_by(asked * np.sqrt(factor * beyond)), left)
        assert found.apart == pytest.approx([factor * beyond * sample])
        assert list(found.disagreed) == [differs]
        assert found.furthest[0] == np.argmax(np.abs(asked - asked.mean()))


@pytest.mark.parametrize("count", [2, 3, 4, 20])
def test_what_recordings_disagree_on_is_more_than_the_logs_leave_open(count: int) -> None:
    """At the limit of chance, too, whatever their number."""
    asked = np.linspace(-1.0, 1.0, count)[:, None]
    apart = float(np.var(asked, ddof=1))
    limit = next(
        left for left in np.geomspace(100.0, 1e-3, 200) if agreement(pulled_by(asked), np.array([left])).disagreed
    )
    assert limit < 0.5 * apart


def test_one_recording_disagrees_with_none() -> None:
    found = agreement(np.array([[5.0, -3.0]]), np.array([1e-9, 1e-9]))
    assert not found.disagreed.any()
    assert list(found.furthest) == [0, 0]


def made_day(stretches: list[int], runs: list[tuple[str, list[int]]]) -> SimpleNamespace:
    made = [
        SimpleNamespace(name=name, recording=name[:1], starts=np.array(starts), period=0.01) for name, starts in runs
    ]
    run = np.repeat(np.arange(len(made)), [len(one.starts) for one in made])
    return SimpleNamespace(runs=made, run=run, stretch=np.array(stretches))


def test_stretches_are_named_by_their_times_where_a_run_has_several() -> None:
    day = made_day([0, 0, 1, 1, 2], [("a0", [100, 1200, 1300, 2400]), ("a1", [0])])
    assert stretch_names(day) == ["a0 from 1 to 12 s", "a0 from 13 to 24 s", "a1"]


def test_what_has_a_gap_relative_to_the_others_is_odd() -> None:
    limit = threshold(BY_CHANCE)
    odd, usual = (
        SimpleNamespace(probabilities={"none": limit * factor}, most_like="mass_error") for factor in (0.99, 1.01)
    )
    two = made_day([0, 1], [("b0", [0]), ("a0", [0])])
    assert odd_parts(two, [usual, odd]) == {"b": "mass_error"}
    one = made_day([0, 1, 2], [("a0", [0, 1500]), ("a1", [0])])
    assert odd_parts(one, [usual, odd, odd]) == {"a0 from 15 to 15 s": "mass_error", "a1": "mass_error"}


def parameter(kind: str, low: float, high: float, deviation: float = 0.03, prior: float = 0.1) -> Parameter:
    middle = 0.5 * (low + high)
    return Parameter("-", 0.0, middle, low, high, deviation, prior, 1.0, kind)


def test_intervals_become_as_wide_as_recordings_differ_where_they_do() -> None:
    """Standard deviations add up as squares, to no more than was believed before; no drag is below zero."""
    wide = norm.ppf(0.975)
    parameters = {
        "mass_error": parameter("free", -0.1, 0.02),
        "friction_level": parameter("known", -0.1, 0.02),
        "yaw_inertia_error": parameter("free", -0.1, 0.02),
        "aero_drag": parameter("effect", 0.01, 0.13),
        "cg_shift": parameter("free", -0.1, 0.02),
    }
    found = Agreement(np.array([4.0, 4.0, 4.0, 4.0, 900.0]), np.array([True, True, False, True, True]),
                      np.array([1, 0, 0, 0, 1]))  # fmt: skip
    out, disagreed = with_differences(parameters, found, ["a", "b"], np.full(5, 0.02))
    assert disagreed == {"mass_error": "b", "aero_drag": "a", "cg_shift": "b"}
    assert out["friction_level"] == parameters["friction_level"]
    assert out["yaw_inertia_error"] == parameters["yaw_inertia_error"]
    none = with_differences({"aero_drag": parameter("effect", 0.0, 0.12)}, found, ["a", "b"], np.full(1, 0.02))[0]
    assert none["aero_drag"].low == 0.0
    more = wide * (0.05 - 0.03)  # of 0.03 and 2 * 0.02
    assert out["mass_error"].deviation == out["aero_drag"].deviation == pytest.approx(0.05)
    assert (out["mass_error"].low, out["mass_error"].high) == pytest.approx((-0.1 - more, 0.02 + more), abs=1e-5)
    assert (out["aero_drag"].low, out["aero_drag"].high) == pytest.approx((0.0, 0.13 + more), abs=1e-5)
    assert out["cg_shift"].deviation == 0.1
    assert out["cg_shift"].high == pytest.approx(0.02 + wide * 0.07, abs=1e-5)


def test_words_gather_what_one_recording_pulls() -> None:
    said = sentences({"mass_error": "b", "aero_drag": "a", "cg_shift": "b"}, {"c": "gyro_bias"})
    assert len(said) == 3
    assert "different values of mass_error, cg_shift, b the most" in said[0]
    assert "leave b out if" in said[0]
    assert "different values of aero_drag, a the most" in said[1]
    assert said[2].startswith("c has a gap relative to the rest of the baseline, most like gyro_bias")


def test_a_fit_by_likelihood_is_pulled_by_the_scores_of_its_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two parameters, three runs of two recordings; the second parameter is of the second and third run alone."""
    rng = np.random.default_rng(1)
    blocks = [rng.normal(size=(4, 1)), rng.normal(size=(6, 2)), rng.normal(size=(2, 2))]
    columns, innovations = [np.array([0]), np.array([0, 1]), np.array([1, 0])], [rng.normal(size=n) for n in (4, 6, 2)]
    jacobian = SimpleNamespace(blocks=blocks, columns=columns, by_run=lambda _: innovations)
    covariance = np.array([[0.5, 0.1], [0.1, 0.3]])
    at = SimpleNamespace(jacobian=jacobian, filtered=SimpleNamespace(innovations=None))
    found = SimpleNamespace(theta=np.zeros(2), problem=None, covariance=covariance, at=at)
    monkeypatch.setattr(module, "flat", lambda *_: None)
    seen = {}
    monkeypatch.setattr(module, "agreement", lambda pulled, left: seen.update(pulled=pulled, left=left) or "agreed")
    assert by_likelihood(found, ["b", "a", "b"], np.array([1, 0]), np.array([2.0, 3.0])) == ("agreed", ["a", "b"])
    of_a = np.array([blocks[1][:, i] @ innovations[1] for i in (0, 1)])
    of_b = [blocks[0][:, 0] @ innovations[0] + blocks[2][:, 1] @ innovations[2], blocks[2][:, 0] @ innovations[2]]
    scores = np.array([of_a, of_b])
    # Half of the rows are the first's: what both recordings ask for together is shared out by that.
    beyond = scores - 0.5 * scores.sum(axis=0)
    np.testing.assert_allclose(seen["pulled"], (-beyond @ covariance)[:, [1, 0]], rtol=1e-12)
    np.testing.assert_allclose(seen["left"], CALIBRATED * np.array([0.3 * 4.0, 0.5 * 9.0]))
