"""Single effects that a day's logs do not show, and do not exclude either.

Their most likely magnitude cannot be told from zero, so that none of them is named; but each may be there, and what it
is believed to be is part of the probabilities, of `none` and of the ambiguity set.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np

from drift_drake.diagnosis.another_day.hypotheses import Curve, Hypothesis, Search, unusual
from drift_drake.diagnosis.another_day.posterior import tells_from_zero


def not_excluded(search: Search, singles: Sequence[Hypothesis]) -> list[Hypothesis]:
    """Those of the search's single effects, with their evidence over all magnitudes."""
    curves = {(curve.name, curve.follows): curve for curve in search.curves}
    return [
        dataclasses.replace(h, log_evidence=evidence_over(curves[h.names[0], h.follows_load], search))
        for h in singles
        if not tells_from_zero(h)
    ]


def evidence_over(curve: Curve, search: Search) -> float:
    """Log evidence of one effect, integrated over the magnitudes that would be a gap.

    The likelihood is not a bell within bounds here, as Laplace's approximation takes it to be.
    """
    r = search.ranges[curve.name]
    q, s = curve.fine()
    log_density = np.where(r.allows(q), -search.nats(s) - unusual(q, r) - np.log(r.width), -np.inf)
    top = float(np.max(log_density))
    return top + float(np.log(np.trapezoid(np.exp(log_density - top), q)))
