"""Detection limits as rows of a page: the least magnitude that would be named, as a share of the practical range."""

import dataclasses
from collections.abc import Mapping, Sequence

from drift_drake.diagnosis.answers.answer import Answer
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


def in_doubt(answer: Answer, limits: Sequence[LimitRow], nearest: Sequence[str] = ()) -> list[str]:
    """Effects that another drive should show: rivals that are still open, or those that these logs cannot name.

    Args:
        nearest: effects of the nearest hypothesis to an unknown gap.
    """
    if answer.verdict == "none":
        return [row.name for row in limits if not row.named or row.share > 1.0]
    rivals = [name for names in answer.ambiguity for name in names.split("+") if name in CATALOGUE]
    return list(dict.fromkeys([*rivals, *nearest])) if len(answer.ambiguity) > 1 or nearest else []
