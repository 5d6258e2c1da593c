"""VehiclePlant integrated: schemes agree, runs replay, the specification's run stays true."""

import numpy as np
import pandas as pd
import pytest
from plant_bench import ACTUATION, GRIP, MANY_EFFECTS, PARAMETERS, STATE, s_bend, simulated, steered
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import LogVectorOutput, TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.on_path import PLANT_STATES
from drift_drake.car.single_track.motion import derivatives
from drift_drake.car.single_track.motion_with_effects import motion_with_effects, settled_internal_states
from drift_drake.car.single_track.plant import (
    VehiclePlant,
)


@pytest.mark.parametrize("effects", [Effects(), MANY_EFFECTS])
def test_error_controlled_and_fixed_step_integrators_agree(effects):
    plant = VehiclePlant(PARAMETERS, effects, s_bend())
    diagram, log = steered(plant, 4.0)
    runs = []
    for arguments in ({"accuracy": 1e-8}, {"step": 1e-3}, {"scheme": "runge_kutta5", "accuracy": 1e-9}):
        context = diagram.CreateDefaultContext()
        plant.set_initial(plant.GetMyMutableContextFromRoot(context), (0.0, 10.0, 0.0, 10.0, 0.3, 0.05))
        simulated(diagram, context, 4.0, **arguments)
        runs.append(log.FindLog(context).data())
    assert runs[0].shape[1] == 401
    np.testing.assert_allclose(runs[1], runs[0], rtol=0.0, atol=1e-5)
    np.testing.assert_allclose(runs[2], runs[0], rtol=0.0, atol=1e-5)


def test_grip_run_of_the_specification_stays_true_from_its_first_row():
    if not GRIP.exists():
        pytest.skip(f"{GRIP} is not here")
    table = pd.read_csv(GRIP)
    builder = DiagramBuilder()
    plant = builder.AddNamedSystem("plant", VehiclePlant(PARAMETERS))
    commands = PiecewisePolynomial.FirstOrderHold(table["t"], table[["delta_cmd", "tau_cmd"]].to_numpy().T)
    source = builder.AddNamedSystem("command", TrajectorySource(commands))
    builder.Connect(source.get_output_port(), plant.GetInputPort("actuation"))
    log = LogVectorOutput(plant.GetOutputPort("full_state"), builder, 0.01)
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    first = table.iloc[0]
    plant.set_initial(
        plant.GetMyMutableContextFromRoot(context), (first.r, first.v, first.beta, first.omega_r, 0.0, first.beta)
    )
    simulated(diagram, context, table["t"].iloc[-1], scheme="runge_kutta5", step=1e-3)
    data = log.FindLog(context).data()
    for name in ("r", "v", "beta", "omega_r", "x", "y", "psi"):
        error = np.abs(data[PLANT_STATES.index(name)] - table[name]).max()
        assert error < 1e-4, f"{name} is {error:.2g} off"


def test_cloned_context_replays_to_the_bit():
    plant = VehiclePlant(PARAMETERS, MANY_EFFECTS, s_bend())
    diagram, _ = steered(plant, 3.0)
    context = diagram.CreateDefaultContext()
    plant.set_initial(plant.GetMyMutableContextFromRoot(context), (0.0, 10.0, 0.0, 10.0, 0.3, 0.05))
    simulated(diagram, context, 1.0)
    clone = context.Clone()
    ends = []
    for one in (context, clone):
        simulated(diagram, one, 2.0)
        ends.append(plant.GetMyContextFromRoot(one).get_continuous_state_vector().CopyToVector())
    np.testing.assert_array_equal(ends[0], ends[1])


def test_all_zero_effects_are_the_nominal_motion():
    internal = settled_internal_states(*STATE[:4], *ACTUATION, PARAMETERS.constants(), Effects())
    changed, _ = motion_with_effects(*STATE[:4], 0.3, internal, *ACTUATION, PARAMETERS.constants(), Effects())
    nominal = derivatives(STATE, ACTUATION, 0.0, PARAMETERS.constants())
    np.testing.assert_allclose(changed[:4], nominal[:4], rtol=1e-14)
