"""A controller of the user's own: what it has to have, and the system that it becomes in a diagram."""

import time
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

from drift_drake.arrays import Array
from drift_drake.control.mpc import NoPlanError, SolveStatistics
from drift_drake.control.plan import DT, Plan, no_plan
from drift_drake.errors import DriftDrakeError
from drift_drake.vehicle.bicycle import INPUTS


class InvalidPlanError(DriftDrakeError, ValueError):
    """What a controller gave is neither a plan nor a command; the message says what it gave."""


class Controller(Protocol):
    """What `ClosedLoop` takes in place of the predictive controller: a function of what is measured now.

    It keeps nothing from one call to the next, so that runs replay from their seed. A controller with states of its own
    is a Drake system that keeps them in the Context: see the page on own controllers.
    """

    def evaluate(self, x: Array, s: float, t: float) -> Plan | ArrayLike:
        """What to do from now on.

        Args:
            x: measured (r [rad/s], v [m/s], beta [rad], omega_r [m/s], e [m], dphi [rad]); s: along the path [m];
                t: now [s].

        Returns:
            A plan, or one command (delta [rad], tau [N m]) that holds until the next.

        Raises:
            NoPlanError, ArithmeticError: there is none from here; the last plan goes on, and the failure is counted.
        """


class ControllerSystem(LeafSystem):
    """A `Controller` as a system that is asked at a fixed rate; its plans are in force `delay` later.

    Where it finds nothing, or nothing finite, and where nothing finite is measured, the last plan stays in force, and
    the failure is counted. Any other error ends the run.

    Input port:
        measured_state: (r, v, beta, omega_r, e, dphi, s) [7].

    Output ports:
        plan: [t_start, delta_0, tau_0, ..., delta_N, tau_N]; NaN before the first.
        statistics: `SolveStatistics`; NaN for what only a solver has.

    State in the Context: the plan and the statistics.

    Args:
        horizon: N, steps of 0.1 s; a plan is read at their ends, held beyond its own.
        period: [s] between plans; delay: [s] from a measurement until its plan is in force.
    """

    def __init__(self, controller: Controller, horizon: int = 25, period: float = 0.01, delay: float = 0.01) -> None:
        LeafSystem.__init__(self)
        self._controller, self._horizon, self._delay = controller, horizon, delay
        nothing = dict.fromkeys(SolveStatistics._fields, np.nan)
        self._nothing = SolveStatistics(**nothing | {"failed": 0.0, "failures": 0.0, "seconds": 0.0})
        self._measured = self.DeclareVectorInputPort("measured_state", 7)
        self._plan = self.DeclareDiscreteState(no_plan(horizon))
        self._statistics = self.DeclareDiscreteState(np.array(self._nothing))
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._replan)
        for name, index in (("plan", self._plan), ("statistics", self._statistics)):
            self.DeclareStateOutputPort(name, index)

    def _replan(self, context: Context, discrete: DiscreteValues) -> None:
        measured, now = self._measured.Eval(context), context.get_time()
        failures = SolveStatistics(*context.get_discrete_state(self._statistics).value()).failures
        began = time.perf_counter()
        plan = self._found(measured, now)
        seconds = time.perf_counter() - began
        failed = float(plan is None)
        statistics = self._nothing._replace(failed=failed, failures=failures + failed, seconds=seconds)
        discrete.set_value(self._statistics, np.array(statistics))
        if plan is not None:
            discrete.set_value(self._plan, plan.vector())

    def _found(self, measured: Array, now: float) -> Plan | None:
        """The plan from a measured state, on this system's steps; None where there is none."""
        if not np.isfinite(measured).all():
            return None
        try:
            found = self._controller.evaluate(measured[:6], float(measured[6]), now)
        except (ArithmeticError, NoPlanError):
            return None
        start = now + self._delay
        u = commands_at(found, start + DT * np.arange(self._horizon + 1.0))
        return Plan(start, u) if np.isfinite(u).all() else None


def commands_at(found: Plan | ArrayLike, times: Array) -> Array:
    """Commands [N, 2] at times [N] of what a controller gave.

    Raises:
        InvalidPlanError: it gave something else.
    """
    if isinstance(found, Plan):
        return np.array([found.command(t) for t in times])
    command: Any = np.asarray(found, dtype=float)
    if command.shape != (len(INPUTS),):
        raise InvalidPlanError(
            f"the controller gave an array of shape {command.shape}; let evaluate return a Plan, or one command "
            "(delta [rad], tau [N m])"
        )
    return np.tile(command, (len(times), 1))
