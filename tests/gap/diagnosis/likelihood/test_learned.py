"""The learnt model's word on a case: held-out blocks are not adapted to, missing columns and other cars are said."""

import dataclasses

import numpy as np
import pytest

from drift_drake.car.parameters import VehicleParameters
from drift_drake.drive.learnt.command_lag import LAGGED, lagged_commands
from drift_drake.gap.diagnosis.likelihood.learned import CELLS, _Sampled, learned
from drift_drake.gap.estimation.make_problem import make_problem
from drift_drake.gap.estimation.reduction import FOLDS, without_effects

VEHICLE = VehicleParameters()


@pytest.fixture(scope="module")
def problem(stiffness_case):
    return make_problem(stiffness_case[1], VEHICLE)


@pytest.fixture(scope="module")
def before(problem):
    return without_effects(problem, None)


def test_the_share_is_of_the_gap_between_nominal_and_floor(problem, before):
    floor = [0.01 * b for b in before]
    found = learned(problem, before, floor)
    assert found.error_floor == pytest.approx(0.01 * found.error_nominal)
    assert -1.0 <= found.share <= 1.0
    assert found.share > found.share_unadapted or found.share == -1.0
    assert f"least sure at {found.regions[0]}" in found.sentence
    count = np.array(found.map["count"])
    assert count.shape == (CELLS, CELLS)
    assert count.sum() == sum(len(_Sampled(run).samples(None).x) for run in problem.runs)
    assert np.min(found.map["deviation"]) >= 1.0


def test_no_sample_that_is_adapted_to_touches_the_fold(problem):
    run = _Sampled(problem.runs[0])
    counts = [len(run.samples(fold).x) for fold in range(FOLDS)]
    everything = run.samples(None)
    assert min(counts) < len(everything.x)
    for fold in range(FOLDS):
        kept = run.samples(fold)
        held = run.run.y[run.folds == fold, :4]
        for states in (kept.x[:, :4], kept.x_next[:, :4]):
            assert not (states[:, None] == held[None]).all(axis=-1).any()


def test_the_samples_know_the_runs_lagged_commands(problem):
    run = problem.runs[0]
    samples = _Sampled(run).samples(None)
    commands = np.column_stack([run.delta, run.tau])
    lagged = lagged_commands(run.period * np.arange(len(commands)), commands)
    for states, inputs in ((samples.x, samples.u), (samples.x_next, samples.u_next)):
        together = np.hstack([inputs, states[:, LAGGED]])
        assert (together[:, None] == np.hstack([commands, lagged])[None]).all(axis=-1).any(axis=1).all()


def test_missing_columns_are_said_in_a_sentence(stiffness_case):
    runs = [run.without("beta") for run in stiffness_case[1]]
    assert learned(make_problem(runs, VEHICLE), [], []).sentence == (
        "The learnt model needs beta, which these logs lack."
    )


def test_another_kind_of_car_is_said_in_a_sentence(problem):
    toy = dataclasses.replace(problem, nominal=VEHICLE.replace(mass=3.0).constants())
    assert "another kind of car" in learned(toy, [], []).sentence
