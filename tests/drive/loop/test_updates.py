"""Systems on their own: a forced update is the periodic one, and each works under a Simulator without the others."""

from pathlib import Path

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Diagram, LeafSystem

from drift_drake.car.effects.magnitudes import make_effects
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.sensors import SampleAndHold
from drift_drake.drive.learnt.adapter import BayesianAdapter
from drift_drake.drive.learnt.checkpoint import load_model
from drift_drake.drive.learnt.quality import step_model
from drift_drake.drive.loop.actuation import LinearInterpolationActuator
from drift_drake.drive.loop.closed_loop import ClosedLoop, ControlConfig
from drift_drake.drive.loop.faults import ACTUATOR_KINDS, PLAN_KINDS, SENSOR_KINDS, SOLVER_KINDS, Fault
from drift_drake.drive.mpc.controller import MpcController
from drift_drake.drive.mpc.mpc import SolveStatistics
from drift_drake.drive.mpc.plan import Plan
from drift_drake.drive.reference.trajectory import straight_line
from drift_drake.gap.monitoring.in_loop import GapWatch
from drift_drake.gap.monitoring.monitor import make_monitor
from drift_drake.gap.monitoring.watch import WATCHED

PACKAGE = Path(__file__).parents[3] / "drift_drake"
CAR = VehicleParameters()
KINDS = SENSOR_KINDS | PLAN_KINDS | SOLVER_KINDS | ACTUATOR_KINDS
SECONDS = SolveStatistics._fields.index("seconds")  # the one state that a clock gives


def leaves(diagram: Diagram) -> list[LeafSystem]:
    parts = diagram.GetSystems()
    return [leaf for part in parts for leaf in (leaves(part) if isinstance(part, Diagram) else [part])]


@pytest.fixture(scope="module")
def loop() -> ClosedLoop:
    learnt = load_model()
    return ClosedLoop(
        CAR, straight_line(v_start=12.0, v_end=15.0, duration=2.0), step_model(learnt, learnt.prior()),
        make_effects({"steering_delay": 0.03}), control=ControlConfig(horizon=4), adapter=BayesianAdapter(learnt),
        faults=[Fault(kind, 1.0, 0.1, size) for kind, size in KINDS.items()],
        watch=GapWatch(make_monitor(CAR, used=WATCHED), "slow"),
    )  # fmt: skip


def test_every_update_can_be_forced_and_is_then_the_periodic_one(loop: ClosedLoop) -> None:
    root = loop.initial_context(0)
    Simulator(loop.diagram, root).Initialize()
    root.SetTime(0.02)
    tried = []
    for system in leaves(loop.diagram):
        if not type(system).__module__.startswith("drift_drake") or not isinstance(system, LeafSystem):
            continue
        if system.GetUniquePeriodicDiscreteUpdateAttribute() is None:
            continue
        context, forced = system.GetMyContextFromRoot(root), system.AllocateDiscreteVariables()
        system.CalcForcedDiscreteVariableUpdate(context, forced)
        periodic = system.EvalUniquePeriodicDiscreteUpdate(context)
        for group in range(forced.num_groups()):
            one, other = forced.value(group).copy(), periodic.value(group).copy()
            if isinstance(system, MpcController) and one.size == len(SolveStatistics._fields):
                one[SECONDS] = other[SECONDS]
            np.testing.assert_array_equal(one, other, err_msg=system.get_name())
        changed = [np.array_equal(context.get_discrete_state(group).value(), forced.value(group), equal_nan=True)
                   for group in range(forced.num_groups())]  # fmt: skip
        tried += [type(system).__name__] if not all(changed) else []
    assert {"MpcController", "BayesianAdapter", "Screen", "GapMonitor", "CommandLag", "TransportDelay"} <= set(tried)


def test_a_sample_can_be_forced(loop: ClosedLoop) -> None:
    root, other = loop.initial_context(0), loop.initial_context(0)
    (sampler,) = (system for system in leaves(loop.diagram) if isinstance(system, SampleAndHold))
    context = sampler.GetMyContextFromRoot(root)
    state = sampler.GetMyMutableContextFromRoot(other).get_mutable_state()
    sampler.CalcForcedUnrestrictedUpdate(context, state)
    assert np.isfinite(state.get_discrete_state().value()).all()


def test_no_update_is_declared_for_a_simulator_alone() -> None:
    files = [path for path in PACKAGE.rglob("*.py") if "DeclarePeriodicDiscrete" in path.read_text(encoding="utf-8")]
    assert [path.name for path in files] == ["updates.py"]


def test_an_actuator_alone_does_under_forced_updates_what_it_does_under_a_simulator() -> None:
    actuator = LinearInterpolationActuator(CAR, 2)
    plan = Plan(0.05, np.array([[0.0, 0.0], [0.1, 50.0], [0.2, 50.0]])).vector()
    simulator, forced = Simulator(actuator), actuator.CreateDefaultContext()
    for context in (simulator.get_mutable_context(), forced):
        actuator.GetInputPort("plan").FixValue(context, plan)
    for k in range(20):
        forced.SetTime(0.01 * k)
        simulator.AdvanceTo(0.01 * k)
        simulator.AdvancePendingEvents()
        actuator.ExecuteForcedEvents(forced)
        for i in range(actuator.num_output_ports()):
            port = actuator.get_output_port(i)
            found, expected = port.Eval(forced), port.Eval(simulator.get_context())
            np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12, err_msg=port.get_name())
