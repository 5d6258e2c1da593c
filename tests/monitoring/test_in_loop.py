"""The monitor in the closed loop: a change is told, and the controller takes what is named."""

import numpy as np
import pytest

from drift_drake.control.effects_step import EffectsStepModel
from drift_drake.monitoring.in_loop import events_of
from drift_drake.monitoring.monitor import Monitor, make_monitor
from drift_drake.monitoring.watch import WATCHED
from drift_drake.reference.trajectory import figure_8
from drift_drake.simulation.closed_loop import ClosedLoop, ControlConfig
from drift_drake.simulation.endings import RunLimits
from drift_drake.simulation.faults import Change
from drift_drake.vehicle.effects import Effects, make_effects
from drift_drake.vehicle.parameters import VehicleParameters
from drift_drake.vehicle.step_model import NominalStepModel

VEHICLE = VehicleParameters()
CHANGE = 0.8  # [s]


def test_a_change_is_told_and_corrected():
    reference = figure_8(VEHICLE)
    loop = ClosedLoop(VEHICLE, reference, EffectsStepModel(VEHICLE, Effects()), Effects(aero_drag=1e-9),
                      control=ControlConfig(horizon=8), monitor=make_monitor(VEHICLE, used=WATCHED),
                      policy="correct")  # fmt: skip
    torque = Change(CHANGE, make_effects({"torque_gain_error": -0.2}))
    run = loop.run(loop.initial_context(0), RunLimits(time_factor=2.0 / reference.duration), change=torque)
    assert isinstance(run.monitor, Monitor)
    told = events_of(run.monitor, run.table)
    assert told[0]["event"] == "change"
    assert CHANGE < told[0]["t"] < CHANGE + 0.5
    calm = run.table["t"] < CHANGE
    assert (run.table["gap_none"][calm] > 0.9).all()
    probabilities = run.table[[f"gap_{name}" for name in run.monitor.labels]]
    np.testing.assert_allclose(probabilities.sum(axis=1), 1.0)


def test_a_correction_needs_a_model_that_takes_it(monitor):
    with pytest.raises(ValueError, match="EffectsStepModel"):
        ClosedLoop(VEHICLE, figure_8(VEHICLE), NominalStepModel(VEHICLE), monitor=monitor, policy="correct")


def test_a_monitor_that_only_watches_changes_nothing():
    reference, model = figure_8(VEHICLE), NominalStepModel(VEHICLE)
    change = Change(0.5, make_effects({"friction_level": -0.3}))
    tables = []
    for monitor in (None, make_monitor(VEHICLE, used=WATCHED)):
        loop = ClosedLoop(VEHICLE, reference, model, Effects(aero_drag=1e-9), control=ControlConfig(horizon=8),
                          monitor=monitor)  # fmt: skip
        tables.append(loop.run(loop.initial_context(0), RunLimits(time_factor=1.0 / reference.duration), change=change))
    off, watched = (run.table.drop(columns="solve_seconds") for run in tables)
    assert off.equals(watched[off.columns])
