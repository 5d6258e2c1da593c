"""Units, signs and clocks that a log seems to have wrong, reported before any physics is blamed."""

import dataclasses
import itertools
import math
from collections.abc import Callable, Sequence

import numpy as np

from drift_drake.car.log.table import Run
from drift_drake.car.parameters import VehicleParameters
from drift_drake.gap.logs.screening.relations import KINDS, Relation, Windows, relations, windows_of
from drift_drake.gap.logs.screening.screened import Screened, screened
from drift_drake.gap.logs.screening.unit_mistakes import WHEEL, Mistake, mistakes

SUSPECT = 4.0  # tolerances from one at which no effect of the catalogue explains a relation
EXPLAINED = 3.0  # within which it is explained
WORST = 12.0  # tolerances beyond which a relation counts no more
LEAST_GAIN = 12.0  # in squared tolerances: what a mistake has to explain
ALIKE = 4.0  # in squared tolerances: mistakes that explain as much are reported as alternatives
EXTRA_COLUMN = 1.0  # in squared tolerances: what a mistake of one column more has to explain besides
MOST = 6  # mistakes of one case
MIRRORED = 0.75  # likeness from which a sign is believed
MIRRORED_FORWARD = 0.9  # and of a torque's or ax's alone, which nothing but the speed is a witness to
SIGNS = ("r", "psi", "y", "ay", "delta_cmd", "beta", "ax", "tau_cmd")
# Factor between two runs that no difference of drives makes, and the likeness from which a run's own ratio is believed.
APART = {
    "turn": (1.3, 0.9), "path": (1.3, 0.0), "across": (4.0, 0.9), "along": (2.5, 0.9), "rim": (1.25, 0.0),
    "steer": (3.0, 0.95), "drive": (2.5, 0.85),
}  # fmt: skip
Corrections = list[tuple[str, float]]


@dataclasses.dataclass(frozen=True)
class Suspicion:
    """What looks wrong, in a sentence with the remedy.

    column: its name, `t` for the clock, None for whole runs; factor: that it is too large by, -1 where it is mirrored,
    None where there is none; evidence: the ratios that say so; offset: to add to it [SI]; point: where the speed is
    measured, [m] ahead and to the left; columns, shift: that are on another clock, and the time to add to it [s].
    """

    sentence: str
    column: str | None
    factor: float | None
    evidence: str
    offset: float | None = None
    point: tuple[float, float] | None = None
    columns: tuple[str, ...] = ()
    shift: float | None = None


def suspicions(runs: Sequence[Run], vehicle: VehicleParameters) -> list[Suspicion]:
    """Mistakes of units, signs and clocks that explain these runs of one car much better than physics could.

    Columns are held against each other (`relations`); where relations are off by more than the catalogue's effects can
    do, the known mistake that explains most is reported, taken out, and the rest is looked at again. Nothing is
    reported where no known mistake explains it. A case that is mirrored as a whole looks like a car. Bad samples are
    left out first.
    """
    return suspicions_of(screened(runs)[0], vehicle)


def suspicions_of(clean: Sequence[Screened], vehicle: VehicleParameters) -> list[Suspicion]:
    """`suspicions` of runs that have been screened."""
    runs = [one.columns for one in clean]
    windows = windows_of(runs, [one.run.period for one in clean])
    found, windows = contradictions(windows, lambda windows: relations(windows, vehicle), mistakes(vehicle))
    return found + disagreements([one.run.name for one in clean], windows, vehicle)


def contradictions(
    windows: Windows, find: Callable[[Windows], list[Relation]], known: Sequence[Mistake]
) -> tuple[list[Suspicion], Windows]:
    """Mistakes that explain why relations do not hold, and the windows once they are taken out.

    Args:
        find: the relations of windows; known: mistakes that are thought of, the commonest first.
    """
    found: list[Suspicion] = []
    for _ in range(MOST):
        at = find(windows)
        reported, corrections = _scaled(at, known)
        if not reported:
            reported, corrections = _mirrored(at)
        if not reported:
            break
        found += reported
        for column, factor in corrections:
            windows = windows.corrected(column, factor)
    return found, windows


def _scaled(found: Sequence[Relation], known: Sequence[Mistake]) -> tuple[list[Suspicion], Corrections]:
    """The mistake of units or clock that explains most, reported for each of its columns, and how to take it out."""
    if all(relation.surely_off < SUSPECT for relation in found):
        return [], []
    before = _cost(found, {})
    ranked = []
    for mistake in known:
        touched = [relation for relation in found if _power(relation, mistake) != 0]
        # Every column of the mistake has to be seen, if only to agree with another one that has it too.
        if not touched or not all(any(column in at.kind.powers for at in found) for column in mistake.columns):
            continue
        size = _best_size(mistake, touched)
        changes = dict.fromkeys(mistake.columns, size)
        corrected = [relation for relation in touched if relation.surely_off > SUSPECT]
        if not any(abs(_left(relation, changes)) < EXPLAINED for relation in corrected):
            continue
        gain = before - _cost(found, changes) - EXTRA_COLUMN * (len(mistake.columns) - 1) - mistake.rarity
        if gain > LEAST_GAIN:
            ranked.append((gain, mistake, changes))
    if not ranked:
        return [], []
    ranked.sort(key=lambda entry: -entry[0])
    best_gain, best, changes = ranked[0]
    rivals = [mistake for gain, mistake, _ in ranked[1:] if gain > best_gain - ALIKE]
    reported = [_suspicion(column, best, changes[column], found, rivals) for column in best.columns]
    return reported, list(changes.items())


def _power(relation: Relation, mistake: Mistake) -> int:
    """Power with which the mistake's factor enters the relation; its columns may cancel."""
    return sum(relation.kind.powers.get(column, 0) for column in mistake.columns)


def _best_size(mistake: Mistake, touched: Sequence[Relation]) -> float:
    """The factor; of a range, the one that the relation held most tightly asks for."""
    if mistake.low == mistake.high or not touched:
        return mistake.low
    tight = min(touched, key=lambda relation: relation.kind.tolerance)
    asked = tight.size ** (1.0 / _power(tight, mistake))
    return float(min(max(asked, mistake.low), mistake.high))


def _left(relation: Relation, changes: dict[str, float]) -> float:
    """How far off the relation is, in tolerances, once the factors are taken out."""
    out = sum(power * math.log(changes[column]) for column, power in relation.kind.powers.items() if column in changes)
    return relation.off - out / relation.kind.tolerance


def _cost(found: Sequence[Relation], changes: dict[str, float]) -> float:
    return sum(min(abs(_left(relation, changes)), WORST) ** 2 for relation in found)


def _suspicion(
    column: str, mistake: Mistake, size: float, found: Sequence[Relation], rivals: Sequence[Mistake]
) -> Suspicion:
    off = [relation for relation in found if abs(relation.off) > SUSPECT]
    witnesses = [relation for relation in off if column in relation.kind.powers] or [  # else of what it goes along with
        relation for relation in off if _power(relation, mistake)
    ]
    evidence = "; ".join(f"{relation.kind.says} is {relation.size:.3g}" for relation in witnesses)
    seen = [relation for relation in witnesses if len(mistake.columns) == 1 or _power(relation, mistake)]
    measured = min(seen or witnesses or found, key=lambda relation: relation.kind.tolerance)
    power = _power(measured, mistake) or measured.kind.powers.get(column, 1)
    says = "an engine behind gear_ratio gives" if column == "tau_cmd" else "other columns say"
    times = f"{measured.size ** (1.0 / power):.3g} times what {says}"
    times += ", an upper estimate: the car's understeer is in it" if mistake.looks_like == WHEEL else ""
    what = "the clock t" if column == "t" else f"column {column}"
    others = [f"{' and '.join(rival.columns)} as {rival.looks_like}" for rival in rivals if rival != mistake]
    either = f"; or {', or '.join(others)}" if others else ""
    return Suspicion(
        f"{what} looks like {mistake.looks_like} ({times}): {mistake.remedy}{either}", column, size, evidence
    )


def _mirrored(found: Sequence[Relation]) -> tuple[list[Suspicion], Corrections]:
    """The fewest columns whose mirroring makes all signs agree."""
    least = {1: MIRRORED_FORWARD, 2: MIRRORED}  # by the number of columns that a relation holds against each other
    signed = [at for at in found if at.kind.mirrors and at.likeness >= least[len(at.kind.mirrors)]]
    wrong = [relation for relation in signed if relation.sign < 0.0]
    if not wrong:
        return [], []
    columns = [name for name in SIGNS if any(name in relation.kind.mirrors for relation in signed)]

    def agree(flipped: Sequence[str]) -> bool:
        return all(
            relation.sign * (-1.0) ** sum(name in flipped for name in relation.kind.mirrors) > 0.0
            for relation in signed
        )

    for count in range(1, len(columns) + 1):
        choices = [choice for choice in itertools.combinations(columns, count) if agree(choice)]
        if choices:
            break
    else:
        return [], []
    first, *others = choices
    either = f"; or {', or '.join(' and '.join(choice) for choice in others)} instead" if others else ""
    reported = []
    for column in first:
        evidence = "; ".join(
            f"{relation.kind.says} is negative" for relation in wrong if column in relation.kind.mirrors
        )
        axis = " (or x)" if column == "y" else ""
        sentence = (
            f"column {column}{axis} looks mirrored, against the other columns{either}: the log is ISO 8855 (x forward, "
            "y left, z up), give its frame or sign in the mapping"
        )
        reported.append(Suspicion(sentence, column, -1.0, evidence))
    return reported, [(column, -1.0) for column in first]


def disagreements(names: Sequence[str], windows: Windows, vehicle: VehicleParameters) -> list[Suspicion]:
    """Sentences on runs that disagree with the others, each with its evidence. names: of the runs."""
    by_run = [relations(windows.where(windows.run == index), vehicle) for index in range(len(names))]
    reported: dict[int, list[str]] = {}
    for name, (factor, likeness) in APART.items():
        sizes = {i: _size(found, name, likeness) for i, found in enumerate(by_run)}
        known = {i: size for i, size in sizes.items() if size is not None}
        if len(known) < 2 or max(known.values()) < factor * min(known.values()):
            continue
        odd, usual = _odd_one(known)
        reported.setdefault(odd, []).append(
            f"{KINDS[name].says} is {known[odd]:.3g} there and {usual:.3g} in the others"
        )
    out = []
    for index, texts in sorted(reported.items()):
        evidence = "; ".join(texts)
        sentence = (
            f"{names[index]} disagrees with the other runs ({evidence}): is it the same car, logged in the same units? "
            "Give the runs of one car"
        )
        out.append(Suspicion(sentence, None, None, evidence))
    return out


def _size(found: Sequence[Relation], name: str, likeness: float) -> float | None:
    at = next((relation for relation in found if relation.name == name), None)
    return at.size if at is not None and at.sign > 0.0 and at.likeness >= likeness else None


def _odd_one(known: dict[int, float]) -> tuple[int, float]:
    """The run farthest from the median of the others, of two the one farther from one, and that median."""
    usual = {i: float(np.median([size for j, size in known.items() if j != i])) for i in known}
    odd = max(known, key=lambda i: abs(np.log(known[i] / (usual[i] if len(known) > 2 else 1.0))))
    return odd, usual[odd]
