"""The low-level controller that executes plans by linear interpolation (Section II of the paper)."""

import enum
import math
from typing import Any

import numpy as np
from pydrake.common.value import AbstractValue
from pydrake.systems.framework import Context, DiscreteValues, EventStatus, LeafSystem, ValueProducer

from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.single_track.motion import INPUTS
from drift_drake.common.arrays import Array
from drift_drake.common.updates import declare_update
from drift_drake.drive.mpc.plan import TIME_TOLERANCE, interpolate_plan, no_plan


class PlanStatus(enum.IntEnum):
    """What the actuator is executing."""

    MISSING = 0  # no plan has begun: the initial command is held
    FRESH = 1
    LATE = 2  # the plan in force is older than `max_age`; it is still followed
    ENDED = 3  # past the plan's end: its last command is held


class LinearInterpolationActuator(LeafSystem):
    """Turns the controller's latest plan into commands that are linear between its points (section II of the paper).

    The plan's port is sampled each `period`, into the Context. A plan comes into force at its start time; until then
    the plan before it is followed (so a plan may be sent ahead of its time). Choose the plan's start times as
    multiples of `period`, and the simulator's steps end at the kinks of the command.

    A plan that holds anything not finite, or that starts before the newest one taken, is refused and counted, and the
    plan held is kept: such numbers never reach the car.

    Input ports:
        plan: [t_start, delta_0, tau_0, ..., delta_N, tau_N], spaced by `dt`. No plan where t_start is NaN, or the port
            is left unconnected.

    Output ports (functions of the Context's time and of the plan held):
        command: u(t) = (delta [rad], tau [N m]), within the vehicle's limits.
        command_rate: u_dot(t) [rad/s], [N m/s]; zero in a saturated channel.
        saturated: 1 for each channel where the plan asked for more than the limits, else 0.
        status: `PlanStatus`, as a number.
        plan_age: time since the start of the plan in force [s]; infinite while there is none.
        refused: how many samples of the plan's port were refused so far.

    Args:
        parameters: the vehicle, for its steering and torque limits.
        steps: N, the number of steps of a plan.
        dt: the plan's spacing [s].
        period: of the sampling of the plan's port [s].
        max_age: age from which a plan is LATE [s].
        initial_command: (delta [rad], tau [N m]) held while no plan has begun; within the limits.

    Raises:
        ValueError: an initial command beyond the limits.

    Examples:
        >>> LinearInterpolationActuator(car, steps=25).GetInputPort("plan").size()
        53
    """

    def __init__(
        self,
        parameters: VehicleParameters,
        steps: int,
        dt: float = 0.1,
        period: float = 0.01,
        max_age: float = 0.1,
        initial_command: tuple[float, float] = (0.0, 0.0),
    ) -> None:
        LeafSystem.__init__(self)
        self.dt, self.period, self.max_age = dt, period, max_age
        self.limits = (
            (-parameters.steering_limit, parameters.steering_limit),
            (parameters.torque_min, parameters.torque_max),
        )
        for name, value, (low, high) in zip(INPUTS, initial_command, self.limits, strict=True):
            if not low <= value <= high:
                raise ValueError(f"initial_command: {name} is {value:g}; keep it within {low:g} to {high:g}")
        self._initial_command = (float(initial_command[0]), float(initial_command[1]))

        self._nothing = nothing = no_plan(steps)
        self._port = self.DeclareVectorInputPort("plan", nothing.size)
        self._in_force = self.DeclareDiscreteState(nothing)  # the plan being followed
        self._waiting = self.DeclareDiscreteState(nothing)  # a newer one whose start lies ahead
        self._refused = self.DeclareDiscreteState(1)
        declare_update(self, period, self._take_plan)

        plans = {self.discrete_state_ticket(self._in_force), self.discrete_state_ticket(self._waiting)}
        # Read once for all commands until the next sampling, of which an integrator asks for several.
        producer = ValueProducer(allocate=lambda: AbstractValue.Make(()), calc=self._copy_plans)
        self._plans = self.DeclareCacheEntry("plans", producer, plans)
        now = {self.time_ticket(), self._plans.ticket()}
        self.DeclareVectorOutputPort("command", 2, self._calc_command, prerequisites_of_calc=now)
        self.DeclareVectorOutputPort("command_rate", 2, self._calc_command_rate, prerequisites_of_calc=now)
        self.DeclareVectorOutputPort("saturated", 2, self._calc_saturated, prerequisites_of_calc=now)
        self.DeclareVectorOutputPort("status", 1, self._calc_status, prerequisites_of_calc=now)
        self.DeclareVectorOutputPort("plan_age", 1, self._calc_plan_age, prerequisites_of_calc=now)
        self.DeclareVectorOutputPort(
            "refused", 1, self._calc_refused, prerequisites_of_calc={self.discrete_state_ticket(self._refused)}
        )

    def _take_plan(self, context: Context, discrete: DiscreteValues) -> EventStatus:
        t = context.get_time()
        in_force, waiting = self._plans.Eval(context)
        begun = waiting[0] <= t + TIME_TOLERANCE
        plan = self._port.Eval(context) if self._port.HasValue(context) else self._nothing
        news = not math.isnan(plan[0])
        if not begun and not (news and (not math.isnan(waiting[0]) or (plan != in_force).any())):
            return EventStatus.DidNothing()  # so that what was computed from the plans still holds
        if begun:
            discrete.set_value(self._in_force, waiting)
            discrete.set_value(self._waiting, self._nothing)
        if news:
            newest = np.fmax(waiting[0], in_force[0])
            if not np.isfinite(plan).all() or plan[0] < newest - TIME_TOLERANCE:
                discrete.get_mutable_vector(self._refused)[0] += 1.0
            else:
                discrete.set_value(self._in_force if plan[0] <= t + TIME_TOLERANCE else self._waiting, plan)
        return EventStatus.Succeeded()

    def _copy_plans(self, context: Context, value: Any) -> None:
        """(plan followed, plan that waits), as arrays."""
        value.set_value(tuple(context.get_discrete_state(i).CopyToVector() for i in (self._in_force, self._waiting)))

    def _plan(self, context: Context, t: float) -> Array | None:
        """The plan in force at the Context's time t, if any."""
        in_force, waiting = self._plans.Eval(context)
        if waiting[0] <= t + TIME_TOLERANCE:
            return waiting
        return None if math.isnan(in_force[0]) else in_force

    def _unsaturated(self, context: Context) -> tuple[float, float, float, float]:
        t = context.get_time()
        plan = self._plan(context, t)
        if plan is None:
            return (*self._initial_command, 0.0, 0.0)
        return interpolate_plan(plan, t, self.dt)

    def _outside(self, command: tuple[float, ...]) -> list[bool]:
        return [not low <= value <= high for value, (low, high) in zip(command[:2], self.limits, strict=True)]

    def _calc_command(self, context: Context, output: Any) -> None:
        delta, tau, _, _ = self._unsaturated(context)
        (delta_min, delta_max), (tau_min, tau_max) = self.limits
        output[0], output[1] = min(max(delta, delta_min), delta_max), min(max(tau, tau_min), tau_max)

    def _calc_command_rate(self, context: Context, output: Any) -> None:
        command = self._unsaturated(context)
        for i, outside in enumerate(self._outside(command)):
            output[i] = 0.0 if outside else command[2 + i]

    def _calc_saturated(self, context: Context, output: Any) -> None:
        output.SetFromVector([float(outside) for outside in self._outside(self._unsaturated(context))])

    def _calc_status(self, context: Context, output: Any) -> None:
        t = context.get_time()
        plan = self._plan(context, t)
        if plan is None:
            status = PlanStatus.MISSING
        else:
            age = t - plan[0]
            length = self.dt * ((len(plan) - 1) // 2 - 1)
            if age > length + TIME_TOLERANCE:
                status = PlanStatus.ENDED
            elif age > self.max_age + TIME_TOLERANCE:
                status = PlanStatus.LATE
            else:
                status = PlanStatus.FRESH
        output[0] = float(status)

    def _calc_plan_age(self, context: Context, output: Any) -> None:
        t = context.get_time()
        plan = self._plan(context, t)
        output[0] = math.inf if plan is None else t - plan[0]

    def _calc_refused(self, context: Context, output: Any) -> None:
        output[0] = context.get_discrete_state(self._refused).value()[0]
