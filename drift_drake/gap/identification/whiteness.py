"""Whether a car's innovations are white, so that the filter's likelihood is worth a try."""

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np

from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.log.table import Run
from drift_drake.car.parameters import VehicleParameters
from drift_drake.gap.estimation.problem import filter_case, make_problem

NEAR = 20.0  # mean square up to which a fit by likelihood may still make innovations white


@dataclasses.dataclass(frozen=True)
class Whiteness:
    """Of the innovations that count: the median over runs of their mean square, and their correlation row to row."""

    mean_square: float
    correlation: float  # the largest of all channels, in absolute value

    @property
    def may_be_white(self) -> bool:
        """Whether a fit by likelihood is worth a try."""
        return self.mean_square < NEAR

    def sentence(self) -> str:
        """Why prediction was the criterion."""
        if not np.isfinite(self.mean_square):
            return "calibrated by prediction: the filter of the nominal equations loses the car on these logs"
        return (
            f"calibrated by prediction: innovations are not white (mean square {self.mean_square:.3g}, correlation "
            f"from row to row {self.correlation:.2f})"
        )


def whiteness(
    runs: Sequence[Run], vehicle: VehicleParameters, effects: Effects, stated: Mapping[str, float] | None
) -> Whiteness:
    """Innovations of the car as it is: where they are white the likelihood is exact. A filter that diverges is not."""
    problem = make_problem(runs, vehicle, stated=stated, own=effects)
    gains = filter_case(problem, np.zeros(problem.nuisances), ())
    squares, tied = [], [0.0]
    for run, e in zip(problem.runs, gains.innovations, strict=True):
        kept = e[run.counted][:, run.used]
        if not np.isfinite(kept).all() or len(kept) < 3:
            return Whiteness(float("inf"), 1.0)
        squares.append(float(np.mean(np.median(kept**2, axis=0) / 0.4549)))
        spread = kept - kept.mean(axis=0)
        tied.append(float(np.max(np.abs(np.sum(spread[1:] * spread[:-1], axis=0) / np.sum(spread**2, axis=0)))))
    return Whiteness(float(np.median(squares)), float(np.median(tied[1:])) if len(tied) > 1 else 1.0)
