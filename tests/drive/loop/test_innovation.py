"""Readings against what the model makes of the last good one, alone and in the loop."""

import numpy as np
import pytest
from faulted_loops import FAST, PARAMETERS, loop_with

from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.sensors import NoiseLevels
from drift_drake.drive.learnt.adapter import BayesianAdapter
from drift_drake.drive.learnt.checkpoint import load_model
from drift_drake.drive.learnt.quality import step_model
from drift_drake.drive.loop.closed_loop import ClosedLoop
from drift_drake.drive.loop.endings import RunLimits
from drift_drake.drive.loop.faults import Change, parse_fault
from drift_drake.drive.reference.trajectory import Reference
from drift_drake.drive.screening.screen import PERSISTENT, Innovation


@pytest.mark.parametrize("fault", ["spike:1:0.1:1:r", "spike:1:0.1:2:v", "spike:1:0.1:0.3:beta", "spike:1:0.1:30:s"])
def test_a_plausible_reading_that_the_model_does_not_explain_is_screened_out(short: Reference, fault: str) -> None:
    loop = loop_with(short, fault)
    metrics = loop.run(loop.initial_context(0)).metrics()
    assert metrics.disagreeing_readings == 5
    assert "5 disagreeing readings" in metrics.faults()
    assert metrics.outcome == "completed"


def test_readings_that_go_on_to_disagree_are_believed(short: Reference) -> None:
    loop = loop_with(short, "bias:1:99:10:s")
    run = loop.run(loop.initial_context(0))
    refused = run.table["t"][run.table["reading"] > 0.0].to_numpy()
    assert refused[0] == pytest.approx(1.0)
    assert refused[-1] == pytest.approx(1.0 + PERSISTENT - 2.0 * FAST.period)


@pytest.mark.parametrize("fault", ["bias:0.5:3:3:v", "bias:0.5:2:-30:v"])
def test_a_channel_that_lies_is_not_believed_while_the_others_agree(short: Reference, fault: str) -> None:
    loop = loop_with(short, fault, effects=Effects(friction_level=-0.1, mass_error=0.05))
    metrics = loop.run(loop.initial_context(0)).metrics()
    assert metrics.outcome == "stopped safely"
    assert metrics.stopping_from == pytest.approx(0.5 + FAST.patience + FAST.delay, abs=2 * FAST.period)


def test_a_channel_that_lied_is_used_again_once_it_agrees(short: Reference) -> None:
    loop = loop_with(short, "bias:0.5:0.3:3:v")
    table = loop.run(loop.initial_context(0)).table
    refused = table["t"][table["reading"] > 0.0].to_numpy()
    assert refused[0] == pytest.approx(0.5)
    assert refused[-1] == pytest.approx(0.8, abs=3 * FAST.period)


def test_a_change_of_the_car_is_not_screened_out(short: Reference) -> None:
    loop = loop_with(short, effects=Effects(aero_drag=1.0))
    change = Change(1.0, Effects(aero_drag=1.0, friction_level=-0.3, mass_error=0.2, rear_stiffness_error=-0.4))
    assert loop.run(loop.initial_context(0), change=change).metrics().faults() == ""


def test_the_path_position_of_a_closed_path_may_start_anew(short: Reference) -> None:
    innovation = Innovation(PARAMETERS, short.path, NoiseLevels(), 0.02)
    x = np.append(short.state(3.0), 3.0)
    along = np.eye(7)[6]
    assert innovation.distance(x, x + short.path.length * along, 0.02) == pytest.approx(0.0, abs=1e-9)
    assert innovation.distance(x, x + 10.0 * along, 0.02) > innovation.bound


def test_where_the_model_does_not_hold_nothing_is_predicted(short: Reference) -> None:
    innovation = Innovation(PARAMETERS, short.path, NoiseLevels(), 0.02)
    u = np.zeros(2)
    for change in ({1: 1.0}, {3: 0.0}, {4: 18.0}, {0: np.nan}):
        x = np.append(short.state(0.0), 0.0)
        x[list(change)] = list(change.values())
        predicted = innovation.predict(x, u, u)
        assert np.isnan(predicted).all()
        assert innovation.distance(x, predicted, 0.02) == 0.0


def test_the_adapter_never_learns_from_what_was_screened_out(short: Reference) -> None:
    """What is screened out leaves the same belief as readings that never came."""
    learnt = load_model()
    beliefs = []
    for fault in ("spike:0.35:0.12:1:r", "dropout:0.35:0.12"):
        adapter = BayesianAdapter(learnt)
        loop = ClosedLoop(PARAMETERS, short, step_model(learnt, learnt.prior(), "trapezoid"), control=FAST,
                          adapter=adapter, faults=[parse_fault(fault)])  # fmt: skip
        context = loop.initial_context(1)
        run = loop.run(context, RunLimits(time_factor=0.35))
        assert (run.table["reading"] > 0.0).sum() == 6
        of_adapter = adapter.GetMyContextFromRoot(context)
        beliefs.append((adapter.posterior(of_adapter), adapter.GetOutputPort("counters").Eval(of_adapter)))
    (one, counters), (other, others) = beliefs
    np.testing.assert_array_equal(one.mean, other.mean)
    np.testing.assert_array_equal(one.covariance, other.covariance)
    np.testing.assert_array_equal(counters, others)
    assert counters[0] > 0.0
    assert counters[1] == 2.0  # the steps to and from the tick at 0.4 s
