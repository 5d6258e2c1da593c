"""What data say of a claim: a sentence of figures with 95 % intervals by vehicle, and a verdict by a rule.

A share: above `RELIABLE`. A difference or a ratio of pairs of the same attempts: above 0, or above 1. The claim
holds where the whole interval does, does not where no part of it does, and is not shown otherwise, nor from fewer than
`FEWEST` vehicles, of which no sign test could say more.
"""

from typing import Literal, NamedTuple

import numpy as np
import pandas as pd

from experiments.benchmarks.intervals import by_vehicle, share_by_vehicle
from experiments.drifting.report import share_difference

Verdict = Literal["holds", "does not hold", "not shown", "not run"]
FEWEST = 6  # vehicles
RELIABLE = 0.8  # share of attempts
MARGIN = 1.25  # an error up to so many times another's is as good for what it is asked for
PAIRED = ["vehicle", "noise_seed"]


class Cell(NamedTuple):
    """What came out, and whether the claim holds."""

    text: str
    verdict: Verdict


NOTHING = Cell("-", "not run")


def verdict(low: float, high: float, bar: float, vehicles: int) -> Verdict:
    """By an interval, of a figure that is to be above a bar."""
    if vehicles < FEWEST:
        return "not shown"
    return "holds" if low > bar else "does not hold" if high < bar else "not shown"


def turned(cell: Cell) -> Cell:
    """Of the claim's contrary."""
    contrary: dict[Verdict, Verdict] = {"holds": "does not hold", "does not hold": "holds"}
    return cell._replace(verdict=contrary.get(cell.verdict, cell.verdict))


def share(runs: pd.DataFrame, flag: str) -> Cell:
    """Runs with a flag."""
    if runs.empty:
        return NOTHING
    low, high = share_by_vehicle(runs, flag)
    text = f"{int(runs[flag].sum())} of {len(runs)} ({low:.0%} to {high:.0%})"
    return Cell(text, verdict(low, high, RELIABLE, runs["vehicle"].nunique()))


def more(first: pd.DataFrame, second: pd.DataFrame, flag: str) -> Cell:
    """Whether more of the first runs have a flag than of the second, which are of the same attempts."""
    if first.empty or second.empty:
        return NOTHING
    difference, low, high = share_difference(first, second, flag)
    counts = f"{int(first[flag].sum())} against {int(second[flag].sum())} of {len(first)}"
    text = f"{counts}: {difference:+.0%} ({low:+.0%} to {high:+.0%})"
    return Cell(text, verdict(low, high, 0.0, first["vehicle"].nunique()))


def ratio(
    above: pd.DataFrame, below: pd.DataFrame, column: str, bar: float = 1.0, unit: str = "", digits: int = 2
) -> Cell:
    """The median over attempts of a column's ratio; of two infinite values it is 1."""
    if above.empty or below.empty:
        return NOTHING
    both = above.merge(below, on=PAIRED, suffixes=("", "_below"))
    one, other = both[column].to_numpy(dtype=float), both[f"{column}_below"].to_numpy(dtype=float)
    with np.errstate(invalid="ignore"):
        both["ratio"] = np.where(np.isinf(one) & np.isinf(other), 1.0, one / other)
    low, high = by_vehicle(both, "ratio", lambda values: _middle(values))
    text = (
        f"{_said(_middle(one), digits)} against {_said(_middle(other), digits)}{unit}, ratio "
        f"{_said(_middle(both['ratio'].to_numpy()), 2)} ({_said(low, 2)} to {_said(high, 2)})"
    )
    return Cell(text, verdict(low, high, bar, both["vehicle"].nunique()))


def ranked(runs: pd.DataFrame, column: str) -> pd.DataFrame:
    """The runs with those that were not completed behind all others in a column."""
    if runs.empty:
        return runs
    return runs.assign(**{column: runs[column].where(runs["completed"], np.inf)})


def falls_short(one: pd.DataFrame, other: pd.DataFrame) -> Cell:
    """Whether the first runs do not suffice: fewer are completed, or RMS e is above `MARGIN` times the other's."""
    if one.empty or other.empty:
        return NOTHING
    completed = more(other, one, "completed")
    error = ratio(ranked(one, "rms_e"), ranked(other, "rms_e"), "rms_e", MARGIN, " m")
    found = {completed.verdict, error.verdict}
    if "holds" in found:
        answer: Verdict = "holds"
    else:
        answer = "does not hold" if error.verdict == "does not hold" else "not shown"
    counts = f"{int(one['completed'].sum())} against {int(other['completed'].sum())} of {len(one)}"
    return Cell(f"completed {counts}; RMS e {error.text}", answer)


def _middle(values: np.ndarray) -> float:
    return float(np.quantile(values, 0.5, method="linear" if np.isfinite(values).all() else "higher"))


def _said(value: float, digits: int) -> str:
    return f"{value:.{digits}f}" if np.isfinite(value) else "never"
