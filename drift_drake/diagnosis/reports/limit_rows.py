"""Detection limits as rows of a page: the least magnitude that would be named, as a share of the practical range."""

import dataclasses
from collections.abc import Mapping

from drift_drake.diagnosis.shared.ranges import RATE_LIMIT, REACH
from drift_drake.digits import significant
from drift_drake.vehicle.catalogue import CATALOGUE
from drift_drake.vehicle.parameters import VehicleParameters


@dataclasses.dataclass(frozen=True)
class LimitRow:
    """One bar of the detection limits."""

    name: str
    named: bool  # some magnitude within reach would be
    share: float  # of the end of the practical range; of the reach where none would be
    least: str
    taken_for: str


def limit_rows(limits: Mapping[str, Mapping[str, object]], vehicle: VehicleParameters) -> list[LimitRow]:
    """Detection limits (`Answer.details["detection"]`) as bars, the smallest first; what cannot be named comes last."""
    rows = []
    for name, limit in limits.items():
        info, least = CATALOGUE[name], limit["least"]
        taken_for, unit = str(limit["taken_for"]), info.suffix
        if not isinstance(least, float):
            rows.append(LimitRow(name, False, REACH, "", taken_for))
            continue
        low, high = info.range_for(vehicle)
        # A rate limit acts the more the lower it is.
        share = low / least if name == RATE_LIMIT else least / max(abs(low), abs(high))
        text = f"{'up to ' if name == RATE_LIMIT else '±' if info.signed else ''}{significant(least, 2)}{unit}"
        rows.append(LimitRow(name, True, share, text, taken_for))
    return sorted(rows, key=lambda row: (not row.named, row.share))
