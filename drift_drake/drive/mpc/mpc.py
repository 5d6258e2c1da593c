"""Model predictive control as a plain object: a plan from a state, by real-time iterations on the OCP."""

import math
from typing import NamedTuple

import numpy as np

from drift_drake.car.compilation import compiled, copied
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.step_model import StepModel
from drift_drake.common.arrays import Array
from drift_drake.common.errors import DriftDrakeError
from drift_drake.drive.learnt.bayesian_step import BayesianStepModel
from drift_drake.drive.mpc.ocp import OcpData, OcpWeights, OptimalControlProblem
from drift_drake.drive.mpc.plan import Plan
from drift_drake.drive.mpc.sqp import LineSearchSqp, SqpOptions, SqpResult
from drift_drake.drive.mpc.tightening import LaneTightening, lateral_deviation, tightened
from drift_drake.drive.reference.trajectory import Reference

FOLLOWED = 2.0
LOOK = 0.2  # [s] from one plan from a fresh guess to the next
CHEAPER = 0.9  # of the cost: less is another solution, more may be the same one, less converged
STUCK = 0.05  # share of the QP's step that the line search takes, below which the solution leads no further


class NoPlanError(DriftDrakeError, RuntimeError):
    """A state from which no plan was found; the message says why.

    Examples:
        >>> try:
        ...     solution = Mpc(NominalStepModel(car), car, reference).solve(np.full(6, np.nan), 0.0, 0.0)
        ... except NoPlanError:
        ...     print("the last plan goes on")
        the last plan goes on
    """


class SolveStatistics(NamedTuple):
    """One solve in numbers. `seconds` is wall time: the one number that does not replay."""

    cost: float
    primal_residual: float
    dual_residual: float
    step: float  # of the last line search; 0 when it failed
    iterations: float  # SQP iterations
    qp_iterations: float  # of all QPs together
    qp_fallbacks: float  # QPs that took a second attempt
    qp_unsolved: float  # QPs that no attempt solved
    slack: float  # [m] the largest planned excursion from the lane
    restart: float  # 1 while a plan from a fresh guess is worked out in parallel, `FOLLOWED` once it is the plan
    failed: float  # 1 if this solve failed
    failures: float  # solves that failed since the start
    seconds: float


class AlternativePlan(NamedTuple):
    """A plan from a fresh guess that is being worked out."""

    primal: Array
    dual: Array
    turned: float  # 1 where it began with the steering at the other lock, 0 where with the reference's

    def vector(self) -> Array:
        """All of it, as a system keeps it."""
        return np.concatenate([self.primal, self.dual, [self.turned]])


class MpcSolution(NamedTuple):
    """A plan (delta [rad], tau [N m]), what it was found with, and what the next solve starts from.

    Examples:
        >>> solution = Mpc(NominalStepModel(car), car, reference).solve(reference.state(0.0), 0.0, 0.0)
        >>> solution.plan.u.shape, solution.x.shape
        ((26, 2), (26, 6))
    """

    plan: Plan
    x: Array  # predicted states [N+1, n]
    primal: Array  # decision vector [size], scaled
    dual: Array  # multipliers [multiplier_count], scaled
    statistics: SolveStatistics  # of this solve
    alternative: AlternativePlan | None = None  # from a fresh guess, while one is worked out


class Mpc:
    """Plans along a reference (OCP, section III of the paper); holds nothing that a later solve depends on.

    Examples:
        >>> mpc, solution = Mpc(NominalStepModel(car), car, reference), None
        >>> solution = mpc.solve(reference.state(0.0), 0.0, 0.0, solution)  # at s [m] and t [s], over and over
        >>> delta, tau = solution.plan.command(0.05)

    Each solve predicts the state to the time at which the plan will be in force (`delay` later), sets the OCP up from
    there with the command that the last plan has for that time as u_0, and makes SQP steps from the last solution,
    shifted: one, and up to `options.max_iterations` while the defect of the dynamics is above its tolerance. Each is
    taken only if the merit function is below that of the last plan, shifted to now and judged by the model of now;
    where no step is, that plan is the new one. If a later iteration fails, the plan is that of the steps before.

    An OCP of a drift has other local optima, such as a front tyre that slides at full lock to the inside, and the
    solution followed may slip into one as a transition comes into the horizon or the belief moves. So every `LOOK`
    seconds, and where the line search has all but stopped (`STUCK`), a plan from a fresh guess is worked out in
    parallel, with one iteration a solve for each. Once its dynamics hold it is followed if it costs less than `CHEAPER`
    times what the other does, and dropped if not. The guess is the reference's states and inputs. In every other
    `LOOK`, once that is dropped, and where it does not hold within one, it is the same with the steering at the other
    lock than now, if that is to the inside of the bend: on a car whose front tyre slides in the drift wanted the
    reference's inputs lead back to the lock.

    Attributes:
        problem: the OCP, a MathematicalProgram; a solve sets its stages, not the program (`set_stages`).

    Args:
        model: one step of the car, as the controller believes it.
        parameters: for the limits of the inputs.
        reference: what to drive.
        horizon: N, steps of the model.
        weights: of the cost.
        options: of the solver; real-time iterations by default.
        delay: [s] from a measurement until its plan is in force.
        initial_command: (delta [rad], tau [N m]) in force before the first plan.
        tightening: narrows the lane by the model's uncertainty along the last solution; needs a learnt model.
        fresh_guesses: whether plans from a fresh guess are worked out in parallel.
    """

    def __init__(
        self,
        model: StepModel,
        parameters: VehicleParameters,
        reference: Reference,
        horizon: int = 25,
        weights: OcpWeights | None = None,
        options: SqpOptions | None = None,
        delay: float = 0.01,
        initial_command: tuple[float, float] = (0.0, 0.0),
        tightening: LaneTightening | None = None,
        fresh_guesses: bool = True,
    ) -> None:
        self.model, self.reference, self.horizon, self.delay = model, reference, horizon, delay
        self.problem = OptimalControlProblem(model, parameters, horizon, weights)
        self._initial_command = np.array(initial_command, dtype=float)
        self._steering_limit = parameters.steering_limit
        self.tightening, self.fresh_guesses = tightening, fresh_guesses
        self._solver = LineSearchSqp(self.problem, options or SqpOptions.real_time())

    @property
    def dt(self) -> float:
        """Of a step of the horizon [s]: the model's."""
        return self.model.dt

    @property
    def multiplier_count(self) -> int:
        """Length of a solution's `dual`."""
        return self._solver.multiplier_count

    def solve(
        self,
        x: Array,
        s: float,
        t: float,
        last: MpcSolution | None = None,
        model: StepModel | None = None,
        covariance: Array | None = None,
    ) -> MpcSolution:
        """The plan from a state.

        Args:
            x: (r, v, beta, omega_r, e, dphi) and the model's further states [n]; s: [m] along the path; t: now [s].
            last: the solution before this one, to go on from.
            model: what is believed now; without, what it was built with.
            covariance: of a learnt model's last layer [64, 64], with `tightening`.

        Raises:
            NoPlanError: a state that is not finite, or the first QP failed.
        """
        if not (np.isfinite(x).all() and np.isfinite(s)):
            raise NoPlanError("the state is not finite; the last plan goes on")
        model = model or self.model
        if model.headed:  # the reading, run on by the delay, is where the horizon begins
            model = model.along(self.reference.horizon(s, self.dt, self.horizon).heading)
        self.problem.dynamics.model = model
        start = t + self.delay
        if last is None:
            now = at_start = later = self._initial_command
        else:
            now, at_start, later = last.plan.commands(t, start, t + self.dt)
        curvature = np.atleast_1d(self.reference.path.curvature(s))
        step = model.step(x[None], now[None], later[None], curvature)[0] - x
        data = self._data(x + self.delay / self.dt * step, s + self.delay * x[1] * np.cos(x[5]), at_start)
        alternative, look = None, False
        if last is None:
            guess, dual = self.problem.first_guess(data), np.zeros(self.multiplier_count)
        else:
            gone = (start - last.plan.start) / self.dt
            given = self.problem.given(data)
            guess, dual = shifted(last.primal, self.horizon, gone, given), last.dual
            alternative = last.alternative and last.alternative._replace(
                primal=shifted(last.alternative.primal, self.horizon, gone, given)
            )
            look = math.floor(start / LOOK) > math.floor(last.plan.start / LOOK)
        self.problem.set_stages(self._tightened(covariance, model, data, guess))
        first = self._solver.solve(guess, dual, 1 if alternative else None)
        if not first.iterations or (first.failed and first.iterations[0].step == 0.0):
            raise NoPlanError(f"no plan was found: {first.status}; the last one goes on")
        result, alternative, restart, seconds = self._or_from_afresh(first, alternative, data, start, look)
        solution = self.problem.unstack(result.z)
        statistics = _statistics(result, float(solution.slack.max()), restart, seconds)
        return MpcSolution(Plan(start, solution.u, self.dt), solution.x, result.z, result.y, statistics, alternative)

    def _or_from_afresh(
        self, result: SqpResult, alternative: AlternativePlan | None, data: OcpData, start: float, look: bool
    ) -> tuple[SqpResult, AlternativePlan | None, float, float]:
        """(what is followed, the alternative from now on, `restart`, seconds in all) of a solve and the alternative."""
        seconds, restart = sum(iteration.seconds for iteration in result.iterations), float(alternative is not None)
        inside = bool(data.u_init[0] * data.curvature[0] > 0.0)  # of the bend: a car that counter-steers needs no other
        if not self.fresh_guesses:
            return result, None, restart, seconds
        if alternative is not None:
            other = self._solver.solve(alternative.primal, alternative.dual, 1)
            seconds += sum(iteration.seconds for iteration in other.iterations)
            if other.status == "feasible" and other.cost < CHEAPER * result.cost:
                return other, None, FOLLOWED, seconds
            done = other.failed or other.status in ("feasible", "line search failed")
            if done and not alternative.turned and inside and math.floor(start / LOOK) % 2:
                return result, self._fresh_guess(data, True), 1.0, seconds
            alternative = None if done else AlternativePlan(other.z, other.y, alternative.turned)
        if look or (alternative is None and result.iterations[-1].step < STUCK):
            turned = inside and alternative is not None and not alternative.turned
            return result, self._fresh_guess(data, turned), 1.0, seconds
        return result, alternative, restart, seconds

    def _fresh_guess(self, data: OcpData, turned: bool) -> AlternativePlan:
        """What an alternative begins with: the reference, perhaps with the steering at the other lock."""
        guess = self.problem.first_guess(data)
        if turned:
            x, u, slack = self.problem.unstack(guess)
            u[1:, 0] = -math.copysign(self._steering_limit, data.u_init[0])
            guess = self.problem.stack(x, u, slack)
        return AlternativePlan(guess, np.zeros(self.multiplier_count), float(turned))

    def _tightened(self, covariance: Array | None, model: StepModel, data: OcpData, guess: Array) -> OcpData:
        """The data with the lane narrowed, where that is asked for."""
        if self.tightening is None or covariance is None:
            return data
        assert isinstance(model, BayesianStepModel)  # of what else is there a covariance?
        sigma, kappa = self.tightening
        x, u, _ = self.problem.unstack(guess)
        margin = kappa * lateral_deviation(model, sigma, covariance, x, u, data.curvature)
        e_min, e_max = tightened(data.e_min, data.e_max, margin)
        return data._replace(e_min=e_min, e_max=e_max)

    def _data(self, x: Array, s: float, command: Array) -> OcpData:
        horizon = self.reference.horizon(s, self.dt, self.horizon)
        return OcpData(x, command, horizon.x_ref, horizon.curvature, horizon.e_min, horizon.e_max, horizon.u_ref)


@compiled
def shifted(primal: Array, horizon: int, steps: float, given: Array) -> Array:
    """A solution read `steps` (a fraction of one, as a rule) later, from the state and command of now [n+2]."""
    n, out = given.size - 2, primal.copy()
    first = 0
    for size in (n, 2):
        for k in range(horizon + 1):
            at = min(k + steps, horizon)
            index = min(int(at), horizon - 1)
            part, here = at - index, first + size * index
            for i in range(size):
                out[first + size * k + i] = (1.0 - part) * primal[here + i] + part * primal[here + size + i]
        first += size * (horizon + 1)
    copied(given[:n], out[:n])
    copied(given[n:], out[n * (horizon + 1) : n * (horizon + 1) + 2])
    return out


def _statistics(result: SqpResult, slack: float, restart: float, seconds: float) -> SolveStatistics:
    iterations = result.iterations
    return SolveStatistics(
        cost=result.cost,
        primal_residual=result.primal_residual,
        dual_residual=iterations[-1].dual_residual,
        step=iterations[-1].step,
        iterations=float(len(iterations)),
        qp_iterations=float(sum(iteration.qp_iterations for iteration in iterations)),
        qp_fallbacks=float(sum(iteration.second_attempt for iteration in iterations)),
        qp_unsolved=float(sum(iteration.qp_status != "solved" for iteration in iterations)),
        slack=slack,
        restart=restart,
        failed=0.0,
        failures=0.0,
        seconds=seconds,
    )
