"""What the car's sensors say: sampled, held, biased, late and noisy."""

import dataclasses
import math
from typing import Any

import numpy as np
from pydrake.common import RandomDistribution, RandomGenerator
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, DiscreteValues, LeafSystem, State
from pydrake.systems.primitives import RandomSource

from drift_drake.car.compilation import compiled
from drift_drake.car.effects.delays import sensor_delay
from drift_drake.car.effects.magnitudes import COUNT, Effects, measured
from drift_drake.car.scalar import fixed_tuple
from drift_drake.car.single_track.motion import STATES
from drift_drake.common.arrays import Array
from drift_drake.common.errors import InvalidOptionError, shown
from drift_drake.common.selector import select_signals
from drift_drake.common.updates import declare_output, declare_update

TIME_TOLERANCE = 1e-9  # [s] below which two times are the same
SIGNALS = (*STATES, "s", "x", "y", "psi", "ax", "ay")
"""The measured signals: `state`, `path_position`, `pose` and `acceleration` of the plant, in this order."""
MEASURED_STATE = (*STATES, "s")
PARTS = {"state": STATES, "path_position": ("s",), "pose": ("x", "y", "psi"), "acceleration": ("ax", "ay")}
"""The signals of each of these ports."""
LOG_ROW = ("t", "x", "y", "psi", "r", "v", "beta", "omega_r", "ax", "ay")
"""Columns of the log format, the commands aside (which are known exactly)."""
_SAMPLE = ("t", *SIGNALS)
_R, _V, _BETA, _OMEGA_R, _DPHI = (_SAMPLE.index(name) for name in ("r", "v", "beta", "omega_r", "dphi"))


class TransportDelay(LeafSystem):
    """Output y(t) = u(t - delay), from rows of u that are stored each `period` and interpolated linearly.

    Exact for signals that are linear between the rows, and for every signal where t - delay is a row's time. Before
    the first row the signal is taken to have been what it was when the Simulator initialized the Context; until that
    is done the output is zero.

    Input ports: u. Output ports: y. The output depends on the input directly only if the delay is below `period`.

    Args:
        size: length of the signal.
        delay: [s], zero or more.
        period: time between rows [s].
        offset: time of the first row [s].

    Raises:
        ValueError: a negative delay, or a period that is not positive.
    """

    def __init__(self, size: int, delay: float, period: float = 0.01, offset: float = 0.0) -> None:
        LeafSystem.__init__(self)
        if not 0.0 <= delay < math.inf:
            raise ValueError(f"delay is {delay!r}; give it in seconds, zero or more")
        if not 0.0 < period < math.inf:
            raise ValueError(f"period is {period!r}; give it in seconds, above zero")
        self.delay, self.period = float(delay), float(period)
        self._shorter_than_period = self.delay < period - TIME_TOLERANCE
        self._u = self.DeclareVectorInputPort("u", size)
        prerequisites = {self.input_port_ticket(self._u.get_index())}
        if self.delay > 0.0:
            # A row each period back to t - delay, the one before it, and the one of the update still to come.
            self._shape = (math.ceil(self.delay / period) + 2, 1 + size)
            rows = np.zeros(self._shape)
            rows[:, 0] = -math.inf
            # One row is [time, u(time)]; the oldest comes first.
            rows_index = self.DeclareDiscreteState(rows.ravel())
            self.DeclareInitializationDiscreteUpdateEvent(self._fill)
            declare_update(self, period, self._store, offset)
            past = {self.time_ticket(), self.discrete_state_ticket(rows_index)}
            prerequisites = past | prerequisites if self._shorter_than_period else past
        declare_output(self, "y", size, self._delayed, prerequisites)

    def _rows(self, context: Context) -> Any:
        return context.get_discrete_state_vector().value().reshape(self._shape)

    def _fill(self, context: Context, discrete: DiscreteValues) -> None:
        rows = np.empty(self._shape)
        rows[:, 0] = -math.inf
        rows[-1, 0] = context.get_time()
        rows[:, 1:] = self._u.Eval(context)
        discrete.set_value(rows.ravel())

    def _store(self, context: Context, discrete: DiscreteValues) -> None:
        rows = self._rows(context)
        # A row at the time of the last one replaces it (the update at the time of the initialization).
        kept = rows[:-1] if context.get_time() - rows[-1, 0] < TIME_TOLERANCE else rows[1:]
        row = np.concatenate(([context.get_time()], self._u.Eval(context)))
        discrete.set_value(np.concatenate((kept.ravel(), row)))

    def _delayed(self, context: Context) -> Array:
        if self.delay == 0.0:
            return self._u.Eval(context)
        rows, at = self._rows(context), context.get_time() - self.delay
        after = int(np.searchsorted(rows[:, 0], at))
        if after == 0:
            raise RuntimeError(
                f"TransportDelay: the clock went backwards to {context.get_time():g} s; initialize again"
            )
        if after < len(rows):
            (t0, t1), (u0, u1) = rows[after - 1 : after + 1, 0], rows[after - 1 : after + 1, 1:]
        elif self._shorter_than_period and math.isfinite(rows[-1, 0]):
            (t0, t1), (u0, u1) = (rows[-1, 0], context.get_time()), (rows[-1, 1:], self._u.Eval(context))
        else:
            # Not initialized yet, or a time that is the last row's but for rounding.
            return rows[-1, 1:]
        part = (at - t0) / (t1 - t0) if math.isfinite(t0) else 1.0
        return u0 + part * (u1 - u0) if part < 1.0 else u1


@dataclasses.dataclass(frozen=True)
class NoiseLevels:
    """Standard deviations of white measurement noise, a sample each period. Defaults: a good inertial system.

    Raises:
        ValueError: a level that is negative or not finite.

    Examples:
        >>> noisy = Car(car, noise=NoiseLevels(r=0.01))
    """

    r: float = 0.002  # [rad/s]
    v: float = 0.02  # [m/s]
    beta: float = 0.002  # [rad]
    omega_r: float = 0.04  # [m/s]
    e: float = 0.01  # [m]
    dphi: float = 0.002  # [rad]
    s: float = 0.01  # [m]
    x: float = 0.01  # [m]
    y: float = 0.01  # [m]
    psi: float = 0.001  # [rad]
    ax: float = 0.05  # [m/s^2]
    ay: float = 0.05  # [m/s^2]

    def __post_init__(self) -> None:
        for name, level in dataclasses.asdict(self).items():
            if not 0.0 <= level < math.inf:
                raise ValueError(f"noise of {name} is {level!r}; give a standard deviation, zero or more")

    @classmethod
    def none(cls) -> "NoiseLevels":
        """Perfect sensors: all levels zero."""
        return cls(*([0.0] * len(dataclasses.fields(cls))))


@compiled
def _sampled(t: float, signals: Array, levels: Array, noise: Array, magnitudes: Array) -> Array:
    """(time, noisy and biased signals)."""
    sample, q = np.empty(1 + signals.size), Effects(*fixed_tuple(magnitudes, COUNT))
    sample[0] = t
    for i in range(signals.size):
        sample[1 + i] = signals[i] + levels[i] * noise[i]
    beta = sample[_BETA]
    sample[_R], sample[_V], sample[_BETA], sample[_OMEGA_R] = measured(
        sample[_R], sample[_V], beta, sample[_OMEGA_R], q
    )
    # The course is the measured heading plus the measured sideslip, so it takes over the bias.
    sample[_DPHI] += sample[_BETA] - beta
    return sample


class SampleAndHold(LeafSystem):
    """Takes a noisy sample of all signals each period and holds it, biased as the effects say.

    The hold is continuous from the right: at a sampling time the output already is the sample taken then, for whoever
    else acts at that time (a controller's update, a logger's publish), before Drake's updates and after them.

    Input ports: signals (`SIGNALS`); noise: as many standard normal numbers, new ones each period.
    Output port: sample (the time of sampling, `SIGNALS`).
    """

    def __init__(self, noise: NoiseLevels, effects: Effects, period: float) -> None:
        LeafSystem.__init__(self)
        self._magnitudes, self._period = np.array(effects), period
        self._levels = np.array([getattr(noise, name) for name in SIGNALS])
        self._signals = self.DeclareVectorInputPort("signals", len(SIGNALS))
        self._noise = self.DeclareVectorInputPort("noise", len(SIGNALS))
        self.DeclareDiscreteState(np.full(1 + len(SIGNALS), np.nan))  # the time of sampling, and the sample
        # Drake's random source draws in an unrestricted update, and those come before the discrete ones: only as one of
        # them does the sample keep the noise that the outputs had just before the updates.
        self.DeclarePeriodicUnrestrictedUpdateEvent(period, 0.0, self._update)
        self.DeclareForcedUnrestrictedUpdateEvent(self._update)
        sources = {
            self.time_ticket(),
            self.xd_ticket(),
            self.input_port_ticket(self._signals.get_index()),
            self.input_port_ticket(self._noise.get_index()),
        }
        self._sample = declare_output(self, "sample", len(_SAMPLE), self._sampled, sources)

    def _samples_before(self, t: float) -> int:
        return math.floor(t / self._period + 1e-6)

    def _sampled(self, context: Context) -> Array:
        """The sample held, or the one that is due at the Context's time."""
        held, t = context.get_discrete_state_vector().value(), context.get_time()
        if not math.isnan(held[0]) and self._samples_before(t) <= self._samples_before(held[0]):
            return held
        signals, noise = self._signals.Eval(context), self._noise.Eval(context)
        return _sampled(t, signals, self._levels, noise, self._magnitudes)

    def _update(self, context: Context, state: State) -> None:
        state.get_mutable_discrete_state().set_value(self._sample.Eval(context))


class Sensors(Diagram):
    """The car's sensors: latency, sampling, biases and noise from Drake's random source.

    A run replays to the bit from the seed that `set_seed` gave its Context (without one, Drake numbers its sources as
    they are made).

    Input ports: state (6), path_position (1), pose (3), acceleration (2): those of `VehiclePlant`.
    Output ports: measured_state (`MEASURED_STATE`) for a controller; log_row (`LOG_ROW`) for a log.

    Args:
        noise: standard deviations.
        effects: of which the sensors' are used: biases, gains, sensor_latency.
        period: of sampling [s].
    """

    def __init__(
        self,
        noise: NoiseLevels = NoiseLevels(),
        effects: Effects = Effects(),
        period: float = 0.01,
    ) -> None:
        Diagram.__init__(self)
        builder = DiagramBuilder()
        signals = builder.AddNamedSystem("signals", select_signals(PARTS, {"signals": SIGNALS}))
        for name in PARTS:
            builder.ExportInput(signals.GetInputPort(name), name)
        source = RandomSource(RandomDistribution.kGaussian, len(SIGNALS), period)
        self.noise_source = builder.AddNamedSystem("noise", source)
        sampler = builder.AddNamedSystem("sampler", SampleAndHold(noise, effects, period))
        builder.Connect(self.noise_source.get_output_port(), sampler.GetInputPort("noise"))
        if (late := sensor_delay(effects)) != 0.0:
            # Rows are taken where the sampler will look, so that nothing is interpolated.
            offset = -late % period
            latency = TransportDelay(len(SIGNALS), late, period, offset)
            builder.AddNamedSystem("latency", latency)
            builder.Connect(signals.get_output_port(0), latency.get_input_port())
            builder.Connect(latency.get_output_port(), sampler.GetInputPort("signals"))
        else:
            builder.Connect(signals.get_output_port(0), sampler.GetInputPort("signals"))
        ports = {"measured_state": MEASURED_STATE, "log_row": LOG_ROW}
        parts = builder.AddNamedSystem("sample_parts", select_signals({"sample": _SAMPLE}, ports))
        builder.Connect(sampler.get_output_port(), parts.get_input_port())
        for name in ports:
            builder.ExportOutput(parts.GetOutputPort(name), name)
        builder.BuildInto(self)

    def set_seed(self, root_context: Context, seed: int) -> None:
        """Starts the noise of this Context (of the whole diagram that holds the sensors) from a seed.

        Raises:
            InvalidOptionError: the seed is no whole number from 0 to 2^63 - 1.
        """
        if not isinstance(seed, int | np.integer) or not 0 <= seed < 2**63:
            raise InvalidOptionError(f"the seed is {shown(seed)}; give a whole number, 0 or more")
        context = self.noise_source.GetMyMutableContextFromRoot(root_context)
        self.noise_source.SetRandomContext(context, RandomGenerator(int(seed)))
