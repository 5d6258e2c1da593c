"""Is the car still one that the model knows? Out-of-distribution detection during a drive.

Each sample's innovation y - mu under the belief's predictive covariance (eq. 7) has a squared Mahalanobis distance d^2,
of four degrees of freedom where the model is right. Its mean over a window is the statistic. One sample's d^2 is no
independent draw given the last: what the features leave over lasts for several samples. So the statistic's spread is
not taken from the number of samples, but measured on drives that are in distribution (`calibrate`), and the statistic
is taken as a scaled chi-square of the mean and variance found there (Satterthwaite's approximation).
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem
from scipy.special import chdtri  # chi-square's; scipy.stats takes half a second to import

from drift_drake.common.arrays import Array
from drift_drake.common.updates import declare_output, declare_update
from drift_drake.drive.learnt.adapter import MEASURED_COUNT, PARAMETER_COUNT
from drift_drake.drive.learnt.bayesian_step import regression_points
from drift_drake.drive.learnt.checkpoint import BayesianModel
from drift_drake.drive.learnt.command_lag import TIME_STEP
from drift_drake.drive.learnt.features import COVARIANCE_COUNT, FEATURE_COUNT, MEAN_COUNT, STATE_COUNT
from drift_drake.drive.learnt.posterior import Posterior, mahalanobis, predict

WINDOW = 20  # samples: 2 s


def squared_distance(
    model: BayesianModel, belief: Posterior, x: Array, u: Array, u_next: Array, x_next: Array
) -> float:
    """d^2 of one sample: states and lagged commands at both ends of a step [8], commands there [2]; or NaN."""
    phi, y = regression_points(model, x, u, u_next, x_next)
    return float(mahalanobis(predict(belief, model.sigma, phi), y) ** 2)


def statistics(distances: Array, window: int = WINDOW) -> Array:
    """The statistic at each sample [n]: the mean of the last `window` of d^2 [n]; NaN until there are as many."""
    result = np.full(len(distances), np.nan)
    if len(distances) >= window:
        result[window - 1 :] = np.convolve(distances, np.full(window, 1.0 / window), "valid")
    return result


class NullDistribution(NamedTuple):
    """The statistic in distribution: mean * chi-square(freedom) / freedom."""

    mean: float  # 4 where the predictive covariance is right
    freedom: float  # 4 * window were the samples independent
    window: int

    def threshold(self, false_alarms: float, duration: float) -> float:
        """The bound that the statistic of a drive of `duration` [s] in distribution exceeds with at most a probability.

        At most, for all windows of the drive count as trials (Bonferroni), though overlapping ones are much alike.
        """
        windows = max(1.0, duration / TIME_STEP)
        return float(self.mean * chdtri(self.freedom, false_alarms / windows) / self.freedom)


def calibrate(drives: Sequence[Array], window: int = WINDOW) -> NullDistribution:
    """The statistic's distribution over drives in distribution, each a sequence of d^2.

    Raises:
        ValueError: no drive is longer than the window.
    """
    values = np.concatenate([statistics(distances, window) for distances in drives])
    values = values[np.isfinite(values)]
    if len(values) < 2:
        raise ValueError(f"no drive is longer than the window of {window} samples; give longer drives")
    mean = float(values.mean())
    return NullDistribution(mean, 2.0 * mean**2 / float(values.var(ddof=1)), window)


class OutOfDistributionDetector(LeafSystem):
    """The detector in the loop with a `BayesianAdapter` whose belief it judges by (a frozen one's too).

    At a tick, the step that ended is judged by the belief that was held during it; a step at whose ends other lags are
    believed is not judged.

    Input ports: measured_state [7]; command [2]; of the adapter lagged_command [2], parameters [70] and
    posterior_covariance [4096].

    Output ports: distance [1], d^2 of the last sample; statistic [1], NaN until the window is full; alarm [1], 1 while
    the statistic is above the threshold.

    Parameter in the Context: the threshold. State in the Context: the window of d^2 (newest last, NaN where there is
    none yet) and the state, commands and lags of the last tick.
    """

    def __init__(self, model: BayesianModel, threshold: float, window: int = WINDOW) -> None:
        super().__init__()
        self._model = model
        sizes = {"measured_state": MEASURED_COUNT, "command": 2, "lagged_command": 2, "parameters": PARAMETER_COUNT,
                 "posterior_covariance": COVARIANCE_COUNT}  # fmt: skip
        self._inputs = [self.DeclareVectorInputPort(name, size) for name, size in sizes.items()]
        self._threshold = self.DeclareNumericParameter(BasicVector([threshold]))
        self._window = self.DeclareDiscreteState(np.full(window, np.nan))
        self._last = self.DeclareDiscreteState(np.full(12, np.nan))
        held = {self.discrete_state_ticket(self._window)}
        declare_output(self, "distance", 1, lambda context: self._distances(context)[-1:], held)
        declare_output(self, "statistic", 1, lambda context: [self._statistic(context)], held)
        declare_output(self, "alarm", 1, self._alarm, {*held, self.all_parameters_ticket()})
        declare_update(self, TIME_STEP, self._tick)

    def _tick(self, context: Context, discrete: DiscreteValues) -> None:
        measured, u, lagged, parameters, covariance = (port.Eval(context) for port in self._inputs)
        x, last = np.concatenate([measured[:6], lagged]), context.get_discrete_state(self._last).value()
        mean, lag = parameters[:MEAN_COUNT], parameters[-2:]
        if np.isfinite(last).all() and np.isfinite(x).all() and np.array_equal(lag, last[10:]):
            shape = (STATE_COUNT, FEATURE_COUNT)
            whole = covariance.reshape(MEAN_COUNT, MEAN_COUNT)
            belief = Posterior(mean.reshape(shape), whole, np.full(shape, np.nan))
            distance = squared_distance(self._model.with_lag(lag), belief, last[:8], last[8:10], u, x)
            window = np.append(self._distances(context)[1:], distance)
            discrete.set_value(self._window, window)
        discrete.set_value(self._last, np.concatenate([x, u, lag]))

    def _distances(self, context: Context) -> Array:
        return context.get_discrete_state(self._window).value()

    def _statistic(self, context: Context) -> float:
        return float(np.mean(self._distances(context)))

    def _alarm(self, context: Context) -> list[float]:
        threshold = context.get_numeric_parameter(self._threshold).value()[0]
        return [float(self._statistic(context) > threshold)]
