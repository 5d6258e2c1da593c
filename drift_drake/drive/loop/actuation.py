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
from drift_drake.common.updates import declare_output, declare_update
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

        self._length = dt * steps  # of a plan [s]
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
        declare_output(self, "command", 2, self._command, now)
        declare_output(self, "command_rate", 2, self._command_rate, now)
        declare_output(self, "saturated", 2, lambda context: [*map(float, self._outside(context))], now)
        declare_output(self, "status", 1, lambda context: [float(self._status(context))], now)
        declare_output(self, "plan_age", 1, lambda context: [self._age(context)], now)
        self.DeclareStateOutputPort("refused", self._refused)

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

    def _outside(self, context: Context) -> list[bool]:
        command = self._unsaturated(context)[:2]
        return [not low <= value <= high for value, (low, high) in zip(command, self.limits, strict=True)]

    def _command(self, context: Context) -> list[float]:
        command = self._unsaturated(context)[:2]
        return [min(max(value, low), high) for value, (low, high) in zip(command, self.limits, strict=True)]

    def _command_rate(self, context: Context) -> list[float]:
        rates = self._unsaturated(context)[2:]
        return [0.0 if outside else rate for rate, outside in zip(rates, self._outside(context), strict=True)]

    def _status(self, context: Context) -> PlanStatus:
        age = self._age(context)
        if age == math.inf:
            return PlanStatus.MISSING
        if age > self._length + TIME_TOLERANCE:
            return PlanStatus.ENDED
        return PlanStatus.LATE if age > self.max_age + TIME_TOLERANCE else PlanStatus.FRESH

    def _age(self, context: Context) -> float:
        t = context.get_time()
        plan = self._plan(context, t)
        return math.inf if plan is None else float(t - plan[0])
