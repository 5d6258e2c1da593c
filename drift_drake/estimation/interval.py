"""An estimate with its interval."""

import dataclasses

TWO_SIDED = 1.96  # standard deviations


@dataclasses.dataclass(frozen=True)
class Interval:
    """An estimate with its 95 % interval."""

    estimate: float
    low: float
    high: float
