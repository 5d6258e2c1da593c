"""Readings that no car, or not this one, can have given are kept from the controller, and counted."""

import enum
import math
from typing import Any, NamedTuple

import numpy as np
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem
from scipy.special import chdtri  # chi-square's; scipy.stats takes half a second to import

from drift_drake.arrays import Array
from drift_drake.logs.driving import slowest
from drift_drake.reference.path import Path
from drift_drake.sensing.sensors import MEASURED_STATE, NoiseLevels
from drift_drake.vehicle.parameters import VehicleParameters
from drift_drake.vehicle.step_model import NominalStepModel

UNMODELLED = 0.3  # of the friction limit: standard deviation of the forces
ANGLE = 0.05  # [rad] of the course: what offsets of the sensors make of the motion along the path
INSIDE = 0.9  # of the radius of a bend: beyond, the path's coordinates say little
FALSE_ALARMS = 1e-9  # a reading, were all normal: the chi-square's bound
STABLE = 2.5  # product of rate and step up to which Runge-Kutta 4 is stable
# How fast a reading can change, by channel of the measured state, [unit/s]: some times what tyres can do, a collision
# aside. The path position is left out: on a closed path it may start anew.
FASTEST = np.array([80.0, 80.0, 30.0, 400.0, 80.0, 30.0, np.inf])
NOISE = np.array([0.1, 0.5, 0.1, 1.0, 0.3, 0.1, np.inf])  # a change of this size is none, whatever the time
LARGEST = np.array([20.0, 150.0, np.pi, 300.0, 1e3, np.inf, np.inf])  # no car's reading
FROZEN = 3  # equal readings in a row that pass; a car that moves repeats none
PATIENCE = 0.5  # [s] after which a reading is believed however far it is from the last one believed
PERSISTENT = 0.2  # [s] of readings that agree with each other, after which they are believed rather than the model


class Innovation:
    """One-step prediction of a reading, and its squared Mahalanobis distance.

    Over a period the noise of two readings and unknown forces, 0.3 of the friction limit along, across and about the
    vertical axis, add up: a car of half the grip is within that, gross errors of the sensors are not.

    Args:
        parameters: what the controller takes the car for; path: where it drives; noise: of the sensors, taken to be
            that of a good inertial system at least; period: [s] of a step.
    """

    def __init__(self, parameters: VehicleParameters, path: Path, noise: NoiseLevels, period: float) -> None:
        self._path, self._period, self._p = path, period, parameters
        self._slowest = slowest(parameters)
        rim = parameters.rear_stiffness * parameters.wheel_radius**2 / parameters.rear_axle_inertia / self._slowest
        self._model = NominalStepModel(parameters, period, math.ceil(period * rim / STABLE))
        self._noise = np.array([max(getattr(noise, name), getattr(NoiseLevels(), name)) for name in MEASURED_STATE])
        self.bound = float(chdtri(len(MEASURED_STATE), FALSE_ALARMS))

    def predict(self, reading: Array, command: Array, next_command: Array) -> Array:
        """The reading [7] one period on, commands [2] linear in between; NaN where the model has none."""
        x, s = reading[:6], float(reading[6])
        curvature = self._path.curvature(s)
        if not (np.isfinite(reading).all() and min(x[1], x[3]) > self._slowest and curvature * x[4] < INSIDE):
            return np.full_like(reading, np.nan)
        speed = x[1] * math.cos(x[5]) / (1.0 - curvature * x[4])
        x_next = self._model.step(x[None], command[None], next_command[None], np.array([curvature]))[0]
        return np.append(x_next, s + self._period * speed)

    def distance(self, reading: Array, predicted: Array, spread: float) -> float:
        """d^2 of a reading [7] from its prediction, what is unmodelled having acted for `spread` [s]; 0 without one."""
        if not np.isfinite(predicted).all():
            return 0.0
        difference = reading - predicted
        if self._path.closed:
            difference[6] = math.remainder(difference[6], self._path.length)
        variance = 2.0 * self._noise**2 + (self._rates(max(predicted[1], self._slowest)) * spread) ** 2
        return float(np.sum(difference**2 / variance))

    def _rates(self, v: float) -> Array:
        """Standard deviations [7] of the readings' rates by what the model does not know."""
        p = self._p
        acceleration = UNMODELLED * p.friction * p.gravity
        force = acceleration * p.mass
        turning = force * p.front_axle_distance / p.yaw_inertia
        rim = force * p.wheel_radius**2 / p.rear_axle_inertia
        course, along = acceleration / v, ANGLE * v
        return np.array([turning, acceleration, course, rim, along, course, along])


class ReadingKind(enum.IntEnum):
    """What a reading is."""

    GOOD = 0
    MISSING = 1  # not finite
    STOPPED = 2  # a speed of zero or less: none at which the controller's models hold
    JUMPED = 3  # further from the last good one than a car can have come, or no car's at all
    FROZEN = 4  # the same as the last ones
    DISAGREEING = 5  # far from what the model makes of the last good one


def reading_kind(reading: Array, last: Array, elapsed: float, repeats: int) -> ReadingKind:
    """What a measured state [7] is.

    Args:
        last: the last good one, NaN before the first; elapsed: time since [s]; repeats: readings equal to this one
            right before it.
    """
    if not np.isfinite(reading).all():
        return ReadingKind.MISSING
    if reading[1] <= 0.0 or reading[3] <= 0.0:
        return ReadingKind.STOPPED
    if (np.abs(reading) > LARGEST).any():
        return ReadingKind.JUMPED
    if np.isfinite(last).all() and elapsed <= PATIENCE:
        limit = NOISE + FASTEST * elapsed
        if (np.abs(reading - last)[:-1] > limit[:-1]).any():
            return ReadingKind.JUMPED
    return ReadingKind.FROZEN if repeats >= FROZEN else ReadingKind.GOOD


class JudgedReading(NamedTuple):
    """A reading with the verdict on it, as it lies in a vector."""

    kind: ReadingKind
    estimate: Array  # [7] the reading where it is good, else what the model makes of the last good one
    streak: float = 0.0  # readings in a row that disagree with the model and agree with each other
    spread: float = 0.0  # [s] for which what is unmodelled has acted on the estimate

    def vector(self) -> Array:
        """[kind, streak, spread, estimate]."""
        return np.concatenate([[float(self.kind), self.streak, self.spread], self.estimate])

    @classmethod
    def of(cls, vector: Array) -> "JudgedReading":
        """The inverse of `vector`."""
        return cls(ReadingKind(int(vector[0])), np.array(vector[3:]), float(vector[1]), float(vector[2]))


class Screen(LeafSystem):
    """Hands good readings on as they are, and NaN, which is no reading, in place of others.

    A reading is judged by itself and the last good one (`judge`), then by the model (`Innovation`), where there is
    one: it disagrees where its distance is beyond the bound. Where readings go on disagreeing with the model but agree
    with each other, it is the car that has changed, or the model that is wrong: they are believed.

    Input ports: measured_state [7]; command [2], in force, without which the model is not asked.
    Output ports: judged, a `JudgedReading`; screened_state [7]; reading [1], a `ReadingKind`; estimate [7], the reading
    where it is good, else the model's prediction; counts [6] of each kind until now.
    State in the Context, each `period`: time and values of the last good reading, the last reading and how often it
    was repeated, the last verdict and command, the counts.
    """

    def __init__(self, period: float = 0.01, innovation: Innovation | None = None) -> None:
        LeafSystem.__init__(self)
        self._period, self._innovation = period, innovation
        size = len(MEASURED_STATE)
        self._measured = self.DeclareVectorInputPort("measured_state", size)
        self._command = self.DeclareVectorInputPort("command", 2)
        self._good = self.DeclareDiscreteState(np.full(1 + size, np.nan))
        self._last = self.DeclareDiscreteState(np.full(1 + size, np.nan))  # [repeats, reading]
        nothing = JudgedReading(ReadingKind.MISSING, np.full(size, np.nan)).vector()
        self._before = self.DeclareDiscreteState(np.concatenate([[-np.inf], nothing, np.full(2, np.nan)]))
        self._counts = self.DeclareDiscreteState(np.zeros(len(ReadingKind)))
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)
        self._made: tuple[bytes, Array] = b"", nothing  # scratch: see `_calc_judged`
        self._judged = self.DeclareVectorOutputPort("judged", nothing.size, self._calc_judged)
        for name, length, calc in (
            ("screened_state", size, self._screened),
            ("reading", 1, lambda context: [float(self._verdict(context).kind)]),
            ("estimate", size, lambda context: self._verdict(context).estimate),
        ):
            self.DeclareVectorOutputPort(name, length, _setting(calc))
        self.DeclareStateOutputPort("counts", self._counts)

    def _verdict(self, context: Context) -> JudgedReading:
        return JudgedReading.of(self._judged.Eval(context))

    def _screened(self, context: Context) -> Array:
        x = self._measured.Eval(context)
        return x if self._verdict(context).kind == ReadingKind.GOOD else np.full_like(x, np.nan)

    def _repeats(self, context: Context) -> float:
        last = context.get_discrete_state(self._last).value()
        same = np.array_equal(last[1:], self._measured.Eval(context))
        return float(last[0]) + 1.0 if same else 0.0

    def _calc_judged(self, context: Context, output: Any) -> None:
        """Kept for the next call: at each tick the log asks before the sensors' update and the controller after it."""
        held = (context.get_discrete_state(index).value() for index in (self._good, self._last, self._before))
        known = [[context.get_time()], self._measured.Eval(context), self._in_force(context), *held]
        key = np.concatenate(known).tobytes()
        if key != self._made[0]:
            self._made = key, self._judge(context).vector()
        output.SetFromVector(self._made[1])

    def _judge(self, context: Context) -> JudgedReading:
        x, t = np.array(self._measured.Eval(context)), context.get_time()
        good, before = (context.get_discrete_state(index).value() for index in (self._good, self._before))
        last = JudgedReading.of(before[1:-2])
        if t - before[0] < 0.5 * self._period:  # the same tick, after its update
            return last
        kind = reading_kind(x, good[1:], t - good[0], int(self._repeats(context)))
        if self._innovation is None:
            return JudgedReading(kind, x if kind == ReadingKind.GOOD else last.estimate)
        u, u_next = before[-2:], self._in_force(context)
        predicted = self._innovation.predict(last.estimate, u, u_next)
        estimate = predicted if np.isfinite(predicted).all() else last.estimate
        if kind != ReadingKind.GOOD:
            return JudgedReading(kind, estimate, spread=last.spread + self._period)
        # Where readings are missing, a force that is not modelled goes on acting; those that disagree with the model
        # must not make it give way before they have lasted.
        spread = math.hypot(last.spread, self._period)
        if self._innovation.distance(x, predicted, spread) <= self._innovation.bound:
            return JudgedReading(kind, x)
        rival = self._innovation.predict(context.get_discrete_state(self._last).value()[1:], u, u_next)
        agrees = self._innovation.distance(x, rival, self._period) <= self._innovation.bound
        streak = last.streak + 1.0 if agrees else 1.0
        if streak * self._period >= PERSISTENT:
            return JudgedReading(ReadingKind.GOOD, x)
        return JudgedReading(ReadingKind.DISAGREEING, estimate, streak, spread)

    def _in_force(self, context: Context) -> Array:
        return self._command.Eval(context) if self._command.HasValue(context) else np.full(2, np.nan)

    def _update(self, context: Context, discrete: DiscreteValues) -> None:
        x, verdict, t = self._measured.Eval(context), self._verdict(context), context.get_time()
        discrete.get_mutable_vector(self._counts)[int(verdict.kind)] += 1.0
        discrete.set_value(self._last, np.concatenate([[self._repeats(context)], x]))
        discrete.set_value(self._before, np.concatenate([[t], verdict.vector(), self._in_force(context)]))
        if verdict.kind == ReadingKind.GOOD:
            discrete.set_value(self._good, np.concatenate([[t], x]))


def _setting(calc: Any) -> Any:
    """A port's calculation from one that returns the value."""
    return lambda context, output: output.SetFromVector(calc(context))
