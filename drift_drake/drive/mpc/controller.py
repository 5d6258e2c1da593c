"""MpcController: `Mpc` as a system that replans at a fixed rate."""

import time
from abc import abstractmethod
from contextlib import suppress
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

from drift_drake.car.single_track.motion import INPUTS
from drift_drake.car.step_model import StepModel
from drift_drake.common.arrays import Array
from drift_drake.common.errors import DriftDrakeError
from drift_drake.common.updates import declare_output, declare_update
from drift_drake.drive.learnt.features import COVARIANCE_COUNT, MEAN_COUNT
from drift_drake.drive.mpc.mpc import AlternativePlan, Mpc, MpcSolution, NoPlanError, SolveStatistics
from drift_drake.drive.mpc.plan import DT, Plan, no_plan

# Numbers far off, or an error of the solver itself (Drake's assertions exit): no plan, as where none is found.
FAILURES = (ArithmeticError, IndexError, RuntimeError, SystemExit, ValueError)


class MpcController(LeafSystem):
    """Model predictive control along a reference (section III of the paper): measured state in, plan out.

    Each `period` it plans from the measured state and its last solution, see `Mpc`. Where no plan is found, the last
    one stays in force (it goes on in time, and the actuator holds its last command beyond its end) and the failure is
    counted, and so is an error of the solver.

    Input ports:
        measured_state: (r, v, beta, omega_r, e, dphi, s) [7].
        theta (optional): parameters of a model that has `with_theta` (a learnt one's last layer, magnitudes of
            effects); else the model as it was given.
        internal_states: the model's further states, for a model that has any.
        posterior_covariance: of the last layer [4096], with `tightening`.

    Output ports:
        plan: [t_start, delta_0, tau_0, ..., delta_N, tau_N]; NaN before the first solve.
        prediction: states [(N + 1) * n] that go with the plan.
        statistics: `SolveStatistics`.

    State in the Context: the plan, the last solution (decision vector and multipliers), that of a plan from a fresh
    guess (NaN without), the statistics.

    Args:
        mpc: what plans; its `delay` is one period, which the solve may use up.
        period: [s] between plans.
        theta_size: length of the port `theta`; 0 for a model without.

    Examples:
        >>> MpcController(Mpc(NominalStepModel(car), car, reference)).GetOutputPort("plan").size()
        53
    """

    def __init__(self, mpc: Mpc, period: float = 0.01, theta_size: int = 0) -> None:
        LeafSystem.__init__(self)
        self.mpc, self.period = mpc, period
        self._measured = self.DeclareVectorInputPort("measured_state", 7)
        self._theta = self.DeclareVectorInputPort("theta", theta_size) if theta_size else None
        internal_size, horizon = mpc.model.internal_scale.size, mpc.horizon
        self._internal = self.DeclareVectorInputPort("internal_states", internal_size) if internal_size else None
        asked = mpc.tightening is not None
        self._covariance = self.DeclareVectorInputPort("posterior_covariance", COVARIANCE_COUNT) if asked else None
        self._plan = self.DeclareDiscreteState(no_plan(horizon))
        self._primal = self.DeclareDiscreteState(np.full(self.mpc.problem.size, np.nan))
        self._dual = self.DeclareDiscreteState(np.zeros(self.mpc.multiplier_count))
        self._alternative = self.DeclareDiscreteState(self._no_alternative())
        self._statistics = self.DeclareDiscreteState(np.zeros(len(SolveStatistics._fields)))
        self._made: tuple[Array, StepModel] = np.empty(0), mpc.model  # scratch: the last theta's model
        declare_update(self, period, self._replan)

        for name, index in (("plan", self._plan), ("statistics", self._statistics)):
            self.DeclareStateOutputPort(name, index)
        declare_output(
            self, "prediction", (6 + internal_size) * (horizon + 1), self._prediction,
            {self.discrete_state_ticket(self._primal)},
        )  # fmt: skip

    def warm_up(self) -> None:
        """Plans once along the reference and forgets it: what is compiled first is not the first plan's time."""
        internal = np.zeros(self.mpc.model.internal_scale.size)
        with suppress(*FAILURES):
            self.mpc.solve(np.append(self.mpc.reference.state(0.0), internal), 0.0, 0.0)

    def _no_alternative(self) -> Array:
        return np.full(self.mpc.problem.size + self.mpc.multiplier_count + 1, np.nan)

    def _prediction(self, context: Context) -> Array:
        return self.mpc.problem.unstack(context.get_discrete_state(self._primal).value()).x.ravel()

    def _replan(self, context: Context, discrete: DiscreteValues) -> None:
        before = SolveStatistics(*context.get_discrete_state(self._statistics).value())
        measured = self._measured.Eval(context)
        x, s = (
            (measured[:6] if self._internal is None else np.append(measured[:6], self._internal.Eval(context))),
            measured[6],
        )
        covariance = None if self._covariance is None else self._covariance.Eval(context).reshape(MEAN_COUNT, -1)
        try:
            last, model = self._last(context, before), self._believed(context)
            solution = self.mpc.solve(x, s, context.get_time(), last, model, covariance)
        except FAILURES:
            failed = before._replace(failed=1.0, failures=before.failures + 1.0)
            discrete.set_value(self._statistics, np.array(failed))
            return
        discrete.set_value(self._plan, solution.plan.vector())
        discrete.set_value(self._primal, solution.primal)
        discrete.set_value(self._dual, solution.dual)
        discrete.set_value(
            self._alternative, solution.alternative.vector() if solution.alternative else self._no_alternative()
        )
        discrete.set_value(self._statistics, np.array(solution.statistics._replace(failures=before.failures)))

    def _believed(self, context: Context) -> StepModel:
        """The model with the parameters that the port gives, where there is one."""
        if self._theta is None or not self._theta.HasValue(context):
            return self.mpc.model
        theta = self._theta.Eval(context)
        if not np.array_equal(theta, self._made[0]):
            self._made = np.array(theta), self.mpc.model.with_theta(theta)
        return self._made[1]

    def _last(self, context: Context, statistics: SolveStatistics) -> MpcSolution | None:
        """The last solution, as the Context holds it."""
        plan = Plan.of(context.get_discrete_state(self._plan).value(), self.mpc.dt)
        primal, dual, both = (
            context.get_discrete_state(index).value() for index in (self._primal, self._dual, self._alternative)
        )
        size = self.mpc.problem.size
        alternative = None if np.isnan(both[0]) else AlternativePlan(both[:size], both[size:-1], float(both[-1]))
        x = self.mpc.problem.layout.split(primal)[0]
        return plan and MpcSolution(plan, x, primal, dual, statistics, alternative)


class InvalidPlanError(DriftDrakeError, ValueError):
    """What a controller gave is neither a plan nor a command; the message says what it gave."""


class InvalidControllerError(DriftDrakeError, TypeError):
    """What was given as a controller is none; the message says what one is."""


class Controller(Protocol):
    """What `ClosedLoop` takes in place of the predictive controller: a function of what is measured now.

    It keeps nothing from one call to the next, so that runs replay from their seed. A controller with states of its own
    is a Drake system that keeps them in the Context (`system_controller`), and can be given in its place.

    Examples:
        >>> class Straight:
        ...     def evaluate(self, x, s, t):
        ...         return 0.0, 100.0  # [rad], [N m]
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


class PlanningSystem(LeafSystem):
    """Plans at a fixed rate. Where there is no plan, the last one stays in force, and the failure is counted.

    Ports and state: see `ControllerSystem`.
    """

    def __init__(self, horizon: int, period: float, delay: float) -> None:
        LeafSystem.__init__(self)
        self._horizon, self._delay = horizon, delay
        nothing = dict.fromkeys(SolveStatistics._fields, np.nan)
        self._nothing = SolveStatistics(**nothing | {"failed": 0.0, "failures": 0.0, "seconds": 0.0})
        self._measured = self.DeclareVectorInputPort("measured_state", 7)
        self._plan = self.DeclareDiscreteState(no_plan(horizon))
        self._statistics = self.DeclareDiscreteState(np.array(self._nothing))
        declare_update(self, period, self._replan)
        for name, index in (("plan", self._plan), ("statistics", self._statistics)):
            self.DeclareStateOutputPort(name, index)

    def _replan(self, context: Context, discrete: DiscreteValues) -> None:
        failures = SolveStatistics(*context.get_discrete_state(self._statistics).value()).failures
        plan, seconds = self._found(context)
        failed = float(plan is None)
        statistics = self._nothing._replace(failed=failed, failures=failures + failed, seconds=seconds)
        discrete.set_value(self._statistics, np.array(statistics))
        if plan is not None:
            discrete.set_value(self._plan, plan.vector())

    @abstractmethod
    def _found(self, context: Context) -> tuple[Plan | None, float]:
        """(the plan from now on, if there is one; the wall time that it took [s])."""


class ControllerSystem(PlanningSystem):
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
        controller: what is asked; horizon: N, steps of 0.1 s; a plan is read at their ends, held beyond its own.
        period: [s] between plans; delay: [s] from a measurement until its plan is in force.

    Examples:
        >>> straight = SimpleNamespace(evaluate=lambda x, s, t: (0.0, 100.0))
        >>> ControllerSystem(straight).GetOutputPort("plan").size()
        53
    """

    def __init__(self, controller: Controller, horizon: int = 25, period: float = 0.01, delay: float = 0.01) -> None:
        super().__init__(horizon, period, delay)
        self._controller = controller

    def _found(self, context: Context) -> tuple[Plan | None, float]:
        measured, began = self._measured.Eval(context), time.perf_counter()
        plan = self._asked(measured, context.get_time())
        return plan, time.perf_counter() - began

    def _asked(self, measured: Array, now: float) -> Plan | None:
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
