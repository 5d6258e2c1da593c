"""GapMonitor in a diagram: ports, the update law, and replay to the bit from a cloned Context."""

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from drift_drake.gap.monitoring.in_loop import GapMonitor
from drift_drake.gap.monitoring.watch import rows_of

ROWS = 65


@pytest.fixture(scope="module")
def diagram(monitor, changed_run, commands):
    builder = DiagramBuilder()
    system = builder.AddNamedSystem("monitor", GapMonitor(monitor))
    measured = np.stack([changed_run.column(name) for name in ("r", "v", "beta", "omega_r")], axis=1)
    measured = np.concatenate([measured, np.zeros((len(measured), 3))], axis=1)[:ROWS]
    for name, values in (("measured_state", measured), ("command", commands[:ROWS])):
        trajectory = PiecewisePolynomial.FirstOrderHold(changed_run.t[:ROWS], values.T)
        builder.Connect(builder.AddSystem(TrajectorySource(trajectory)).get_output_port(), system.GetInputPort(name))
    return builder.Build(), system


def test_ports(monitor):
    system = GapMonitor(monitor)
    ports = {system.get_input_port(i).get_name(): system.get_input_port(i).size() for i in range(3)}
    assert ports == {"measured_state": 7, "command": 2, "log_row": 10}
    assert system.GetOutputPort("posterior").size() == len(monitor.labels)
    assert monitor.labels[0] == "none"
    assert monitor.labels[-1] == "unknown"
    assert not system.HasAnyDirectFeedthrough()
    context = system.CreateDefaultContext()
    assert system.GetOutputPort("posterior").Eval(context)[0] == 1.0
    assert system.GetOutputPort("trusted").Eval(context)[0] == 1.0
    assert np.isnan(system.GetOutputPort("onset").Eval(context)[0])


def test_the_system_agrees_with_the_functions(diagram, monitor, changed_run):
    whole, system = diagram
    simulator = Simulator(whole)
    simulator.AdvanceTo(float(changed_run.t[ROWS - 1]) - 0.001)
    context = system.GetMyContextFromRoot(simulator.get_context())
    state = monitor.start()
    for row in list(rows_of(changed_run))[: ROWS - 1]:
        state = monitor.after_row(state, row.y, row.command, row.t)
    found = system.state(context)
    np.testing.assert_allclose(found.bank.z, state.bank.z, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(system.GetOutputPort("posterior").Eval(context), state.verdict[:-4], atol=1e-6)
    assert np.sum(system.GetOutputPort("posterior").Eval(context)) == pytest.approx(1.0)


def test_a_cloned_context_replays_to_the_bit(diagram):
    whole, system = diagram
    simulator = Simulator(whole)
    simulator.AdvanceTo(0.305)
    clone = simulator.get_context().Clone()
    finals = []
    for context in (simulator.get_mutable_context(), clone):
        again = Simulator(whole, context)
        again.AdvanceTo(0.6)
        values = system.GetMyContextFromRoot(context).get_discrete_state()
        finals.append([values.get_vector(i).value() for i in range(values.num_groups())])
    for a, b in zip(*finals, strict=True):
        np.testing.assert_array_equal(a, b)
