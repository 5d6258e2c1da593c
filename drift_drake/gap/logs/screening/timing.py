"""Whether the yaw rate follows the steering as late as a car's does: commands and sensors on one clock."""

from collections.abc import Sequence

import numpy as np

from drift_drake.gap.logs.clock_offset import estimate_offset
from drift_drake.gap.logs.screening.kinematics import Columns
from drift_drake.gap.logs.screening.relations import GRIP
from drift_drake.gap.logs.screening.suspicions import Suspicion

FEWEST = 230  # rows
MOST = 6  # runs, the longest
WINDOW, TREND = 0.3, 3.0  # [s] over which noise is averaged out, and what changes too slowly to tell a time is
LEAD, LAG = 0.25, 0.05  # [s] from command to yaw, and of yaw before its command: more is no car's response
SEARCH = 1.5  # [s]
THINNED = 5  # rows that change too little from one to the next to tell more than one of them does
LIKENESS, ALIKE = 0.8, 0.7  # correlation of steering and yaw rate from which clocks are asked, and a lead is believed


def timing_doubts(runs: Sequence[Columns], periods: Sequence[float]) -> list[Suspicion]:
    """Commands that come earlier or later than a car's yaw rate follows them."""
    longest = sorted(range(len(runs)), key=lambda i: -len(np.asarray(runs[i]["r"])))[:MOST]
    found = [at for i in longest if (at := _lead(runs[i], periods[i])) is not None]
    if not found:
        return []
    leads, stds = (np.array(values) for values in zip(*found, strict=True))
    weights = 1.0 / np.maximum(stds, 1e-4) ** 2
    lead = float(np.sum(weights * leads) / np.sum(weights))
    # Runs that disagree say less than each claims.
    spread = float(np.sqrt(np.sum(weights * (leads - lead) ** 2) / max(len(leads) - 1, 1)))
    std = max(spread, 1.0) / float(np.sqrt(np.sum(weights)))
    if lead - 3.0 * std > LEAD:
        sentence = f"commands lead the motion by {lead:.2g} s (+- {std:.1g} s): clocks not aligned?"
    elif lead + 3.0 * std < -LAG:
        sentence = f"the motion leads its commands by {-lead:.2g} s (+- {std:.1g} s): clocks not aligned?"
    else:
        return []
    fix = " Give the commands a clock of their own in the mapping, with its offset or 'align'"
    return [Suspicion(sentence + fix, None, None, sentence)]


def _lead(columns: Columns, period: float) -> tuple[float, float] | None:
    """Seconds that the steering leads the yaw rate by, and their standard deviation; None where a run does not say."""
    if columns.get("delta_cmd") is None or len(np.asarray(columns["r"])) < FEWEST:
        return None
    r, v, delta = (np.asarray(columns[name], dtype=float) for name in ("r", "v", "delta_cmd"))
    beta = columns.get("beta")
    grip = np.ones(len(r), dtype=np.bool_) if beta is None else np.abs(np.asarray(beta)) < GRIP
    from scipy.ndimage import uniform_filter1d  # slow to import

    turned, steered = (uniform_filter1d(z, max(round(WINDOW / period), 1)) for z in (r, delta * v))
    if np.count_nonzero(grip) < FEWEST or min(np.ptp(turned[grip]), np.ptp(steered[grip])) < 1e-9:
        return None
    if float(np.corrcoef(turned[grip], steered[grip])[0, 1]) < LIKENESS:
        return None
    t = np.asarray(np.arange(len(turned)) * period, dtype=float)
    # Slow changes tell little of a time, and an understeering car's follow the steering's with another shape.
    turned, steered = (z - uniform_filter1d(z, round(TREND / period)) for z in (turned, steered))
    try:
        found = estimate_offset(t[grip][::THINNED], turned[grip][::THINNED], t, steered, 0.0, SEARCH)
    except ValueError:
        return None
    return None if found.correlation < ALIKE else (-found.offset, max(found.std, 1e-4))
