"""What drivers other than the MPC share: a plan of one row, over and over."""

from abc import abstractmethod

import numpy as np
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

from drift_drake.car.parameters import VehicleParameters
from drift_drake.common.arrays import Array
from drift_drake.common.updates import declare_update
from drift_drake.drive.mpc.plan import Plan, no_plan

ROW_PERIOD = 0.01  # [s]


class RowByRowDriver(LeafSystem):
    """Every 0.01 s a plan of one step of 0.01 s, from the command given last to the new one, begins one period later.

    So the command is continuous, and linear between the rows of a log; it is kept within the car's limits.

    Input port: measured_state [7]. Output port: plan [5], NaN before the first. State: the plan.
    """

    def __init__(self, parameters: VehicleParameters) -> None:
        LeafSystem.__init__(self)
        self._low, self._high = parameters.command_limits()
        self._torque_per_acceleration = parameters.mass * parameters.wheel_radius / parameters.gear_ratio
        self._measured = self.DeclareVectorInputPort("measured_state", 7)
        self._plan = self.DeclareDiscreteState(no_plan(1))
        self.DeclareStateOutputPort("plan", self._plan)
        declare_update(self, ROW_PERIOD, self._update)

    @abstractmethod
    def wanted(self, t: float, measured: Array) -> Array:
        """(delta [rad], tau [N m]) for a time [s], from the measured state [7], before limits."""

    def torque(self, acceleration: float) -> float:
        """[N m] that accelerates the car [m/s^2] where nothing resists."""
        return self._torque_per_acceleration * acceleration

    def command(self, t: float, measured: Array) -> Array:
        """The same within limits."""
        return np.clip(self.wanted(t, measured), self._low, self._high)

    def first(self, t: float, measured: Array) -> Array:
        """The command that the first plan goes on from."""
        return self.command(t, measured)

    def _update(self, context: Context, discrete: DiscreteValues) -> None:
        t, measured = context.get_time(), self._measured.Eval(context)
        plan, start = context.get_discrete_state(self._plan).value(), t + ROW_PERIOD
        last = self.first(t, measured) if np.isnan(plan[0]) else plan[3:]
        new = self.command(start + ROW_PERIOD, measured)
        discrete.set_value(self._plan, Plan(start, np.array([last, new])).vector())
