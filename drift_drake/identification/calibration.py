"""What an identification says of a car: parameters with intervals, what is not identified, how well it predicts."""

import dataclasses
from typing import Any

from drift_drake.estimation.normal import Normal
from drift_drake.estimation.problem import Everyday
from drift_drake.identification.estimate import Trust
from drift_drake.identification.held_out import HeldOut
from drift_drake.identification.not_identified import Direction
from drift_drake.vehicle.effects import Effects
from drift_drake.vehicle.parameters import VehicleParameters


@dataclasses.dataclass(frozen=True)
class Parameter:
    """One unknown: its estimate with a 95 % interval, its standard deviations after and before the logs."""

    unit: str
    start: float
    estimate: float
    low: float
    high: float
    deviation: float
    prior: float
    widened: float  # by how much the interval is wider than that of white innovations
    kind: str  # free, known (held by its tolerance) or effect


@dataclasses.dataclass(frozen=True)
class Calibration:
    """What an identification says, as plain data. `correlation` is in the order of `parameters`."""

    case: str
    parameters: dict[str, Parameter]
    correlation: list[list[float]]
    not_identified: list[Direction]
    tied: list[tuple[str, str, float]]
    left_out: list[str]  # effects that cannot be told from zero, and that the vehicle file therefore lacks
    held_out: HeldOut
    trust: Trust  # for `drift-drake diagnose --noise-scale --process-scale` on this car's logs
    row_weight: float  # and for `--row-weight`: what one row is worth, in (0, 1]
    everyday: Everyday | None  # and what `--calibration` takes out before, where that makes rows worth more
    seconds: float
    warnings: list[str]
    criterion: str = "likelihood"  # or "prediction"
    normal: Normal | None = None  # of a car calibrated by prediction, for a diagnosis of another day
    watching: dict[str, Any] | None = None  # `monitoring.calibrated.NormalScores`, for `drift-drake watch`

    def sentence(self) -> str:
        """What was reached, in one sentence."""
        h = self.held_out
        if self.held_out.ratio > 1.0:
            return (
                f"{self.case}: no better than the first guess: {h.judged:g} s ahead on parts that were not fitted, "
                f"errors are {h.ratio:.2f} (95 %: {h.low:.2f} to {h.high:.2f}) of its."
            )
        identified = sum(1 for p in self.parameters.values() if p.kind != "known" and p.deviation < 0.5 * p.prior)
        free = sum(1 for p in self.parameters.values() if p.kind != "known")
        return (
            f"{self.case}: {identified} of {free} parameters identified; {h.judged:g} s ahead on parts that were not "
            f"fitted, errors are {h.ratio:.2f} (95 %: {h.low:.2f} to {h.high:.2f}) of the first guess's."
        )


@dataclasses.dataclass(frozen=True)
class Identification:
    """The calibrated car."""

    calibration: Calibration
    vehicle: VehicleParameters
    effects: Effects
    rows: int  # of the logs
