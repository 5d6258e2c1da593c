"""Readings that no car, or not this one, can have given are kept from the controller, and counted."""

import enum
import math
from typing import NamedTuple

import numpy as np
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem
from scipy.special import chdtri  # chi-square's; scipy.stats takes half a second to import

from drift_drake.car.log.driving import slowest
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.sensors import MEASURED_STATE, NoiseLevels
from drift_drake.car.step_model import NominalStepModel
from drift_drake.common.arrays import Array
from drift_drake.common.updates import declare_output, declare_update
from drift_drake.drive.reference.path import Path
from drift_drake.drive.screening.fusion import Fused, Mask, corrected, learnt, predicted, within_gate
from drift_drake.drive.screening.holding import BETA, DOUBTED, Holding

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
# Whose errors show by the other channels: rates and angles by the position, the position by them.
CHECKED = np.array([name in ("r", "v", "beta", "e", "dphi") for name in MEASURED_STATE])
MOST_OUT = 2  # of them that may be wrong while the others are right; more, and it is the car that has moved
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
        self.noise = np.array([max(getattr(noise, name), getattr(NoiseLevels(), name)) for name in MEASURED_STATE])
        self.length = path.length if path.closed else math.inf
        self.bound = float(chdtri(len(MEASURED_STATE), FALSE_ALARMS))

    def predict(self, reading: Array, command: Array, next_command: Array) -> Array:
        """The reading [7] one period on, commands [2] linear in between; NaN where the model has none."""
        return self.linearize(reading, command, next_command)[0]

    def linearize(self, reading: Array, command: Array, next_command: Array) -> tuple[Array, Array]:
        """(`predict` [7], its Jacobian by the reading [7, 7])."""
        x, s, jacobian = reading[:6], float(reading[6]), np.eye(7)
        curvature = self._path.curvature(s)
        if not (np.isfinite(reading).all() and min(x[1], x[3]) > self._slowest and curvature * x[4] < INSIDE):
            return np.full_like(reading, np.nan), jacobian
        shortened = 1.0 - curvature * x[4]
        along = math.cos(x[5]) / shortened
        x_next, by_x, _, _ = self._model.linearize(x[None], command[None], next_command[None], np.array([curvature]))
        jacobian[:6, :6] = by_x[0]
        jacobian[6, [1, 4, 5]] = self._period * np.array(
            [along, x[1] * along * curvature / shortened, -x[1] * math.sin(x[5]) / shortened]
        )
        return np.append(x_next[0], s + self._period * x[1] * along), jacobian

    def distance(self, reading: Array, expected: Array, spread: float) -> float:
        """d^2 of a reading [7] from its prediction, what is unmodelled having acted for `spread` [s]; 0 without one."""
        return float(np.sum(self._squares(reading, expected, spread)))

    def alone(self, reading: Array, expected: Array, spread: float) -> int | None:
        """The one channel of `CHECKED` without which a reading is within the bound; None where there is no such one."""
        squares = self._squares(reading, expected, spread)
        worst = int(np.argmax(np.where(CHECKED, squares, -1.0)))
        return worst if squares.sum() - squares[worst] <= self.bound else None

    def held(self, before: Holding, reading: Array, last: Array) -> Holding:
        """What two good readings [7], a period apart, add to what is known of the sideslip."""
        return before.after_good(reading, last, self._path.curvature(float(reading[6])), self.length, self._period)

    def _squares(self, reading: Array, expected: Array, spread: float) -> Array:
        if not np.isfinite(expected).all():
            return np.zeros(len(MEASURED_STATE))
        difference = reading - expected
        if self._path.closed:
            difference[6] = math.remainder(difference[6], self._path.length)
        variance = 2.0 * self.noise**2 + (self.rates(expected) * spread) ** 2
        return np.asarray(difference**2 / variance)

    def rates(self, expected: Array) -> Array:
        """Standard deviations [7] of the readings' rates by what the model does not know."""
        p, v = self._p, max(float(expected[1]), self._slowest)
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


def spoilt_channels(reading: Array, last: Array, elapsed: float) -> Mask:
    """Which channels of a measured state [7] are wrong by themselves.

    Args:
        last: the last good one, NaN before the first; elapsed: time since [s].
    """
    with np.errstate(invalid="ignore"):
        wrong = ~np.isfinite(reading) | (np.abs(reading) > LARGEST)
        wrong[[1, 3]] |= reading[[1, 3]] <= 0.0
        if np.isfinite(last).all() and elapsed <= PATIENCE:
            wrong[:-1] |= (np.abs(reading - last) > NOISE + FASTEST * elapsed)[:-1]
    return np.asarray(wrong, dtype=np.bool_)


def reading_kind(reading: Array, spoilt: Mask, repeats: int) -> ReadingKind:
    """What a measured state [7] is.

    Args:
        spoilt: its channels that are wrong by themselves (`spoilt_channels`); repeats: readings equal to this one right
            before it.
    """
    if not np.isfinite(reading).all():
        return ReadingKind.MISSING
    if reading[1] <= 0.0 or reading[3] <= 0.0:
        return ReadingKind.STOPPED
    if spoilt.any():
        return ReadingKind.JUMPED
    return ReadingKind.FROZEN if repeats >= FROZEN else ReadingKind.GOOD


class JudgedReading(NamedTuple):
    """A reading with the verdict on it, as it lies in a vector."""

    kind: ReadingKind
    estimate: Array  # [7] the reading where it is good, else what the model and its good channels make of it
    streak: float = 0.0  # readings in a row that disagree with the model and agree with each other
    spread: float = 0.0  # [s] for which what is unmodelled has acted on the estimate
    out: Mask = np.zeros(len(MEASURED_STATE), dtype=bool)  # channels [7] not used until they agree with the others
    fused: Fused = Fused.after_good(np.zeros(len(MEASURED_STATE)))
    holding: Holding = Holding()

    def vector(self) -> Array:
        """[kind, streak, spread, estimate, out, holding, fused]."""
        head = [float(self.kind), self.streak, self.spread]
        return np.concatenate([head, self.estimate, self.out, self.holding, self.fused.vector()])

    @classmethod
    def of(cls, vector: Array) -> "JudgedReading":
        """The inverse of `vector`."""
        end = 17 + len(Holding._fields)
        estimate, out, holding, fused = vector[3:10], vector[10:17], vector[17:end], vector[end:]
        return cls(ReadingKind(int(vector[0])), np.array(estimate), float(vector[1]), float(vector[2]), out > 0.5,
                   Fused.of(fused), Holding(*holding.tolist()))  # fmt: skip


class Screen(LeafSystem):
    """Hands good readings on as they are, and NaN, which is no reading, in place of others.

    A reading is judged by itself and the last good one (`judge`), then by the model (`Innovation`), where there is
    one: it disagrees where its distance is beyond the bound. Where readings go on disagreeing with the model but agree
    with each other, it is the car that has changed, or the model that is wrong: they are believed. A channel of
    `CHECKED` that alone jumps or disagrees is not, until it is where the others say.

    Input ports: measured_state [7]; command [2], in force, without which the model is not asked.
    Output ports: judged, a `JudgedReading`; screened_state [7]; reading [1], a `ReadingKind`; estimate [7], the reading
    where it is good, else what the model and its good channels make of it (`fusion`); counts [6] of each kind so far.
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
        declare_update(self, period, self._update)
        self._made: tuple[bytes, Array] = b"", nothing  # scratch: see `_judgement`
        self._judged = declare_output(self, "judged", nothing.size, self._judgement)
        for name, length, calc in (
            ("screened_state", size, self._screened),
            ("reading", 1, lambda context: [float(self._verdict(context).kind)]),
            ("estimate", size, lambda context: self._verdict(context).estimate),
        ):
            declare_output(self, name, length, calc)
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

    def _judgement(self, context: Context) -> Array:
        """Kept for the next call: at each tick the log asks before the sensors' update and the controller after it."""
        held = (context.get_discrete_state(index).value() for index in (self._good, self._last, self._before))
        known = [[context.get_time()], self._measured.Eval(context), self._in_force(context), *held]
        key = np.concatenate(known).tobytes()
        if key != self._made[0]:
            self._made = key, self._judge(context).vector()
        return self._made[1]

    def _judge(self, context: Context) -> JudgedReading:
        x, t = np.array(self._measured.Eval(context)), context.get_time()
        good, before = (context.get_discrete_state(index).value() for index in (self._good, self._before))
        last = JudgedReading.of(before[1:-2])
        if t - before[0] < 0.5 * self._period:  # the same tick, after its update
            return last
        spoilt = spoilt_channels(x, good[1:], t - good[0])
        kind = reading_kind(x, spoilt, int(self._repeats(context)))
        if self._innovation is None:
            return JudgedReading(kind, x if kind == ReadingKind.GOOD else last.estimate)
        commands = before[-2:], self._in_force(context)
        believed = context.get_discrete_state(self._last).value()[1:]
        return self._by_the_model(self._innovation, x, kind, spoilt, last, believed, commands)

    def _by_the_model(
        self, model: Innovation, x: Array, kind: ReadingKind, spoilt: Mask, last: JudgedReading, before: Array,
        commands: tuple[Array, Array],
    ) -> JudgedReading:  # fmt: skip
        """A verdict by the model's prediction, too; `spoilt` [7]: wrong by themselves; before: the last reading [7]."""
        expected, jacobian = model.linearize(last.estimate, *commands)
        holding = last.holding.after_bad(self._period)
        if not np.isfinite(expected).all():
            estimate = x if kind == ReadingKind.GOOD else last.estimate
            holding = last.holding if kind == ReadingKind.GOOD else holding
            return JudgedReading(kind, estimate, spread=last.spread + self._period, holding=holding)
        rates, spread, streak = model.rates(expected), math.hypot(last.spread, self._period), 0.0
        agreeing, held = self._agreeing(model, x, expected, rates, last) if kind == ReadingKind.GOOD else (None, None)
        if agreeing is not None and not (last.out.any() or last.holding.doubted > 0.0):
            return agreeing  # nearly all readings
        moved, fused = predicted(expected, last.fused, jacobian, rates, self._period)
        # A channel that was wrong is so until it is where the others say: an offset that stays is none the truer.
        out = last.out & ~spoilt & ~within_gate(x - moved, fused, model.noise)
        out[BETA] |= last.holding.doubted > 0.0
        used = ~(spoilt | out)
        if kind == ReadingKind.GOOD and out.any():
            kind = ReadingKind.DISAGREEING
        elif kind == ReadingKind.GOOD:
            if agreeing is not None:
                return agreeing
            if held is not None:
                alone: int | None = BETA
                moved, fused = held.without(x, model.noise)
                holding = Holding(good=0.0, doubted=DOUBTED)
            else:
                alone = model.alone(x, expected, spread)
            kind = ReadingKind.DISAGREEING
            if alone is not None:
                out[alone], used[alone] = True, False
            else:
                rival = model.predict(before, *commands)
                agrees = model.distance(x, rival, self._period) <= model.bound
                streak, used = last.streak + 1.0 if agrees else 1.0, np.zeros_like(used)
                if streak * self._period >= PERSISTENT:
                    return JudgedReading(ReadingKind.GOOD, x, fused=Fused.after_good(model.noise), holding=holding)
        else:
            # Where readings are missing, a force that is not modelled goes on acting; those that disagree with the
            # model must not make it give way before they have lasted.
            spread = last.spread + self._period
            used = used if kind != ReadingKind.FROZEN else np.zeros_like(used)
        estimate, fused = corrected(moved, fused, x, used, model.noise, model.length)
        out |= spoilt & CHECKED & np.isfinite(x)
        return JudgedReading(
            kind, estimate, streak, spread, out if out.sum() <= MOST_OUT else np.zeros_like(out), fused, holding
        )

    def _agreeing(
        self, model: Innovation, x: Array, expected: Array, rates: Array, last: JudgedReading
    ) -> tuple[JudgedReading | None, Holding | None]:
        """(a good reading that agrees with the model's prediction and with what is held of the sideslip, if it does;
        what is held then, if it agrees with the prediction)."""
        if model.distance(x, expected, math.hypot(last.spread, self._period)) > model.bound:
            return None, None
        held = last.holding.after_bad(self._period)
        if last.kind == ReadingKind.GOOD:
            held = model.held(last.holding, x, last.estimate)
        if held.wrong(model.noise):
            return None, held
        fused = learnt(last.fused, x - expected, rates, model.noise, self._period)
        return JudgedReading(ReadingKind.GOOD, x, fused=fused, holding=held), held

    def _in_force(self, context: Context) -> Array:
        return self._command.Eval(context) if self._command.HasValue(context) else np.full(2, np.nan)

    def _update(self, context: Context, discrete: DiscreteValues) -> None:
        x, verdict, t = self._measured.Eval(context), self._verdict(context), context.get_time()
        discrete.get_mutable_vector(self._counts)[int(verdict.kind)] += 1.0
        discrete.set_value(self._last, np.concatenate([[self._repeats(context)], x]))
        discrete.set_value(self._before, np.concatenate([[t], verdict.vector(), self._in_force(context)]))
        if verdict.kind == ReadingKind.GOOD:
            discrete.set_value(self._good, np.concatenate([[t], x]))
