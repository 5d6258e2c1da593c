"""Constants of the posterior over changes from a calibrated baseline: each with what it is, its unit, where it was set.

Set on the validation worlds that `estimation.prediction_constants` names, and on thirteen strange faults on each, to
first order.
"""

import numpy as np

from drift_drake.gap.evidence.posterior import PosteriorConstants

PRIORS = PosteriorConstants(prior_none=0.7, prior_single=0.2, prior_pair=0.05, prior_unknown=0.08, temperature=1.3)
ELSE = 1.0  # prior odds that something else is there too, given a cause
SIZES = (0.5, 1.0, 3.0)  # [units] standard deviations of a partial effect that is there
WIDER = np.exp(np.linspace(np.log(2.0), np.log(300.0), 20))  # times the scatter, that an unknown gap may have
OF_PARTIAL = 0.8  # share of what is unknown that is a partial effect or a free direction, the rest being anything
OF_NOISE = 0.1  # share of what is unknown that changes the noise on readings, half of it that alone
SECOND = 8.0  # [nats] that a second cause must bring beyond its prior: the first one's shape is not exact either
HALF = 0.5  # share of a gap that a cause must explain to be named with something else
ALSO = 0.3
"""Share of a gap's probability from which hypotheses with an unknown cause are said together, whichever leads. On 60
days of three validation worlds whose effect is named it is 0.10 to 0.24, but for two at 0.33 and 0.34."""
WORTH_A_PAIR = 1.1  # squared distance from normal per score, below which nothing farther is tried: pairs, other starts
OPEN = 0.8  # of the probability of a gap that its leading cause must hold to be the cause
STANDS_FOR = {"command": 0.03, "actuator": 0.03, "sensor": 0.03, "motion": 0.1}
"""By stage: relative standard deviation with which a magnitude in the equations stands for that of a real car, whose
tyres are not the equations'."""
OF_SCATTER = 1.0  # by which magnitudes scatter, relative to what scores say
THRESHOLDS = {0.001: 0.05, 0.01: 0.25, 0.05: 0.5, 0.1: 0.6, 0.2: 0.7}
"""By false-alarm rate the probability of none below which there is a gap. Of 30 validation days without an effect one
is below 0.5, the next at 0.69; logs that tell nothing leave it at 0.72. Other rates' are no quantiles: too few days."""
RECORDINGS_WORTH = 10.0  # recordings left out that the rate of other cars is worth; set with DART among the validation
SURE_OF_NONE = 0.8  # probability of none from which there is no gap; below it is undecided
