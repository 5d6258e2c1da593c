"""BayesianAdapter: the last layer's posterior, updated in the loop, under one pair of lags or a bank of them."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem

from drift_drake.car.internal_states import InternalStateObserver, RememberingStepModel
from drift_drake.common.arrays import Array
from drift_drake.common.updates import declare_output, declare_update
from drift_drake.drive.learnt.bayesian_step import bank_points
from drift_drake.drive.learnt.checkpoint import BayesianModel
from drift_drake.drive.learnt.command_lag import TIME_STEP, CommandLag
from drift_drake.drive.learnt.features import COVARIANCE_COUNT, FEATURE_COUNT, MEAN_COUNT, STATE_COUNT
from drift_drake.drive.learnt.hybrid_step import left_over
from drift_drake.drive.learnt.noise import Noise
from drift_drake.drive.learnt.posterior import Posterior, mahalanobis, predict, update_and_density

MEASURED_COUNT = 7  # (r, v, beta, omega_r, e, dphi, s)
PARAMETER_COUNT = MEAN_COUNT + STATE_COUNT + 2  # of the output port `parameters`
DEFAULT_THRESHOLD = 8.0
# [s] of the offset, by model. The first was chosen of 0.4, 1 and 2 on eight double-track cars; the second of none, 1
# and 2 on nine multi-body cars of draw 881, where it keeps two on the lane that are lost without.
OFFSET_TIMES = {"offset_free": 2.0, "varied": 1.0}


class Adapted(NamedTuple):
    """What one sample teaches a model."""

    posterior: Posterior
    density: float  # log of the sample's by the belief before it [nat]
    left: Array  # what the learnt states did over the step, less what the posterior's mean says [4]
    distance: float  # of the sample from what was predicted of it (`mahalanobis`)


class Beliefs(NamedTuple):
    """What is believed of a car under each pair of a bank's lags."""

    posteriors: list[Posterior]  # [K]
    evidence: Array  # log density of the samples so far under each pair [K] [nat]


def adapt_bank(
    models: Sequence[BayesianModel], posteriors: Sequence[Posterior], x: Array, lagged: Array, u: Array, u_next: Array,
    x_next: Array, threshold: float, car: RememberingStepModel | None = None,
) -> list[Adapted] | None:  # fmt: skip
    """Each posterior after one sample, of models that differ in their lags; None if the sample is refused.

    A sample is refused when it is not finite, or when its Mahalanobis distance from what each model predicts (eq. 7,
    over the four learnt states) is beyond the threshold: a spike of a sensor rather than news of the car.

    Args:
        x, x_next: measured states at both ends of the step [6 or more]; u, u_next: commands there [2]; lagged: those at
            its start behind each model's lags [K, 2], or the car's internal states [1, m]; car: inside h of a hybrid
            model (`hybrid_step`), in place of the nominal one.
    """
    if not (np.isfinite(x[:STATE_COUNT]).all() and np.isfinite(x_next[:STATE_COUNT]).all()):
        return None
    if not (np.isfinite(lagged).all() and np.isfinite(u).all() and np.isfinite(u_next).all()):
        return None
    rows = np.column_stack([np.tile(x[:6], (len(lagged), 1)), lagged])
    if car is not None:
        rows, *later = left_over(car, models[0].vehicle, rows, u[None], u_next[None], x_next[None])
        u, u_next, x_next = (part[0] for part in later)
    each = list(zip(models, posteriors, *bank_points(models, rows, u, u_next, x_next), strict=True))
    distances = [float(mahalanobis(predict(belief, model.sigma, phi), y)) for model, belief, phi, y in each]
    if min(distances) > threshold:
        return None
    found = []
    for (model, belief, phi, y), distance in zip(each, distances, strict=True):
        after, density = update_and_density(belief, model.sigma, phi, y, model.sample_weight)
        found.append(Adapted(after, density, y - np.sum(after.mean * phi, axis=-1), distance))
    return found


class BayesianAdapter(LeafSystem):
    """Adapts the last layer to the car at hand (section II of the paper): a sample each `TIME_STEP`.

    With a bank of lags it learns under each of them, and believes the pair that the samples so far are likeliest under
    (`lag_bank`); before the first sample, and where all are alike, the first.

    Input ports:
        measured_state [7]: (r, v, beta, omega_r, e, dphi, s) as the sensors give it.
        command [2]: (delta, tau) in force.
        lagged_command [2 K]: behind each of the K pairs of lags, see `CommandLag`.
        trusted [1] (optional): falls from 1 to 0 when the car has become another one (`GapMonitor`); what was learnt
            before is then forgotten.

    Output ports, of the pair of lags that is believed:
        posterior_mean [64]: theta, states by features (row-major [4, 16]).
        posterior_covariance [4096]: Lambda^{-1}, row-major [64, 64].
        parameters [70]: theta, the offset, the lags [s]. The offset is what the learnt states did over a step, less
            what theta says, in a running mean of the samples taken over `offset_time`. It holds what the features and
            their prior leave over, such as a resistance that no vehicle of the training had (offset-free predictive
            control: Pannocchia and Rawlings 2003). Zero without `offset_time`.
        noise [2]: of `Noise`: how much more, or less, than the model states the car's samples lately scatter.
        internal_states [2]: the commands behind these lags.
        counters [2]: samples (taken, refused).

    Parameters in the Context: `frozen` (no updates while above 0.5) and `threshold` (Mahalanobis distance beyond which
    a sample is refused); see `set_frozen`. State in the Context: the posteriors, the log evidence of
    each pair of lags, the offset, the counters, the measurement and commands of the last tick, and whether the car was
    then trusted to be the same. The tick at t takes the sample of [t - `TIME_STEP`, t].

    Examples:
        >>> BayesianAdapter(model).GetOutputPort("posterior_mean").size()
        64
    """

    def __init__(
        self, model: BayesianModel, threshold: float = DEFAULT_THRESHOLD, offset_time: float | None = None,
        lags: Array | None = None, car: RememberingStepModel | None = None,
    ) -> None:  # fmt: skip
        """Args:
        model: its prior is the state that a default Context starts with; threshold: Mahalanobis distance [-];
        offset_time: of the offset [s]; lags: of steering and torque [K, 2] in s; the model's own without; car: inside
        h, identified, in place of the nominal one: its internal states are asked for, and its lags are believed.
        """
        super().__init__()
        self.car, width = car, 2 if car is None else len(car.internal_scale)
        self.lags = np.array(model.lag[None] if lags is None or car is not None else lags, dtype=float)
        self.model, self.offset_time = model, offset_time
        self._models, count = [model.with_lag(lag) for lag in self.lags], len(self.lags)
        prior = model.prior()
        self._measured = self.DeclareVectorInputPort("measured_state", MEASURED_COUNT)
        self._command = self.DeclareVectorInputPort("command", 2)
        self._lagged = self.DeclareVectorInputPort("lagged_command", width * count)
        self._trusted = self.DeclareVectorInputPort("trusted", 1)
        self._beliefs = [self.DeclareDiscreteState(np.tile(values.ravel(), count)) for values in prior]
        self._evidence = self.DeclareDiscreteState(count)
        self._noise = self.DeclareDiscreteState(np.tile(Noise(), count))
        self._counters = self.DeclareDiscreteState(2)
        self._offset = self.DeclareDiscreteState(STATE_COUNT)
        # The last tick: its measured state, command and lagged commands; NaN before the first.
        self._last = self.DeclareDiscreteState(np.full(8 + width * count, np.nan))
        self._started = self.DeclareDiscreteState(1)
        self._was_trusted = self.DeclareDiscreteState(1)
        self._frozen = self.DeclareNumericParameter(BasicVector([0.0]))
        self._threshold = self.DeclareNumericParameter(BasicVector([threshold]))
        believed = {self.discrete_state_ticket(index) for index in (*self._beliefs, self._evidence, self._offset)}
        noise = self.discrete_state_ticket(self._noise)
        for name, size, calc, further in (
            ("posterior_mean", MEAN_COUNT, lambda context: self.posterior(context).mean.ravel(), ()),
            ("posterior_covariance", COVARIANCE_COUNT, lambda context: self.posterior(context).covariance.ravel(), ()),
            ("parameters", PARAMETER_COUNT, self._parameters, ()),
            ("noise", len(Noise()), lambda context: np.array(self.noise(context)), (noise,)),
            ("internal_states", width, self._internal, (self._lagged.ticket(),)),
        ):
            declare_output(self, name, size, calc, {*believed, *further})
        self.DeclareStateOutputPort("counters", self._counters)
        declare_update(self, TIME_STEP, self._tick)

    def _parameters(self, context: Context) -> Array:
        offset, lag = context.get_discrete_state(self._offset).value(), self.lags[self.believed(context)]
        return np.concatenate([self.posterior(context).mean.ravel(), offset, lag])

    def _internal(self, context: Context) -> Array:
        return self._lagged.Eval(context).reshape(len(self.lags), -1)[self.believed(context)]

    def _tick(self, context: Context, discrete: DiscreteValues) -> None:
        x, u = self._measured.Eval(context)[:6], self._command.Eval(context)
        last = context.get_discrete_state(self._last).value()
        frozen = context.get_numeric_parameter(self._frozen).value()[0] > 0.5
        if context.get_discrete_state(self._started).value()[0] > 0.5 and not frozen:
            threshold = context.get_numeric_parameter(self._threshold).value()[0]
            before, evidence, changed = self._remembered(context)
            noise = [Noise()] * len(self.lags) if changed else self._noises(context)
            found = adapt_bank(
                self._models, before, last[:6], last[8:].reshape(len(self.lags), -1), last[6:8], u, x, threshold,
                    self.car,
            )  # fmt: skip
            if found is not None:
                noise = [of.after(one.distance**2) for of, one in zip(noise, found, strict=True)]
                before, evidence = [one.posterior for one in found], evidence + [one.density for one in found]
            if found is not None or changed:
                self._write(discrete, before)
                discrete.set_value(self._evidence, evidence)
                discrete.set_value(self._noise, np.ravel(noise))
            if self.offset_time is not None:
                offset = np.zeros(STATE_COUNT) if changed else context.get_discrete_state(self._offset).value()
                rise = 0.0 if found is None else found[int(np.argmax(evidence))].left - offset
                discrete.set_value(self._offset, offset + TIME_STEP / self.offset_time * rise)
            counters = discrete.get_mutable_vector(self._counters)
            place = 0 if found is not None else 1
            counters.SetAtIndex(place, counters.GetAtIndex(place) + 1.0)
        discrete.set_value(self._last, np.concatenate([x, u, self._lagged.Eval(context)]))
        discrete.get_mutable_vector(self._started).SetFromVector([1.0])
        if self._trusted.HasValue(context):
            discrete.get_mutable_vector(self._was_trusted).SetFromVector(self._trusted.Eval(context))

    def _remembered(self, context: Context) -> tuple[list[Posterior], Array, bool]:
        """(posteriors and log evidence before this tick's sample, whether something was forgotten)."""
        was = context.get_discrete_state(self._was_trusted).value()[0]
        if not self._trusted.HasValue(context) or self._trusted.Eval(context)[0] > 0.5 or was < 0.5:
            return self._posteriors(context), context.get_discrete_state(self._evidence).value(), False
        return [self.model.prior()] * len(self.lags), np.zeros(len(self.lags)), True

    def _write(self, discrete: DiscreteValues, posteriors: Sequence[Posterior]) -> None:
        for index, values in zip(self._beliefs, zip(*posteriors, strict=True), strict=True):
            discrete.set_value(index, np.concatenate([value.ravel() for value in values]))

    def observer(self, period: float) -> LeafSystem:
        """What follows the commands behind the lags, or the car's internal states, every `period` [s]."""
        return CommandLag(period, self.lags) if self.car is None else InternalStateObserver(self.car, period)

    def believed(self, context: Context) -> int:
        """Which of `lags` is believed in a Context of this system."""
        return int(np.argmax(context.get_discrete_state(self._evidence).value()))

    def _posteriors(self, context: Context) -> list[Posterior]:
        by_state, square = (-1, STATE_COUNT, FEATURE_COUNT), (-1, MEAN_COUNT, MEAN_COUNT)
        held = (
            np.array(context.get_discrete_state(index).value()).reshape(shape)
            for index, shape in zip(self._beliefs, (by_state, square, by_state), strict=True)
        )
        return [Posterior(*values) for values in zip(*held, strict=True)]

    def posterior(self, context: Context) -> Posterior:
        """The posterior in a Context of this system, under the lags that are believed."""
        return self._posteriors(context)[self.believed(context)]

    def _noises(self, context: Context) -> list[Noise]:
        held = np.array(context.get_discrete_state(self._noise).value())
        return [Noise(*map(float, row)) for row in held.reshape(len(self.lags), -1)]

    def noise(self, context: Context) -> Noise:
        """How far the car's samples lately were off what was stated of them, under the lags that are believed."""
        return self._noises(context)[self.believed(context)]

    def set_posterior(self, context: Context, posterior: Posterior) -> None:
        """Puts a posterior into a Context of this system, under all lags alike."""
        self.set_beliefs(context, Beliefs([posterior] * len(self.lags), np.zeros(len(self.lags))))

    def set_beliefs(self, context: Context, beliefs: Beliefs) -> None:
        """Puts what is believed under each of its lags into a Context of this system.

        Args:
            context: of this system; beliefs: what an earlier drive has taught (`beliefs_after`), say.
        """
        discrete = context.get_mutable_discrete_state()
        self._write(discrete, beliefs.posteriors)
        discrete.set_value(self._evidence, beliefs.evidence)

    def set_frozen(self, context: Context, frozen: bool) -> None:
        """Stops or resumes adaptation in a Context of this system; the outputs stay."""
        context.get_mutable_numeric_parameter(self._frozen).SetFromVector([1.0 if frozen else 0.0])
