"""BayesianAdapter: the last layer's posterior, updated in the loop."""

import numpy as np
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem

from drift_drake.arrays import Array
from drift_drake.model.bayesian_step import regression_points
from drift_drake.model.checkpoint import BayesianModel
from drift_drake.model.compiled_step import TIME_STEP
from drift_drake.model.features import COVARIANCE_COUNT, FEATURE_COUNT, MEAN_COUNT, STATE_COUNT, network_inputs
from drift_drake.model.posterior import Posterior, mahalanobis, predict, update

MEASURED_COUNT = 7  # (r, v, beta, omega_r, e, dphi, s)
DEFAULT_THRESHOLD = 8.0
WINDOW = 20  # samples: 2 s
OFFSET_TIME = 2.0  # [s] of the offset, for a car that no model knows; chosen of 0.4, 1 and 2 on eight double-track cars


def adapt(model: BayesianModel, posterior: Posterior, x: Array, u: Array, u_next: Array, x_next: Array,
          threshold: float = DEFAULT_THRESHOLD) -> tuple[Posterior, Array | None]:  # fmt: skip
    """The posterior after one sample, unless the sample is refused.

    A sample is refused when it is not finite, or when its Mahalanobis distance from the prediction (eq. 6, over the
    four learnt states) is beyond the threshold: a spike of a sensor rather than news of the car.

    Args:
        x, x_next: measured states and lagged commands at both ends of the step [8]; u, u_next: commands there [2].

    Returns:
        (posterior; what the learnt states did over the step beside what its mean says [4], None of a refused sample).
    """
    numbers = np.concatenate([network_inputs(x, u, u_next), x_next[:STATE_COUNT]])
    if not np.isfinite(numbers).all():
        return posterior, None
    phi, y = regression_points(model, x, u, u_next, x_next)
    if mahalanobis(predict(posterior, model.sigma, phi), y) > threshold:
        return posterior, None
    after = update(posterior, model.sigma, phi, y, model.sample_weight)
    return after, y - np.sum(after.mean * phi, axis=-1)


class BayesianAdapter(LeafSystem):
    """Adapts the last layer to the car at hand: every `TIME_STEP` one sample, from the step that ended.

    Input ports:
        measured_state [7]: (r, v, beta, omega_r, e, dphi, s) as the sensors give it.
        command [2]: (delta, tau) in force.
        lagged_command [2]: see `CommandLag`.
        trusted [1] (optional): falls from 1 to 0 when the car has become another one (`GapMonitor`); of what was learnt
            before, a share `kept` then counts.

    Output ports:
        posterior_mean [64]: theta, states by features (row-major [4, 16]).
        posterior_covariance [4096]: Lambda^{-1}, row-major [64, 64].
        parameters [68]: theta, then the offset: what the learnt states did over a step beside what theta says, in a
            running mean of the samples taken over `offset_time`. It holds what the features and their prior leave over,
            such as a resistance that no vehicle of the training had (offset-free predictive control: Pannocchia and
            Rawlings 2003). Zero without `offset_time`.
        counters [2]: samples (taken, refused).

    Parameters in the Context: `frozen` (no updates while above 0.5) and `threshold` (Mahalanobis distance beyond which
    a sample is refused); see `set_frozen`, `set_threshold`. State in the Context: the posterior, the offset, the
    counters, the measurement and commands of the last tick, and whether the car was then trusted to be the same. The
    tick at t takes the sample of [t - `TIME_STEP`, t].
    """

    def __init__(
        self, model: BayesianModel, threshold: float = DEFAULT_THRESHOLD, offset_time: float | None = None
    ) -> None:
        """Args: model: its prior is the state that a default Context starts with; offset_time: of the offset [s]."""
        super().__init__()
        self.model, self.offset_time = model, offset_time
        prior = model.prior()
        self._measured = self.DeclareVectorInputPort("measured_state", MEASURED_COUNT)
        self._command = self.DeclareVectorInputPort("command", 2)
        self._lagged = self.DeclareVectorInputPort("lagged_command", 2)
        self._trusted = self.DeclareVectorInputPort("trusted", 1)
        self._mean = self.DeclareDiscreteState(prior.mean.ravel())
        self._covariance = self.DeclareDiscreteState(prior.covariance.ravel())
        self._q = self.DeclareDiscreteState(prior.q.ravel())
        self._counters = self.DeclareDiscreteState(2)
        self._offset = self.DeclareDiscreteState(STATE_COUNT)
        # The last tick: its measured state, lagged command and command; NaN before the first.
        self._last = self.DeclareDiscreteState(np.full(10, np.nan))
        self._started = self.DeclareDiscreteState(1)
        self._was_trusted = self.DeclareDiscreteState(1)
        self._frozen = self.DeclareNumericParameter(BasicVector([0.0]))
        self._threshold = self.DeclareNumericParameter(BasicVector([threshold]))
        for name, index, size in (
            ("posterior_mean", self._mean, MEAN_COUNT),
            ("posterior_covariance", self._covariance, COVARIANCE_COUNT),
            ("counters", self._counters, 2),
        ):
            self.DeclareStateOutputPort(name, index)
            assert self.GetOutputPort(name).size() == size
        self.DeclareVectorOutputPort(
            "parameters",
            MEAN_COUNT + STATE_COUNT,
            lambda context, output: output.SetFromVector(
                np.concatenate([context.get_discrete_state(index).value() for index in (self._mean, self._offset)])
            ),
            prerequisites_of_calc={self.discrete_state_ticket(index) for index in (self._mean, self._offset)},
        )
        self.DeclarePeriodicDiscreteUpdateEvent(TIME_STEP, 0.0, self._tick)

    def _tick(self, context: Context, discrete: DiscreteValues) -> None:
        x = np.concatenate([self._measured.Eval(context)[:6], self._lagged.Eval(context)])
        u = self._command.Eval(context)
        last = context.get_discrete_state(self._last).value()
        frozen = context.get_numeric_parameter(self._frozen).value()[0] > 0.5
        if context.get_discrete_state(self._started).value()[0] > 0.5 and not frozen:
            threshold = context.get_numeric_parameter(self._threshold).value()[0]
            before, changed = self._remembered(context)
            posterior, left = adapt(self.model, before, last[:8], last[8:], u, x, threshold)
            taken = left is not None
            if taken or changed:
                self._write(discrete, posterior)
            if self.offset_time is not None:
                offset = np.zeros(STATE_COUNT) if changed else context.get_discrete_state(self._offset).value()
                rise = 0.0 if left is None else left - offset
                discrete.set_value(self._offset, offset + TIME_STEP / self.offset_time * rise)
            counters = discrete.get_mutable_vector(self._counters)
            counters.SetAtIndex(0 if taken else 1, counters.GetAtIndex(0 if taken else 1) + 1.0)
        discrete.get_mutable_vector(self._last).SetFromVector(np.concatenate([x, u]))
        discrete.get_mutable_vector(self._started).SetFromVector([1.0])
        if self._trusted.HasValue(context):
            discrete.get_mutable_vector(self._was_trusted).SetFromVector(self._trusted.Eval(context))

    def _remembered(self, context: Context) -> tuple[Posterior, bool]:
        """(the posterior before this tick's sample, whether something of it was forgotten)."""
        posterior, was = self.posterior(context), context.get_discrete_state(self._was_trusted).value()[0]
        if not self._trusted.HasValue(context) or self._trusted.Eval(context)[0] > 0.5 or was < 0.5:
            return posterior, False
        return self.model.prior(), True

    def _write(self, discrete: DiscreteValues, posterior: Posterior) -> None:
        for index, values in zip((self._mean, self._covariance, self._q), posterior, strict=True):
            discrete.get_mutable_vector(index).SetFromVector(values.ravel())

    def posterior(self, context: Context) -> Posterior:
        """The posterior in a Context of this system."""
        mean, covariance, q = (
            np.array(context.get_discrete_state(index).value()) for index in (self._mean, self._covariance, self._q)
        )
        shape = (STATE_COUNT, FEATURE_COUNT)
        return Posterior(mean.reshape(shape), covariance.reshape(MEAN_COUNT, MEAN_COUNT), q.reshape(shape))

    def set_posterior(self, context: Context, posterior: Posterior) -> None:
        """Puts a posterior, of an earlier drive say, into a Context of this system."""
        self._write(context.get_mutable_discrete_state(), posterior)

    def set_frozen(self, context: Context, frozen: bool) -> None:
        """Stops or resumes adaptation in a Context of this system; the outputs stay."""
        context.get_mutable_numeric_parameter(self._frozen).SetFromVector([1.0 if frozen else 0.0])

    def set_threshold(self, context: Context, threshold: float) -> None:
        """Sets the Mahalanobis distance beyond which samples are refused."""
        context.get_mutable_numeric_parameter(self._threshold).SetFromVector([threshold])
