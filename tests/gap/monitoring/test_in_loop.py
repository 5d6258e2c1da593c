"""The monitor in the closed loop: a change is reported, and the controller takes what is named."""

import numpy as np
import pytest

from drift_drake.car.double_track.parameters import CARS
from drift_drake.car.effects.magnitudes import Effects, make_effects
from drift_drake.car.equations_step import EquationsStepModel
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.single_track.effects_step import EffectsStepModel
from drift_drake.car.step_model import NominalStepModel
from drift_drake.drive.loop.closed_loop import ClosedLoop, ControlConfig
from drift_drake.drive.loop.endings import RunLimits
from drift_drake.drive.loop.faults import Change
from drift_drake.drive.reference.trajectory import figure_8
from drift_drake.gap.monitoring.in_loop import GapWatch, events_of
from drift_drake.gap.monitoring.monitor import make_monitor
from drift_drake.gap.monitoring.watch import WATCHED

VEHICLE = VehicleParameters()
CHANGE = 0.8  # [s]


@pytest.mark.parametrize("model", [EffectsStepModel(VEHICLE, Effects()), EquationsStepModel(CARS["coupe"])])
def test_a_change_is_reported_and_corrected(model):
    """In the model of a car of either kind; the plant is the simulator's car."""
    monitor = make_monitor(VEHICLE, used=WATCHED)
    reference = figure_8(VEHICLE)
    loop = ClosedLoop(VEHICLE, reference, model, Effects(aero_drag=1e-9),
                      control=ControlConfig(horizon=8), watch=GapWatch(monitor, "correct"))  # fmt: skip
    torque = Change(CHANGE, make_effects({"torque_gain_error": -0.2}))
    run = loop.run(loop.initial_context(0), RunLimits(time_factor=2.0 / reference.duration), change=torque)
    reported = events_of(monitor, run.table)
    assert reported[0]["event"] == "change"
    assert CHANGE < reported[0]["t"] < CHANGE + 0.5
    calm = run.table["t"] < CHANGE
    assert (run.table["gap_none"][calm] > 0.9).all()
    probabilities = run.table[[f"gap_{name}" for name in monitor.labels]]
    np.testing.assert_allclose(probabilities.sum(axis=1), 1.0)


def test_a_correction_needs_a_model_that_takes_it(monitor):
    with pytest.raises(ValueError, match="a car with effects as the controller's model"):
        ClosedLoop(VEHICLE, figure_8(VEHICLE), NominalStepModel(VEHICLE), watch=GapWatch(monitor, "correct"))


def test_a_monitor_that_only_watches_changes_nothing():
    reference, model = figure_8(VEHICLE), NominalStepModel(VEHICLE)
    change = Change(0.5, make_effects({"friction_level": -0.3}))
    tables = []
    for monitor in (None, make_monitor(VEHICLE, used=WATCHED)):
        loop = ClosedLoop(VEHICLE, reference, model, Effects(aero_drag=1e-9), control=ControlConfig(horizon=8),
                          watch=monitor and GapWatch(monitor))  # fmt: skip
        tables.append(loop.run(loop.initial_context(0), RunLimits(time_factor=1.0 / reference.duration), change=change))
    off, watched = (run.table.drop(columns="solve_seconds") for run in tables)
    assert off.equals(watched[off.columns])
