"""Detection limits as the bars of a page."""

import dataclasses
from collections.abc import Mapping

from drift_drake.car.effects.catalogue import CATALOGUE, LIMITS
from drift_drake.car.parameters import VehicleParameters
from drift_drake.common.errors import significant
from drift_drake.gap.estimation.prior import REACH


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
        # A rate limit acts more the smaller it is.
        share = low / least if name in LIMITS else least / max(abs(low), abs(high))
        text = f"{'up to ' if name in LIMITS else '±' if info.signed else ''}{significant(least, 2)}{unit}"
        rows.append(LimitRow(name, True, share, text, taken_for))
    return sorted(rows, key=lambda row: (not row.named, row.share))


def outlook_rows(outlook: Mapping[str, list[float | None]], vehicle: VehicleParameters) -> list[LimitRow]:
    """What a later log like these recordings would show (`identification.outlook`), as bars."""
    known = {name: {"least": column[0], "taken_for": ""} for name, column in outlook.items() if name in CATALOGUE}
    return limit_rows(known, vehicle)
