"""The supervisor between plan and actuator: after too long without a valid plan it brings the car to a stop."""

from typing import Any

import numpy as np
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

from drift_drake.control.plan import plan_size
from drift_drake.control.stopping import stopping_command, stopping_plan
from drift_drake.reference.path import Path
from drift_drake.vehicle.parameters import VehicleParameters


class SafeStop(LeafSystem):
    """Hands plans on; once the plan in force is older than `patience`, it stops the car on its path, for good.

    An old plan in force says it all: readings that are none (from which the controller makes no plan), a solver that
    fails, plans that are lost, late, refused or of another clock. Until then the last good plan is followed.

    Input ports: plan [1 + 2 (N + 1)], NaN in its first number where there is none; plan_age [1] and command [2], the
    actuator's; state [7]: (r, v, beta, omega_r, e, dphi, s), estimated where there is no reading.
    Output ports: plan; stopping [1], 1 from the moment of giving up on.
    State in the Context, each `period`: whether the car is being stopped.

    Args:
        steps: N; patience: [s].
    """

    def __init__(
        self, parameters: VehicleParameters, path: Path, steps: int, patience: float = 0.5, period: float = 0.01
    ) -> None:
        LeafSystem.__init__(self)
        self._parameters, self._path, self._steps = parameters, path, steps
        self._patience, self._period = patience, period
        self._plan = self.DeclareVectorInputPort("plan", plan_size(steps))
        self._age = self.DeclareVectorInputPort("plan_age", 1)
        self._command = self.DeclareVectorInputPort("command", 2)
        self._state = self.DeclareVectorInputPort("state", 7)
        self._stopping = self.DeclareDiscreteState(1)
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)
        self.DeclareVectorOutputPort("supervised_plan", plan_size(steps), self._calc)
        self.DeclareStateOutputPort("stopping", self._stopping)

    def stopping(self, context: Context) -> bool:
        """Whether the car is being stopped, from a Context of this system."""
        return bool(context.get_discrete_state(self._stopping).value()[0])

    def _calc(self, context: Context, output: Any) -> None:
        if not self.stopping(context):
            output.SetFromVector(self._plan.Eval(context))
            return
        x = self._state.Eval(context)
        wanted = stopping_command(x[:6], self._path.curvature(float(x[6])), self._parameters)
        plan = stopping_plan(context.get_time(), self._command.Eval(context), wanted, self._steps, self._period)
        output.SetFromVector(plan.vector())

    def _update(self, context: Context, discrete: DiscreteValues) -> None:
        age = np.minimum(self._age.Eval(context)[0], context.get_time())  # without any plan yet, since the start
        if age > self._patience:
            discrete.get_mutable_vector(self._stopping)[0] = 1.0
