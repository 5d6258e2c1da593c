"""The hybrid model x_{k+1} = h(x_k, u_k, u_{k+1}) + g(z_k; theta), h the car that drives have identified.

What the equations of the identified car (`gap.choose.identified`: single or double track, with effects) leave over is
learnt by a Bayesian last layer, g = theta^T phi (eqs. 5 to 7 of Davydov et al.), in place of what a nominal car leaves.
Its prior is of such cars: h is believed until the samples say otherwise.
"""

import copy
from pathlib import Path

import numpy as np
import pandas as pd
from pydrake.systems.framework import LeafSystem

from drift_drake.car.internal_states import RememberingStepModel
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.single_track.motion import INPUTS, STATES
from drift_drake.car.step_model import StepModel
from drift_drake.common.arrays import Array
from drift_drake.drive.learnt.bayesian_step import euler_step
from drift_drake.drive.learnt.checkpoint import BayesianModel, load_model, shipped
from drift_drake.drive.learnt.command_lag import TIME_STEP, as_of_typical_car
from drift_drake.drive.learnt.features import MEAN_COUNT, STATE_COUNT, MeanFunction
from drift_drake.drive.learnt.samples import DECIMATION, CurvatureLookup, Samples, samples_from_log

FASTEST_LAG = 0.01  # [s] that the features are given
ROW_PERIOD = 0.01  # [s] of a log


def load_hybrid(path: str | Path | None = None) -> BayesianModel:
    """The features, prior and noise of what identified cars leave over; without a path, those shipped.

    Raises:
        InvalidCheckpointError: names the file and the remedy; InvalidVehicleError: of the vehicle in it.

    Examples:
        >>> load_hybrid().sigma.shape
        (4,)
    """
    return load_model(shipped("hybrid_model.npz") if path is None else path)


def lags_of(car: RememberingStepModel) -> Array:
    """Lags [2] of steering and torque of an identified car [s]."""
    return np.maximum([car.effects.steering_lag, car.effects.torque_lag], FASTEST_LAG)


def hybrid_inputs(car: RememberingStepModel, x: Array, u: Array, u_next: Array) -> Array:
    """z [n, 10] of states x [n, 6 + m] whose first two internal ones are the actuators'; without lags, the command."""
    lagged = np.where(car.follows_at_once()[:2], u, x[:, 6:8])
    return np.concatenate([x[:, :STATE_COUNT], u, u_next, lagged], axis=1)


def left_over(
    car: RememberingStepModel, nominal: VehicleParameters, x: Array, u: Array, u_next: Array, x_next: Array
) -> tuple[Array, Array, Array, Array]:
    """Samples as if the nominal car, with a typical car's lags, left over what this car does.

    So all that is written for the nominal car's residuals, `bayesian_step.regression_points` and the training, serves.

    Args:
        x: states and the car's internal states at the start of a step [n, 6 + m]; x_next: states at its end [n, 6+].

    Returns:
        (x [n, 8], u [n, 2], u_next [n, 2], x_next [n, 8]).
    """
    z = hybrid_inputs(car, x, u, u_next) @ as_of_typical_car(lags_of(car), TIME_STEP).T
    start, commands, later = np.concatenate([x[:, :6], z[:, 8:]], axis=1), z[:, 4:6], z[:, 6:8]
    still = np.zeros(len(x))
    h = euler_step(np.concatenate([x[:, :STATE_COUNT], np.zeros((len(x), 2))], axis=1), commands, still,
                   nominal.constants())  # fmt: skip
    end = np.concatenate([x_next[:, :6], z[:, 8:]], axis=1)
    end[:, :STATE_COUNT] += h[:, :STATE_COUNT] - car.step(x, u, u_next, still)[:, :STATE_COUNT]
    return start, commands, later, end


def followed(car: RememberingStepModel, x: Array, u: Array) -> Array:
    """The car's internal states [K, m] along a log's states [K, 6] and commands [K, 2], settled at its first row."""
    at_once = car.follows_at_once()
    out = np.empty((len(x), len(at_once)))
    out[0] = car.settled(x[0, :STATE_COUNT], u[0])
    for k in range(len(x) - 1):
        out[k + 1] = car.run_on(np.concatenate([x[k], out[k]]), u[k], u[k + 1], ROW_PERIOD)[6:]
        if at_once.any():
            out[k + 1, at_once] = car.settled(x[k + 1, :STATE_COUNT], u[k + 1])[at_once]
    return out


def hybrid_samples(
    table: pd.DataFrame, path: CurvatureLookup | None, vehicle: int, drive: int, car: RememberingStepModel,
    nominal: VehicleParameters, phases: int = 1,
) -> list[Samples]:  # fmt: skip
    """What a car leaves over in a log, as `samples_from_log` has it of the nominal car, in so many phases."""
    x, u = table[list(STATES)].to_numpy(), table[[f"{name}_cmd" for name in INPUTS]].to_numpy()
    rows, found = np.concatenate([x, followed(car, x, u)], axis=1), list[Samples]()
    for phase in range(phases):
        samples = samples_from_log(table, path, vehicle, drive, phase)
        start = rows[phase::DECIMATION][: len(samples.x)]
        x, u, u_next, x_next = left_over(car, nominal, start, samples.u, samples.u_next, samples.x_next)
        found.append(samples._replace(x=x, u=u, u_next=u_next, x_next=x_next))
    return found


class HybridStepModel(StepModel):
    """One step of an identified car and of what it leaves over, over the arrays of a horizon, for one theta.

    The learnt part moves the four learnt states at the step's end; the path coordinates follow as if it had grown
    evenly over the step. The car's internal states are the car's own.

    Examples:
        >>> learnt, identified = load_hybrid(), EffectsStepModel(car, make_effects({"steering_lag": 0.05}))
        >>> model = HybridStepModel(learnt, learnt.prior_mean, identified)
        >>> loop = ClosedLoop(car, reference, model, adapter=BayesianAdapter(learnt, car=identified))
    """

    def __init__(self, model: BayesianModel, theta: Array, car: RememberingStepModel) -> None:
        """Args:
        model: features of what identified cars leave over; theta: last-layer parameters [4, 16]; car: h.
        """
        self.car, self.dt, self.internal_scale = car, car.dt, car.internal_scale
        self._mean = MeanFunction(model.with_lag(lags_of(car)).network, theta)
        self._offset = np.zeros(STATE_COUNT)
        self._at_once = car.follows_at_once()[:2]

    def with_theta(self, theta: Array) -> "HybridStepModel":
        """The model with another theta [64], or with an offset of the learnt states too [68]; lags stay the car's."""
        other, flat = copy.copy(self), np.ravel(theta)
        other._mean = self._mean.with_theta(flat[:MEAN_COUNT].reshape(STATE_COUNT, -1))
        if flat.size > MEAN_COUNT:
            other._offset = flat[MEAN_COUNT : MEAN_COUNT + STATE_COUNT]
        return other

    @property
    def headed(self) -> bool:
        return self.car.headed

    def along(self, heading: Array) -> "HybridStepModel":
        other = copy.copy(self)
        other.car = self.car.along(heading)
        return other

    def observer(self, period: float) -> LeafSystem | None:
        return self.car.observer(period)

    def step(self, x: Array, u: Array, u_next: Array, curvature: Array) -> Array:
        x_next = np.array(self.car.step(x, u, u_next, curvature))
        _add(x_next, x, self._mean.value(hybrid_inputs(self.car, x, u, u_next)) + self._offset, self.dt)
        return x_next

    def linearize(self, x: Array, u: Array, u_next: Array, curvature: Array) -> tuple[Array, Array, Array, Array]:
        x_next, by_x, by_u, by_u_next = (np.array(part) for part in self.car.linearize(x, u, u_next, curvature))
        g, slope = self._mean.linearize(hybrid_inputs(self.car, x, u, u_next))
        by_g = _add(x_next, x, g + self._offset, self.dt, by_x)
        learnt = by_g @ slope  # [n, 6, 10]
        by_x[:, :6, :STATE_COUNT] += learnt[:, :, :STATE_COUNT]
        by_u[:, :6] += learnt[:, :, 4:6] + learnt[:, :, 8:] * self._at_once
        by_u_next[:, :6] += learnt[:, :, 6:8]
        by_x[:, :6, 6:8] += learnt[:, :, 8:] * ~self._at_once
        return x_next, by_x, by_u, by_u_next


def _add(x_next: Array, x: Array, g: Array, dt: float, by_x: Array | None = None) -> Array:
    """Adds g [n, 4] to states in place, its own part of e's derivative to `by_x`; returns d x_next / d g [n, 6, 4]."""
    v, cos, sin = x[:, 1], np.cos(x[:, 5]), np.sin(x[:, 5])
    by_g = np.zeros((len(x), 6, STATE_COUNT))
    by_g[:, range(4), range(4)] = 1.0
    by_g[:, 5, 0], by_g[:, 5, 2] = 0.5 * dt, 1.0  # the course turns by the heading and the sideslip
    along, turn = 0.5 * dt * sin, np.stack([dt * dt / 6.0 + 0.0 * v, 0.5 * dt + 0.0 * v])
    by_g[:, 4, 0], by_g[:, 4, 1], by_g[:, 4, 2] = v * cos * turn[0], along, v * cos * turn[1]
    x_next[:, :6] += (by_g @ g[:, :, None])[:, :, 0]
    if by_x is not None:
        course = turn[0] * g[:, 0] + turn[1] * g[:, 2]
        by_x[:, 4, 1] += cos * course
        by_x[:, 4, 5] += -v * sin * course + 0.5 * dt * cos * g[:, 1]
    return by_g
