"""What logs cannot identify, in few sentences: single quantities, combinations, and what recordings disagree about."""

from collections.abc import Mapping, Sequence

from drift_drake.gap.identification.calibration import Direction

SHOWN = 3  # combinations that are spelt out; of more the worst, and their number


def grouped(found: Sequence[Direction], disagreed: Mapping[str, str]) -> list[str]:
    """At most one sentence of single quantities, one of combinations, and one for each recording that disagrees.

    Args:
        found: what logs do not identify, the worst first; disagreed: by quantity the recording that differs the most.
    """
    single = [direction for direction in found if len(direction.parts) == 1]
    combined = [direction for direction in found if len(direction.parts) > 1]
    sentences = [single[0].sentence()] if len(single) == 1 else []
    if len(single) > 1:
        sentences.append(f"{', '.join(next(iter(d.parts)) for d in single)} ({_left(single, 'each prior')} is left)")
    if len(combined) > SHOWN:
        worst = "; ".join(direction.sides() for direction in combined[:SHOWN])
        sentences.append(f"{len(combined)} combinations ({_left(combined, 'the priors')} is left), the worst: {worst}")
    else:
        sentences += [direction.sentence() for direction in combined]
    for recording in dict.fromkeys(disagreed.values()):
        names = ", ".join(name for name, who in disagreed.items() if who == recording)
        sentences.append(f"{names} (the recordings ask for different values, {recording} the most)")
    return sentences


def _left(found: Sequence[Direction], whose: str) -> str:
    """The shares of the width that are left, as a range."""
    least, most = (round(100.0 * share(direction.left for direction in found)) for share in (min, max))
    possessive = f"{whose}'" if whose.endswith("s") else f"{whose}'s"
    return f"{least} to {most} % of {possessive} width" if least < most else f"{most} % of {possessive} width"
