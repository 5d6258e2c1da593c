"""What halving and doubling each constant of the inference does to diagnoses of a change, to first order.

    python -m experiments.other_worlds.constants WORLD ... --baseline day_one --out runs/constants

Each world is calibrated once by prediction, and scores and information of its days' stretches are kept in the run
folder: start again to go on. Then, with each constant halved and doubled, what a baseline shows is learnt anew and
every day is judged by single effects alone (`left_out.ranked_to_first_order`): constants.md says how many are right.
"""

import contextlib
import dataclasses
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np
from tqdm import tqdm

from diagrams.command import run_command
from drift_drake.common.run_folder import write_json
from drift_drake.common.safe_files import write_text
from drift_drake.gap.estimation import baseline, prediction_constants, recordings_left_out
from drift_drake.gap.estimation.baseline import Spread, Stretches
from drift_drake.gap.estimation.recordings_left_out import OfBaseline
from drift_drake.gap.evidence import alarms, ranking
from drift_drake.gap.evidence import constants as of_diagnosis
from drift_drake.gap.evidence import left_out as judging
from drift_drake.gap.evidence import left_over as leaving
from drift_drake.gap.evidence.posterior import NONE, UNKNOWN, PosteriorConstants
from experiments.made import begun, made, tabulated
from experiments.other_worlds.road import Worlds, worlds_by_name
from experiments.other_worlds.scoring import TOO, said_share, share
from experiments.other_worlds.stretches import FACTORS, Calibrated, KeptDay, kept_world

USED_IN: tuple[ModuleType, ...] = (baseline, recordings_left_out, judging, leaving, ranking, alarms)
"""Modules that read the constants, as names of their own."""
MODULES: tuple[ModuleType, ...] = (prediction_constants, of_diagnosis)
PRIORS = ("prior_none", "prior_single", "prior_unknown", "temperature")  # of `PRIORS` that single effects have
AS_ODDS = ("OF_PARTIAL", "HALF", "ALSO", "OPEN", "SURE_OF_NONE", "THRESHOLDS")
"""Shares and probabilities: their odds are halved and doubled."""
NOT_SEEN = {
    "CALIBRATED": "intervals of parameters", "MODEL_FORM": "intervals of parameters", "SECOND": "pairs",
    "WORTH_A_PAIR": "pairs", "STANDS_FOR": "intervals of magnitudes", "OF_SCATTER": "intervals of magnitudes",
    "PRIORS.prior_pair": "pairs", "RECORDINGS_WORTH": "the rate of false alarms of one car",
}  # fmt: skip
"""Constants that decide nothing to first order, and what they decide instead."""
LEAST_P = 1e-4  # probability of the truth below which a day costs no more
UNCHANGED = "as they are"
World = tuple[Calibrated, Sequence[KeptDay]]


@dataclasses.dataclass(frozen=True)
class Table(Worlds):
    """What halving and doubling does."""


class Counts(NamedTuple):
    """How days fare."""

    right: dict[str, Any]  # share, of days without a strange fault
    alarms: dict[str, Any]  # share, of days without an effect
    strange: dict[str, Any]  # share of strange faults that are unknown, or a cause and something else
    log_score: float  # mean logarithm of the truth's probability, of all days
    open: int  # days whose cause is open
    undecided: int


def names_of_constants() -> list[str]:
    """Every constant that decides something to first order; those of the priors as `PRIORS.field`."""
    own = [name for module in MODULES for name, value in vars(module).items() if name.isupper() and value is not None]
    return [n for name in own for n in ([f"PRIORS.{f}" for f in PRIORS] if name == "PRIORS" else [name])
            if n not in NOT_SEEN]  # fmt: skip


def value_of(name: str) -> Any:
    """A constant's value."""
    first, _, field = name.partition(".")
    value = next(getattr(module, first) for module in MODULES if hasattr(module, first))
    return getattr(value, field) if field else value


def times(value: Any, factor: float, odds: bool) -> Any:
    """A constant, each of its numbers times a factor, or with that many times its odds."""
    if isinstance(value, dict):
        return {key: times(part, factor, odds) for key, part in value.items()}
    if isinstance(value, tuple):
        return tuple(times(part, factor, odds) for part in value)
    return value * factor / (1.0 - value + value * factor) if odds else value * factor


@contextlib.contextmanager
def changed(name: str, factor: float) -> Iterator[None]:
    """Within, a constant is another one in all modules that read it."""
    first, _, field = name.partition(".")
    value = times(value_of(name), factor, name in AS_ODDS)
    if field:
        priors: PosteriorConstants = of_diagnosis.PRIORS
        value = dataclasses.replace(priors, **{field: value})
    if first == "WIDER":
        value = np.maximum(value, 1.0)  # normal scores are no wider than normal ones
    there = [module for module in USED_IN if hasattr(module, first)]
    before = [getattr(module, first) for module in there]
    for module in there:
        setattr(module, first, value)
    try:
        yield
    finally:
        for module, old in zip(there, before, strict=True):
            setattr(module, first, old)


def learnt(car: Calibrated, regular: float) -> tuple[Spread, OfBaseline]:
    """How scores of the calibrated car scatter, and what its baseline shows, with the constants as they are now.

    Args:
        regular: times `REGULAR`, that the scores are projected with.
    """
    seen = car.baseline[regular]
    spread = baseline.spread_of(seen, car.normal.names, car.least_deviations)
    before = baseline.with_partial(baseline.left_of(car.prior, car.fitted), len(seen.information))
    return spread, recordings_left_out.learnt_from(seen.stretches, spread, before)


def judged(car: Calibrated, stretches: Stretches, found: tuple[Spread, OfBaseline]) -> ranking.DayRanked:
    """What single effects say of a day, to first order."""
    spread, shown = found
    models = [spread.times(factor) for factor in prediction_constants.FACTORS]
    scatter = baseline.predicted(stretches, shown.known, models, shown.scale, int(np.argmax(shown.factors)))
    scores = stretches.scores.sum(axis=0) - scatter.mean
    return judging.ranked_to_first_order(scores, scatter, car.normal, shown.factors, car.vehicle)


def counted(worlds: Sequence[World], regular: float = 1.0) -> Counts:
    """All days of all worlds, with the constants as they are now."""
    days: list[tuple[KeptDay, ranking.DayRanked]] = []
    for car, of_car in worlds:
        found = learnt(car, regular)
        days += [(day, judged(car, day.stretches[regular], found)) for day in of_car]
    usual = [(day, r) for day, r in days if not day.strange]
    return Counts(
        share(said(r) == day.truth for day, r in usual),
        share(r.verdict != NONE for day, r in usual if day.truth == NONE),
        share(r.verdict == UNKNOWN or r.something_else > 0.0 for day, r in days if day.strange),
        float(np.mean([np.log(max(truth_has(day, r), LEAST_P)) for day, r in days])),
        sum(r.decision == "cause_open" for _, r in days),
        sum(r.decision == "undecided" for _, r in days),
    )


def said(r: ranking.DayRanked) -> str:
    """The hypothesis that is named."""
    return "+".join(sorted(r.causes)) if r.verdict == "effect" else r.verdict


def truth_has(day: KeptDay, r: ranking.DayRanked) -> float:
    """Probability of the truth: of an effect with something else or without, of a strange fault of anything else."""
    p = r.probabilities
    if not day.strange:
        return p.get(day.truth, 0.0) + (p.get(day.truth + TOO, 0.0) if day.truth != NONE else 0.0)
    both = r.something_else * p.get(said(r), 0.0)  # the leading cause has the probability of both
    return both + sum(q for name, q in p.items() if name == UNKNOWN or name.endswith(TOO))


def counts_by_constant(
    worlds: Sequence[World], tell: Callable[[Sequence[str]], Iterable[str]] = list
) -> dict[str, dict[float, Counts]]:
    """Counts by constant and factor; unchanged ones first.

    Args:
        tell: passes the names on, for a progress bar.
    """
    out = {UNCHANGED: {1.0: counted(worlds)}}
    for name in tell(names_of_constants()):
        out[name] = {}
        for factor in FACTORS:
            if name == "REGULAR":
                out[name][factor] = counted(worlds, factor)
            else:
                with changed(name, factor):
                    out[name][factor] = counted(worlds)
    return out


def constants_text(found: Mapping[str, Mapping[float, Counts]]) -> str:
    """The table as Markdown, and what it does not show."""
    heads = ("constant", "value", "times", "days right", "false alarms", "strange faults", "log score", "cause open",
             "undecided")  # fmt: skip
    rows = []
    for name, by_factor in found.items():
        for factor, c in by_factor.items():
            value = "" if name == UNCHANGED else shown(value_of(name))
            times_ = "" if name == UNCHANGED else f"{factor:g}{' (odds)' if name in AS_ODDS else ''}"
            rows.append((name, value, times_, *(said_share(s) for s in (c.right, c.alarms, c.strange)),
                         f"{c.log_score:.3f}", c.open, c.undecided))  # fmt: skip
    lines = [*tabulated(heads, rows), "", "Not shown, since they decide nothing of single effects to first order:"]
    lines += [f"- {name}: {what}" for name, what in NOT_SEEN.items()]
    return "\n".join(lines) + "\n"


def shown(value: Any) -> str:
    """A constant in a table."""
    if isinstance(value, dict):
        return ", ".join(f"{key} {shown(part)}" for key, part in value.items())
    numbers = np.atleast_1d(value)
    ends = numbers if len(numbers) < 5 else numbers[[0, -1]]
    return (", " if len(numbers) < 5 else " to ").join(f"{q:.3g}" for q in ends)


def main(config: Table) -> None:
    """Everything."""
    worlds = worlds_by_name(config.worlds, config.baseline)
    folder = begun("constants", config)
    kept = [kept_world(world, config.baseline, folder / name) for name, world in worlds.items()]
    found = counts_by_constant(kept, lambda names: tqdm(names, unit="constant"))
    text = f"{constants_text(found)}\n{made(config)}\n"
    write_json(folder / "constants.json", {name: {f"{factor:g}": c._asdict() for factor, c in by_factor.items()}
                                           for name, by_factor in found.items()})  # fmt: skip
    write_text(folder / "constants.md", text)
    print(text)


if __name__ == "__main__":
    run_command(main, Table, __doc__)
