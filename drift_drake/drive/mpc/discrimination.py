"""Telling two hypotheses about a car apart by driving: the T-optimal objective as a cost of the OCP.

T-optimality (Atkinson and Fedorov 1975) asks for the experiment in which the rival, with its parameters fitted anew to
what the first hypothesis would show, is furthest off. Over the stages of a plan that the first hypothesis's car drives,

    nats = min_theta  1/2 sum_k |y_{k+1} - h(f(x_k, u_k, u_{k+1}; theta))|^2_{Sigma^-1}  +  1/2 |theta - theta_0|^2_P,

y what the first's sensors read, f the rival's car from the state that the rival takes the reading for, h its sensors,
and N(theta_0, P^-1) what earlier logs say of its parameters. The minimum's derivative by the plan is that of the sum at
the minimiser (Danskin), so that the fit needs no derivative of its own. The cost is -alpha log(1 + nats): beyond some
nats more certainty is worth little.

The SQP takes this cost linearised (Gauss-Newton): the sum is convex where the difference is linear in the plan, so that
its linearisation bounds the cost from above (the convex-concave procedure).
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from drift_drake.car.effects.magnitudes import Effects, measured
from drift_drake.car.parameters import Constants
from drift_drake.car.single_track.effects_step import INTERNAL_SCALE, EffectsStepModel
from drift_drake.car.step_model import StepModel, block_scale
from drift_drake.common.arrays import Array
from drift_drake.drive.qp.stacked import DifferencedExpansion

STATE_COUNT = 4  # r, v, beta, omega_r
BODY = 6  # states of the car ahead of its internal states
INTERNAL = INTERNAL_SCALE.size
REFITS = 3  # Gauss-Newton steps of the rival's fit


class CarHypothesis(NamedTuple):
    """A car as a hypothesis has it."""

    constants: Constants
    effects: Effects  # on the motion, as far as a one-step model can have them
    sensors: Effects  # the same with the sensors' biases


class Rival(NamedTuple):
    """A hypothesis whose parameters may be fitted anew: what earlier logs say of them."""

    car: Callable[[Array], CarHypothesis]  # of parameters [p]
    theta: Array  # [p]
    precision: Array  # [p, p]
    differences: Array  # [p] steps for derivatives
    low: Array  # [p]
    high: Array  # [p]


def gains_and_biases(sensors: Effects) -> tuple[Array, Array]:
    """What sensors read of the six states: gain * x + bias."""
    gain, bias = np.ones(BODY), np.zeros(BODY)
    bias[:4] = measured(0.0, 0.0, 0.0, 0.0, sensors)
    gain[:4] = np.array(measured(1.0, 1.0, 1.0, 1.0, sensors)) - bias[:4]
    return gain, bias


class RivalsStepModel(StepModel):
    """The first hypothesis's car, with the rival's internal states run along with it, as the model of an OCP.

    State: the first's six and its internal states, then the internal states that the rival would have.
    """

    def __init__(self, first: EffectsStepModel, second: EffectsStepModel, gain: Array, bias: Array) -> None:
        """Args: gain, bias: the state that the rival takes the first's reading for is gain * x + bias [6]."""
        self.first, self.second, self.gain, self.bias = first, second, gain, bias
        self.internal_scale = np.concatenate([first.internal_scale, second.internal_scale])

    def second_state(self, x: Array) -> Array:
        """The rival's state [N, 6 + internal states]."""
        return np.concatenate([x[:, :BODY] * self.gain + self.bias, x[:, BODY + INTERNAL :]], axis=1)

    def step(self, x: Array, u: Array, u_next: Array, curvature: Array) -> Array:
        own = self.first.step(x[:, : BODY + INTERNAL], u, u_next, curvature)
        other = self.second.step(self.second_state(x), u, u_next, curvature)
        return np.concatenate([own, other[:, BODY:]], axis=1)

    def linearize(self, x: Array, u: Array, u_next: Array, curvature: Array) -> tuple[Array, Array, Array, Array]:
        own, *first = self.first.linearize(x[:, : BODY + INTERNAL], u, u_next, curvature)
        other, *second = self.second.linearize(self.second_state(x), u, u_next, curvature)
        half = BODY + INTERNAL
        a = np.zeros((len(x), half + INTERNAL, half + INTERNAL))
        a[:, :half, :half] = first[0]
        a[:, half:, :BODY] = second[0][:, BODY:, :BODY] * self.gain
        a[:, half:, half:] = second[0][:, BODY:, BODY:]
        inputs = [np.concatenate([own_b, other_b[:, BODY:]], axis=1) for own_b, other_b in zip(first[1:], second[1:],
                                                                                            strict=True)]  # fmt: skip
        return np.concatenate([own, other[:, BODY:]], axis=1), a, inputs[0], inputs[1]


class DiscriminationCost:
    """-alpha log(1 + nats) as a `StageCost`.

    Args:
        model: both hypotheses' cars, the rival's with the parameters that earlier logs gave.
        first: the first hypothesis; rival: the other.
        deviation: standard deviations of a stage's difference in (r, v, beta, omega_r) [4].
        alpha: weight.
    """

    def __init__(
        self, model: RivalsStepModel, first: CarHypothesis, rival: Rival, deviation: Array, alpha: float
    ) -> None:
        self._model, self._rival, self._alpha = model, rival, alpha
        self._gain, self._bias = gains_and_biases(first.sensors)
        self._weight = 1.0 / np.asarray(deviation)
        self._root = np.linalg.cholesky(rival.precision).T

    def _predicted(self, x: Array, u: Array, u_next: Array, theta: Array) -> Array:
        """What the rival's sensors would read a step later [N, 4]."""
        car = self._rival.car(theta)
        gain, bias = gains_and_biases(car.sensors)
        state = np.concatenate([(x[:, :BODY] * self._gain + self._bias - bias) / gain, x[:, BODY + INTERNAL :]], axis=1)
        after = self._model.second.of_car(car.constants, car.effects).step(state, u, u_next, np.zeros(len(x)))
        return (after[:, :BODY] * gain + bias)[:, :STATE_COUNT]

    def _read(self, x: Array, u: Array, u_next: Array) -> Array:
        """What the first's sensors read a step later [N, 4]."""
        after = self._model.first.step(x[:, : BODY + INTERNAL], u, u_next, np.zeros(len(x)))
        return (after[:, :BODY] * self._gain + self._bias)[:, :STATE_COUNT]

    def refit(self, x: Array, u: Array, u_next: Array) -> tuple[Array, float]:
        """The rival's parameters [p] that come nearest to a plan's readings, and the nats by which they stay behind."""
        rival, read = self._rival, self._read(x, u, u_next)

        def residual(theta: Array) -> Array:
            misfit = (read - self._predicted(x, u, u_next, theta)) * self._weight
            return np.concatenate([misfit.ravel(), self._root @ (theta - rival.theta)])

        theta, at = rival.theta, residual(rival.theta)
        for _ in range(REFITS):
            shifts = np.where(theta + rival.differences <= rival.high, 1.0, -1.0) * rival.differences
            moved = theta + np.diag(shifts)
            jacobian = np.stack([(residual(m) - at) / s for m, s in zip(moved, shifts, strict=True)], axis=1)
            wanted = theta - np.linalg.lstsq(jacobian, at, rcond=None)[0]
            trial = np.clip(wanted, rival.low, rival.high)
            there = residual(trial)
            if not there @ there < at @ at:
                break
            theta, at, before = trial, there, at
            if before @ before - at @ at < 1e-3 * (1.0 + at @ at):
                break
        return theta, 0.5 * float(at @ at)

    def nats(self, x: Array, u: Array, u_next: Array) -> float:
        """By how much the rival, fitted anew, stays behind."""
        return self.refit(x, u, u_next)[1]

    def value(self, x: Array, u: Array, u_next: Array) -> float:
        """-alpha log(1 + nats)."""
        return -self._alpha * float(np.log1p(self.nats(x, u, u_next)))

    def expansion(self, x: Array, u: Array, u_next: Array) -> DifferencedExpansion:
        """See `StageCost`; the rival's parameters are held where they are."""
        gradient, scale = self._gradient_at(x, u, u_next), block_scale(self._model.internal_scale)
        return DifferencedExpansion(gradient, x, u, u_next, scale)

    def _gradient_at(self, x: Array, u: Array, u_next: Array) -> Callable[[Array, Array, Array], Array]:
        theta, nats = self.refit(x, u, u_next)
        car = self._rival.car(theta)
        rival_gain, rival_bias = gains_and_biases(car.sensors)
        second = self._model.second.of_car(car.constants, car.effects)
        between = RivalsStepModel(
            self._model.first, second, self._gain / rival_gain, (self._bias - rival_bias) / rival_gain
        )
        factor = -self._alpha / (1.0 + nats)

        def gradient(x: Array, u: Array, u_next: Array) -> Array:
            straight = np.zeros(len(x))
            own, *first = between.first.linearize(x[:, : BODY + INTERNAL], u, u_next, straight)
            other, *rivals = between.second.linearize(between.second_state(x), u, u_next, straight)
            difference = (own[:, :BODY] * self._gain + self._bias - other[:, :BODY] * rival_gain - rival_bias)[:, :4]
            weighted = difference * self._weight**2
            by_own, by_other = weighted * self._gain[:STATE_COUNT], weighted * rival_gain[:STATE_COUNT]
            out = np.zeros((len(x), x.shape[1] + 4))
            half = BODY + INTERNAL
            out[:, :half] = np.einsum("ki,kij->kj", by_own, first[0][:, :STATE_COUNT])
            state = np.einsum("ki,kij->kj", by_other, rivals[0][:, :STATE_COUNT])
            out[:, :BODY] -= state[:, :BODY] * between.gain
            out[:, half : half + INTERNAL] = -state[:, BODY:]
            for i, (b, rival_b) in enumerate(zip(first[1:], rivals[1:], strict=True)):
                columns = slice(half + INTERNAL + 2 * i, half + INTERNAL + 2 * i + 2)
                out[:, columns] = np.einsum("ki,kij->kj", by_own, b[:, :STATE_COUNT])
                out[:, columns] -= np.einsum("ki,kij->kj", by_other, rival_b[:, :STATE_COUNT])
            return factor * out

        return gradient
