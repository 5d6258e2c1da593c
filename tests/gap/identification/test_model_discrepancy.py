"""The likelihood tempering exponent, and the forces that a calibrated car lacks."""

import dataclasses
import weakref

import numpy as np
import pytest

from drift_drake.car.parameters import VehicleParameters
from drift_drake.gap.estimation.filtered import filter_case
from drift_drake.gap.estimation.freeform import FORCE_CHANNELS, responses, traced
from drift_drake.gap.estimation.make_problem import make_problem
from drift_drake.gap.estimation.problem import flat
from drift_drake.gap.estimation.reduction import FOLDS, measured_fold
from drift_drake.gap.estimation.regression import Responses, equations, summed_equations
from drift_drake.gap.identification.estimate import estimate
from drift_drake.gap.identification.model_discrepancy import looked_at, model_discrepancy, scatter
from experiments.benchmarks.compiled_cases import make_case
from experiments.benchmarks.truths import Truth

ROWS, WEIGHTS = 4000, 40


def equations_with(lacking):
    """Normal equations of random regressors whose innovations have noise and `lacking` of each regressor."""
    rng = np.random.default_rng(0)
    d, j = rng.standard_normal((ROWS, WEIGHTS)), rng.standard_normal((ROWS, 2))
    e = rng.standard_normal(ROWS) + d @ rng.normal(0.0, lacking, WEIGHTS)
    return equations([Responses(d, np.repeat([0, 1], WEIGHTS // 2), j, np.arange(2), e)], 2, shared=True)


def test_scores_of_white_innovations_scatter_as_they_should():
    assert scatter(equations_with(0.0), np.zeros(2), np.zeros(2)) == pytest.approx([1.0, 1.0], abs=0.5)


def test_scores_of_forces_that_are_lacking_scatter_by_their_power():
    """Each score is that of its weight, information times weight, and the noise."""
    assert scatter(equations_with(0.1), np.zeros(2), np.zeros(2)) == pytest.approx([1.0 + 0.01 * ROWS] * 2, rel=0.6)


def test_a_car_that_the_model_follows_keeps_its_rows(identified):
    assert 0.3 < identified.calibration.tempering <= 1.0


@pytest.fixture(scope="module")
def strange():
    """A car whose tyres have another curve, as well as the filter can follow it."""
    runs = make_case(Truth({}, {"tyre_curve": 0.3}), VehicleParameters(), np.random.default_rng(7), 4.0)
    problem = make_problem(runs, VehicleParameters())
    return estimate(problem, (), np.zeros(problem.nuisances), 1.0)


def test_sums_run_by_run_are_those_of_all_rows(strange):
    """Of what each fold's weights leave, against the rows of all runs at once."""
    problem, count, rng = strange.problem, len(strange.theta), np.random.default_rng(0)
    by_kind = {kind: list(responses(problem, strange, kind)) for kind in ("functions", "pulses")}
    weights = rng.normal(0.0, 0.01, (FOLDS, by_kind["functions"][0].weights.shape[1]))
    left = [run.residual.copy() for run in by_kind["functions"]]
    for run, functions, into in zip(problem.runs, by_kind["functions"], left, strict=True):
        for fold in range(FOLDS):
            rows = measured_fold(run) == fold
            into[rows] += functions.weights[rows] @ weights[fold]
    looks = looked_at(strange, weights)
    for kind, found in (("functions", summed_equations(looks.by_fold)), ("pulses", looks.pulses)):
        replaced = [dataclasses.replace(run, residual=e) for run, e in zip(by_kind[kind], left, strict=True)]
        wanted = equations(replaced, count, shared=kind == "functions")
        np.testing.assert_allclose(found.own, wanted.own, rtol=1e-10, atol=1e-10)
        np.testing.assert_allclose(found.gradient, wanted.gradient, rtol=1e-9, atol=1e-9)
        assert found.squares == pytest.approx(wanted.squares, rel=1e-12)
        for a, b in zip(found.weights, wanted.weights, strict=True):
            np.testing.assert_allclose(a.gradient, b.gradient, rtol=1e-9, atol=1e-9)
            np.testing.assert_allclose(a.hessian, b.hessian, rtol=1e-9, atol=1e-9)
            np.testing.assert_allclose(a.cross, b.cross, rtol=1e-9, atol=1e-9)


def test_one_run_s_derivatives_are_held_at_a_time(strange, monkeypatch):
    """Of each kind of regressors: however many runs there are."""
    made, held = list[weakref.ref](), []

    def watched(*arguments):
        for run in responses(*arguments):
            made.append(weakref.ref(run.weights))
            held.append(sum(weights() is not None for weights in made))
            yield run

    monkeypatch.setattr("drift_drake.gap.identification.model_discrepancy.responses", watched)
    looked_at(strange)
    assert len(made) == 2 * len(strange.problem.runs)
    assert max(held) <= 4  # a run's, and those of the next while they are made


def test_what_a_car_lacks_every_day_raises_the_likelihoods_weight(strange):
    plain, discrepancy = model_discrepancy(strange)
    assert plain < 0.5
    assert plain < discrepancy.tempering <= 1.0
    assert set(discrepancy.forces) == set(FORCE_CHANNELS)
    taken_out = traced(strange.problem.replace(discrepancy=discrepancy))
    nothing = np.zeros(taken_out.nuisances)
    left, before = (flat(p, filter_case(p, nothing, ()).innovations) for p in (taken_out, strange.problem))
    assert np.sum(left**2) < np.sum(before**2)
