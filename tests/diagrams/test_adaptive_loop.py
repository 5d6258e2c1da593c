"""The closed loop with the learnt model, adapting and not."""

import dataclasses

import numpy as np
import pandas as pd
import pytest

from diagrams.closed_loop import ClosedLoop, ControlConfig
from drift_drake.drives.vehicles import draw_effects
from drift_drake.model.adapter import MEAN_COUNT, BayesianAdapter
from drift_drake.model.bayesian_step import BayesianStepModel
from drift_drake.model.checkpoint import load
from drift_drake.reference.trajectory import figure_8
from drift_drake.vehicle.parameters import VehicleParameters

CONTROL = ControlConfig(horizon=15, period=0.02, delay=0.02)


@pytest.fixture(scope="module")
def adaptive() -> tuple[ClosedLoop, BayesianAdapter]:
    learnt, parameters = load(), VehicleParameters()
    model = BayesianStepModel(learnt.network, learnt.prior().mean, learnt.vehicle.constants(), path_step="trapezoid")
    adapter = BayesianAdapter(learnt)
    reference = dataclasses.replace(figure_8(parameters), distance=35.0)
    effects = draw_effects("train", 0, seed=0)
    return ClosedLoop(parameters, reference, model, effects, control=CONTROL, adapter=adapter), adapter


def posterior_mean(adaptive: tuple[ClosedLoop, BayesianAdapter], frozen: bool) -> tuple[np.ndarray, pd.DataFrame]:
    """theta at the end of a drive, and the drive's table."""
    loop, adapter = adaptive
    context = loop.initial_context(seed=1)
    adapter.set_frozen(adapter.GetMyMutableContextFromRoot(context), frozen)
    run = loop.run(context)
    theta = adapter.GetOutputPort("posterior_mean").Eval(adapter.GetMyContextFromRoot(context))
    return theta.copy(), run.table.drop(columns="solve_seconds")


def test_the_controller_follows_the_adapter(adaptive: tuple[ClosedLoop, BayesianAdapter]) -> None:
    prior = load().prior().mean.ravel()
    assert prior.size == MEAN_COUNT
    held, without = posterior_mean(adaptive, frozen=True)
    moved, with_adaptation = posterior_mean(adaptive, frozen=False)
    np.testing.assert_array_equal(held, prior)
    assert np.abs(moved - prior).max() > 1e-3
    # The commands differ as soon as the first sample is in, and not before.
    count = min(len(without), len(with_adaptation))
    differ = (without["delta"].to_numpy()[:count] != with_adaptation["delta"].to_numpy()[:count]).nonzero()[0]
    first = without["t"].iloc[differ[0]]
    assert 0.1 < first < 0.3


def test_an_adapting_loop_replays_to_the_bit(adaptive: tuple[ClosedLoop, BayesianAdapter]) -> None:
    (first_theta, first), (second_theta, second) = (posterior_mean(adaptive, frozen=False) for _ in range(2))
    np.testing.assert_array_equal(first_theta, second_theta)
    pd.testing.assert_frame_equal(first, second, check_exact=True)
