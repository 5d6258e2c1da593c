"""The beliefs of an answer file, checked: what the next drive is planned from."""

from collections.abc import Sequence

import numpy as np

from drift_drake.diagnosis.answers.answer import Answer, InvalidAnswerError, UnplannableError
from drift_drake.diagnosis.likelihood.beliefs import Belief, Sensing, beliefs_from_data
from drift_drake.errors import one_line
from drift_drake.estimation.filter_state import CHANNELS
from drift_drake.estimation.problem import NUISANCES
from drift_drake.vehicle.catalogue import CATALOGUE

LARGEST = 1e6  # of any number in beliefs, in parameters' own scales


def beliefs_of(answer: Answer) -> tuple[Sensing, list[Belief]]:
    """The sensors of an answer's logs, and two or more rival hypotheses, most probable first.

    Raises:
        UnplannableError: the answer holds no two hypotheses.
        InvalidAnswerError: what it holds is damaged.
    """
    data = answer.details.get("beliefs") or {}
    if not data:
        raise UnplannableError(
            f"{answer.case}: the answer holds no rival hypotheses (an older answer, or logs without torque commands); "
            "diagnose logs with the column tau_cmd anew"
        )
    try:
        sensing, beliefs = beliefs_from_data(data)
        _check(sensing, beliefs)
    except (KeyError, TypeError, ValueError, AttributeError, OverflowError) as error:
        raise InvalidAnswerError(
            f"{answer.case}: details.beliefs of the answer is damaged ({one_line(error)}); diagnose anew"
        ) from None
    if not beliefs:
        raise UnplannableError(
            f"{answer.case}: no catalogued hypothesis explains the gap, so that there are no rivals for a drive "
            "to distinguish; see 'nearest' in the answer, or look for a cause that the catalogue lacks"
        )
    if len(beliefs) < 2:
        raise UnplannableError(
            f"{answer.case}: {beliefs[0].name} has no rival left that a drive could distinguish it from; "
            "there is nothing to plan"
        )
    return sensing, beliefs


def _check(sensing: Sensing, beliefs: Sequence[Belief]) -> None:
    for name, array in (("noise", sensing.noise), ("used", sensing.used), ("process", sensing.process)):
        if array.shape != (len(CHANNELS),):
            raise ValueError(f"{name} has the shape {array.shape}, not {(len(CHANNELS),)}")
    noise, process = sensing.noise[sensing.used], sensing.process
    if not (np.isfinite(noise) & (noise > 0.0)).all() or not (np.isfinite(process) & (process >= 0.0)).all():
        raise ValueError("noise must be above 0, process 0 or more")
    weight = sensing.row_weight
    if isinstance(weight, bool) or not isinstance(weight, (int, float)) or not 0.0 < weight <= 1.0:
        raise ValueError("row_weight must be above 0, up to 1")
    if not np.isfinite(np.array(sensing.own, dtype=float)).all():
        raise ValueError("own holds no finite number")
    for belief in beliefs:
        unknown = [name for name in belief.names if name not in CATALOGUE]
        if unknown or list(belief.names) != sorted(set(belief.names)):
            raise ValueError(f"no hypothesis is called '{belief.name[:60]}'")
        size = len(NUISANCES) + len(belief.names)
        if belief.theta.shape != (size,) or belief.root.shape != (size, size):
            raise ValueError(f"theta and root of {belief.name} must be of {size} numbers")
        numbers = np.concatenate([belief.theta, belief.root.ravel()]).astype(float)
        if not (np.abs(numbers) < LARGEST).all() or not (np.diag(belief.root) > 0.0).all():
            raise ValueError(f"theta and root of {belief.name} must be finite, root's diagonal above 0")
        if isinstance(belief.probability, bool) or not 0.0 <= belief.probability <= 1.0:
            raise ValueError(f"the probability of {belief.name} is none")
