"""The low-level controller: linear interpolation, limits, and plans that are late, missing, over or not numbers."""

import math

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder, LeafSystem

from drift_drake.car.parameters import VehicleParameters
from drift_drake.drive.loop.actuation import LinearInterpolationActuator, PlanStatus
from drift_drake.drive.mpc.plan import interpolate_plan, plan_size

PARAMETERS = VehicleParameters()
STEPS = 4
COMMANDS = np.array([[0.0, 10.0], [0.1, 30.0], [0.05, 20.0], [-0.2, 60.0], [-0.1, 40.0]])


def plan_at(t_start, commands=COMMANDS):
    return np.concatenate([[t_start], np.ravel(commands)])


NO_PLAN = np.full(plan_size(STEPS), np.nan)


class Planner(LeafSystem):
    """Sends the last plan of a list of (time, plan) whose time has come."""

    def __init__(self, sendings):
        LeafSystem.__init__(self)
        self._sendings = sendings
        self.DeclareVectorOutputPort("plan", plan_size(STEPS), self._calc, prerequisites_of_calc={self.time_ticket()})

    def _calc(self, context, output):
        sent = [plan for time, plan in self._sendings if time <= context.get_time() + 1e-9]
        output.SetFromVector(sent[-1] if sent else NO_PLAN)


class Run:
    """An actuator fed by a planner, stepped to the times asked for."""

    def __init__(self, sendings, **options):
        builder = DiagramBuilder()
        self.actuator = builder.AddNamedSystem("actuator", LinearInterpolationActuator(PARAMETERS, STEPS, **options))
        planner = builder.AddNamedSystem("planner", Planner(sendings))
        builder.Connect(planner.get_output_port(), self.actuator.get_input_port())
        diagram = builder.Build()
        self.simulator = Simulator(diagram)

    def at(self, t):
        """Steps to t, the updates of that time included."""
        self.simulator.AdvanceTo(t)
        self.simulator.AdvancePendingEvents()
        return self

    def read(self, name):
        context = self.actuator.GetMyContextFromRoot(self.simulator.get_context())
        value = self.actuator.GetOutputPort(name).Eval(context)
        return value.tolist() if isinstance(value, np.ndarray) else value

    @property
    def command(self):
        return self.read("command")

    @property
    def status(self):
        return PlanStatus(int(self.read("status")[0]))


def test_interpolation_is_the_papers():
    plan = plan_at(2.0)
    for k in range(STEPS):
        rate = (COMMANDS[k + 1] - COMMANDS[k]) / 0.1
        for part in (0.0, 0.3, 0.99):
            u = interpolate_plan(plan, 2.0 + 0.1 * (k + part), 0.1)
            np.testing.assert_allclose(u[:2], COMMANDS[k] + part * 0.1 * rate, rtol=1e-12, atol=1e-12)
            np.testing.assert_allclose(u[2:], rate, rtol=1e-12)


def test_interpolation_holds_beyond_both_ends():
    plan = plan_at(2.0)
    assert interpolate_plan(plan, 1.0, 0.1) == (0.0, 10.0, 0.0, 0.0)
    assert interpolate_plan(plan, 2.4, 0.1) == (-0.1, 40.0, 0.0, 0.0)
    assert interpolate_plan(plan, 9.0, 0.1) == (-0.1, 40.0, 0.0, 0.0)


def test_rate_at_a_knot_is_the_next_steps_also_with_rounded_times():
    for k in range(STEPS):
        rate = (COMMANDS[k + 1] - COMMANDS[k]) / 0.1
        for t in (0.3 + k * 0.1, math.nextafter(0.3 + k * 0.1, 0.0), round(100 * (0.3 + k * 0.1)) * 0.01):
            u = interpolate_plan(plan_at(0.3), t, 0.1)
            np.testing.assert_allclose(u[2:], rate, rtol=1e-9)
            np.testing.assert_allclose(u[:2], COMMANDS[k], rtol=1e-9, atol=1e-9)


def test_port_sizes_and_names():
    actuator = LinearInterpolationActuator(PARAMETERS, 25)
    assert (actuator.get_input_port().get_name(), actuator.get_input_port().size()) == ("plan", 53)
    names = [actuator.get_output_port(i).get_name() for i in range(actuator.num_output_ports())]
    assert names == ["command", "command_rate", "saturated", "status", "plan_age", "refused"]
    assert not actuator.HasAnyDirectFeedthrough()


def test_plan_is_followed_from_its_start():
    run = Run([(0.0, plan_at(0.0))])
    for t in (0.0, 0.05, 0.13, 0.27, 0.399):
        run.at(t)
        expected = interpolate_plan(plan_at(0.0), t, 0.1)
        assert run.command == pytest.approx(expected[:2])
        assert run.read("command_rate") == pytest.approx(expected[2:])
        assert run.read("plan_age") == pytest.approx([t])
    assert run.read("refused") == [0.0]


def test_a_newer_plan_replaces_the_one_before():
    newer = plan_at(0.1, COMMANDS + np.array([0.01, 5.0]))
    run = Run([(0.0, plan_at(0.0)), (0.1, newer)])
    assert run.at(0.09).command == pytest.approx(interpolate_plan(plan_at(0.0), 0.09, 0.1)[:2])
    assert run.at(0.1).command == pytest.approx([0.01, 15.0])
    assert run.at(0.17).command == pytest.approx(interpolate_plan(newer, 0.17, 0.1)[:2])
    assert run.status == PlanStatus.FRESH


def test_plan_is_held_between_samples_of_its_port():
    run = Run([(0.0, plan_at(0.0)), (0.013, plan_at(0.01, COMMANDS + np.array([0.01, 5.0])))])
    assert run.at(0.0199).command == pytest.approx(interpolate_plan(plan_at(0.0), 0.0199, 0.1)[:2])
    assert run.at(0.02).read("plan_age") == pytest.approx([0.01])


def test_command_is_held_past_the_plans_end():
    run = Run([(0.0, plan_at(0.0))])
    assert run.at(0.4).status == PlanStatus.LATE
    assert run.at(0.41).status == PlanStatus.ENDED
    assert run.at(3.0).command == [-0.1, 40.0]
    assert run.read("command_rate") == [0.0, 0.0]
    assert run.status == PlanStatus.ENDED


def test_without_a_plan_the_initial_command_is_held():
    run = Run([], initial_command=(0.05, 20.0))
    run.at(0.5)
    assert run.command == [0.05, 20.0]
    assert run.read("command_rate") == [0.0, 0.0]
    assert run.status == PlanStatus.MISSING
    assert run.read("plan_age") == [math.inf]
    assert run.read("refused") == [0.0]


def test_an_unconnected_port_is_a_missing_plan():
    actuator = LinearInterpolationActuator(PARAMETERS, STEPS)
    simulator = Simulator(actuator)
    simulator.AdvanceTo(0.1)
    assert actuator.GetOutputPort("status").Eval(simulator.get_context()) == [PlanStatus.MISSING]


def test_a_plan_that_stops_coming_is_late():
    run = Run([(0.0, plan_at(0.0))], max_age=0.15)
    assert run.at(0.15).status == PlanStatus.FRESH
    assert run.at(0.16).status == PlanStatus.LATE
    assert run.command == pytest.approx(interpolate_plan(plan_at(0.0), 0.16, 0.1)[:2])


def test_a_plan_that_arrives_late_is_entered_where_it_should_be():
    run = Run([(0.2, plan_at(0.0))])
    assert run.at(0.19).status == PlanStatus.MISSING
    assert run.at(0.2).command == pytest.approx(interpolate_plan(plan_at(0.0), 0.2, 0.1)[:2])
    assert run.status == PlanStatus.LATE


def test_a_plan_of_the_future_waits_for_its_time():
    coming = plan_at(0.15, COMMANDS + np.array([0.1, 50.0]))
    run = Run([(0.0, plan_at(0.0)), (0.05, coming)])
    assert run.at(0.149).command == pytest.approx(interpolate_plan(plan_at(0.0), 0.149, 0.1)[:2])
    assert run.at(0.15).command == pytest.approx([0.1, 60.0])
    assert run.read("plan_age") == pytest.approx([0.0], abs=1e-12)


def test_a_plan_of_the_future_begins_also_between_samples():
    run = Run([(0.0, plan_at(0.055))])
    assert run.at(0.054).status == PlanStatus.MISSING
    assert run.command == [0.0, 0.0]
    assert run.at(0.057).status == PlanStatus.FRESH
    assert run.command == pytest.approx(interpolate_plan(plan_at(0.055), 0.057, 0.1)[:2])


def test_plans_that_always_lie_ahead_still_come_into_force():
    """A controller that plans from the next sample on sends a new future with each sample."""
    sendings = [(0.01 * k, plan_at(0.01 * (k + 1), np.full((5, 2), [0.001 * k, k]))) for k in range(20)]
    run = Run(sendings)
    assert run.at(0.1).command == pytest.approx([0.009, 9.0])
    assert run.at(0.15).command == pytest.approx([0.014, 14.0])
    assert run.status == PlanStatus.FRESH


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("place", [1, 6])
def test_a_plan_with_anything_not_finite_is_refused_and_counted(bad, place):
    broken = plan_at(0.1)
    broken[place] = bad
    run = Run([(0.0, plan_at(0.0)), (0.1, broken)])
    run.at(0.12)
    assert run.read("refused") == [3.0]  # at 0.10, 0.11 and 0.12 s
    assert run.command == pytest.approx(interpolate_plan(plan_at(0.0), 0.12, 0.1)[:2])


def test_a_plan_that_starts_at_infinity_is_refused():
    broken = plan_at(math.inf)
    run = Run([(0.0, broken)])
    assert run.at(0.0).read("refused") == [1.0]
    assert run.status == PlanStatus.MISSING


def test_a_plan_older_than_the_one_in_force_is_refused():
    run = Run([(0.0, plan_at(0.0)), (0.1, plan_at(0.1)), (0.2, plan_at(0.05))])
    run.at(0.2)
    assert run.read("refused") == [1.0]
    assert run.read("plan_age") == pytest.approx([0.1])


def test_the_plan_in_force_sent_again_changes_nothing_and_is_refused_while_a_newer_one_is_in_force():
    changed = plan_at(0.0, np.add(COMMANDS, [0.01, 1.0]))
    run = Run([(0.0, plan_at(0.0)), (0.03, changed), (0.05, plan_at(0.08)), (0.06, changed)])
    assert run.at(0.02).command == pytest.approx(interpolate_plan(plan_at(0.0), 0.02, 0.1)[:2])
    assert run.at(0.05).command == pytest.approx(interpolate_plan(changed, 0.05, 0.1)[:2])
    assert run.read("refused") == [0.0]
    assert run.at(0.07).read("refused") == [2.0]  # the newer one waits until 0.08 s
    assert run.at(0.075).command == pytest.approx(interpolate_plan(changed, 0.075, 0.1)[:2])
    assert run.at(0.085).command == pytest.approx(interpolate_plan(plan_at(0.08), 0.085, 0.1)[:2])


def test_a_plan_that_is_lost_leaves_the_old_one_in_force():
    run = Run([(0.0, plan_at(0.0)), (0.05, NO_PLAN)])
    assert run.at(0.1).command == pytest.approx([0.1, 30.0])
    assert run.read("refused") == [0.0]


def test_commands_are_saturated_and_it_is_said():
    commands = np.array([[0.6, 400.0], [0.7, 500.0], [0.5, 300.0], [-0.9, -100.0], [0.0, 0.0]])
    run = Run([(0.0, plan_at(0.0, commands))])
    run.at(0.03)
    assert run.read("saturated") == [0.0, 0.0]
    run.at(0.09)
    assert run.command == [PARAMETERS.steering_limit, PARAMETERS.torque_max]
    assert run.read("saturated") == [1.0, 1.0]
    assert run.read("command_rate") == [0.0, 0.0]
    run.at(0.25)
    assert run.read("saturated") == [0.0, 0.0]
    run.at(0.3)
    assert run.command == [-PARAMETERS.steering_limit, PARAMETERS.torque_min]
    assert run.read("saturated") == [1.0, 1.0]


def test_one_saturated_channel_leaves_the_other_alone():
    run = Run([(0.0, plan_at(0.0, COMMANDS + np.array([1.0, 0.0])))])
    run.at(0.05)
    assert run.command == pytest.approx([PARAMETERS.steering_limit, 20.0])
    assert run.read("saturated") == [1.0, 0.0]
    assert run.read("command_rate") == pytest.approx([0.0, 200.0])


def test_an_initial_command_beyond_the_limits():
    with pytest.raises(ValueError, match="initial_command: tau is 500; keep it within -50 to 450"):
        LinearInterpolationActuator(PARAMETERS, STEPS, initial_command=(0.0, 500.0))


def test_a_cloned_context_goes_on_alike():
    run = Run([(0.0, plan_at(0.0)), (0.05, plan_at(0.15))])
    run.at(0.12)
    clone = run.simulator.get_context().Clone()
    other = Simulator(run.simulator.get_system(), clone)
    other.Initialize()
    other.AdvanceTo(0.18)
    run.at(0.18)
    command = run.actuator.GetOutputPort("command").Eval(run.actuator.GetMyContextFromRoot(clone))
    assert command.tolist() == run.command
