"""Whether a log's columns agree with each other: the one cause that explains the rest first, what it explains left out.

Dead columns, misnamed ones, units, signs and clocks, scales, biases and points of measurement are asked in that order;
each doubt is taken out of the columns before the next question. What no other column can check is named too.
"""

import dataclasses
import math
from collections.abc import Mapping, Sequence

import numpy as np

from drift_drake.car.effects.record import wheelbase
from drift_drake.car.log.table import COLUMNS, Run
from drift_drake.car.parameters import VehicleParameters
from drift_drake.gap.logs.screening.averaging import Columns
from drift_drake.gap.logs.screening.dead import dead_columns, set_speed
from drift_drake.gap.logs.screening.kinematics import Kinematics, motion_of_columns
from drift_drake.gap.logs.screening.misnamed import (
    magnitudes,
    no_speed,
    swapped_accelerations,
    swapped_headings,
    swapped_speeds,
    undecided_speeds,
)
from drift_drake.gap.logs.screening.redundancy import agreements, arm_doubts, bias_doubts, scale_doubts, undecided_arm
from drift_drake.gap.logs.screening.relations import KINDS, Kind, Relation, Windows, relations, windows_of
from drift_drake.gap.logs.screening.steering import held_doubts, ratio_doubts, reach_doubts, wheel_ratio
from drift_drake.gap.logs.screening.suspicions import Suspicion, contradictions
from drift_drake.gap.logs.screening.timing import late_columns, on_one_clock
from drift_drake.gap.logs.screening.unit_mistakes import Mistake, mistakes

ASKED = ("r", "psi", "v", "beta", "omega_r", "ax", "ay", "delta_cmd")  # columns that others could check
SCALED = ("r", "v")  # whose scale other columns tell to a few per cent, if a log is long enough
TIMED = {"t", "r", "v", "delta_cmd"}  # columns that tell when the car follows its commands
FACTOR = 2.0  # that a scale is off by where relations of short logs leave it open
SWAPPED = {"ax": ("ax", "ay"), "r": ("r", "psi")}  # by the column that a doubt names


@dataclasses.dataclass(frozen=True)
class Consistency:
    """Doubts, the one that explains most first; unchecked: columns that no other column can check; undecided: what else
    the columns cannot tell, as clauses (whether ..., where ...).

    right: the columns [rows] by run once the doubts' factors are taken out (a steering ratio with its understeer);
    windows: of these; steer: `delta_cmd` over what the wheelbase, or one of 1 m, asks for, 1 where it is not known.
    """

    doubts: list[Suspicion]
    unchecked: tuple[str, ...]
    right: list[dict[str, np.ndarray]]
    windows: Windows
    steer: float = 1.0
    complete: bool = True  # whether there is a speed, without which nothing else was asked
    undecided: tuple[str, ...] = ()


def consistency_of(runs: Sequence[Run], vehicle: VehicleParameters | None = None) -> Consistency:
    """`consistency` of runs."""
    columns = [{name: values for name in COLUMNS if (values := run.column(name)) is not None} for run in runs]
    return consistency(columns, [run.period for run in runs], vehicle)


def consistency(
    runs: Sequence[Columns], periods: Sequence[float], vehicle: VehicleParameters | None = None,
    length: float | None = None, stated: Mapping[str, str] | None = None, derived: Sequence[str] = (),
) -> Consistency:  # fmt: skip
    """Holds the columns of one car's runs against each other.

    Args:
        runs: columns of the log format [rows] by run; periods: time between rows [s]; vehicle: what the vehicle file
            says; length: the wheelbase [m] where there is no such file; stated: units of a mapping, by column; derived:
            columns that were made of each other, and check nothing.
    """
    length = wheelbase(vehicle) if vehicle is not None else length
    right = [{name: np.asarray(values, dtype=float) for name, values in columns.items() if values is not None}
             for columns in runs]  # fmt: skip
    doubts = _misnamed(right, periods)
    bad = {doubt.column for doubt in doubts}
    for doubt in doubts:
        swapped = SWAPPED.get(str(doubt.column), ()) if "swapped" in doubt.sentence else ()
        out = {doubt.column, *swapped} - {"r", "v", "delta_cmd"}
        for columns in right:
            for name in out & set(columns):
                columns.pop(str(name))
    if bad & {"v"}:
        return Consistency(doubts, (), right, windows_of(right, periods), complete=False)
    late = [] if bad & {"r"} else late_columns(right, periods)
    right = [on_one_clock(columns, period, late) for columns, period in zip(right, periods, strict=True)]
    commands, moved = ([doubt for doubt in late if (doubt.shift is None) is so] for so in (True, False))
    doubts += moved
    kinds, car = _kinds(vehicle, length)
    if bad & {"r", "delta_cmd"}:
        kinds = {name: kind for name, kind in kinds.items() if not set(kind.powers) & bad}
    held: list[Relation] = []

    def found_in(w: Windows) -> list[Relation]:
        held[:] = relations(w, car, kinds)
        return held

    wrong, windows = contradictions(windows_of(right, periods), found_in, mistakes(vehicle, stated))
    for doubt in wrong:
        _take_out(right, doubt)
    periods = [_period(period, wrong) for period in periods]
    m = motion_of_columns(right, periods)
    doubts += [wheel_ratio(doubt, m, length) for doubt in wrong]
    without = [column for column in {*bad, *(doubt.column for doubt in (*wrong, *moved))} if column is not None]
    units = [
        one for one in mistakes(vehicle, stated) if stated and set(one.columns) <= set(stated) and one.low == one.high
    ]
    doubts += _fine(right, periods, m, vehicle, length, without, commands, units)
    constant = set_speed(right, m)
    doubts += [Suspicion(constant, "v", None, constant)] if constant else []
    steer = next((at.size for at in held if at.name == "steer"), 1.0)
    undecided = () if not len(m.r) or {"v", "r"} & set(without) else undecided_arm(m, length)
    if len(m.r) and not {"v", "omega_r"} & set(without):
        undecided = [*undecided_speeds(m), *undecided]
    unchecked, coarse = _unchecked(m, held, derived, without, right)
    if coarse:
        undecided = [*undecided, f"whether the scale of {' and '.join(coarse)} is right within a factor of {FACTOR:g}"]
    return Consistency(doubts, unchecked, right, windows, steer, undecided=tuple(undecided))


def _misnamed(runs: Sequence[dict[str, np.ndarray]], periods: Sequence[float]) -> list[Suspicion]:
    """Columns that are no measurement of what they are called."""
    dead = dead_columns(runs, periods)
    doubts = [Suspicion(sentence, name, None, sentence) for name, sentence in dead.items()]
    if "v" not in dead:
        doubts += no_speed(motion_of_columns(runs, periods, 0.0))
    if any(doubt.column == "v" for doubt in doubts):
        return doubts
    m = motion_of_columns(runs, periods)
    doubts += swapped_headings(m) + magnitudes(runs, m) + swapped_accelerations(m) + swapped_speeds(m)
    return list({doubt.column: doubt for doubt in reversed(doubts)}.values())[::-1]


def _kinds(vehicle: VehicleParameters | None, length: float | None) -> tuple[dict[str, Kind], VehicleParameters]:
    """The relations that can be asked, and the car that they are asked of."""
    kinds = dict(KINDS)
    if vehicle is not None:
        return kinds, vehicle
    kinds.pop("drive")
    if length is None:  # of steering then only the sign is judged
        kinds["steer"] = dataclasses.replace(KINDS["steer"], tolerance=math.inf)
    half = 0.5 * (length or 1.0)
    return kinds, dataclasses.replace(VehicleParameters(), front_axle_distance=half, rear_axle_distance=half)


def _take_out(runs: Sequence[dict[str, np.ndarray]], doubt: Suspicion) -> None:
    if doubt.column is None or doubt.factor is None:
        return
    for columns in runs:
        if doubt.column in columns:
            columns[doubt.column] = columns[doubt.column] / doubt.factor


def _period(period: float, doubts: Sequence[Suspicion]) -> float:
    return period / math.prod(doubt.factor for doubt in doubts if doubt.column == "t" and doubt.factor is not None)


def _fine(
    runs: Sequence[Columns], periods: Sequence[float], m: Kinematics, vehicle: VehicleParameters | None,
    length: float | None, without: Sequence[str], late: Sequence[Suspicion], units: Sequence[Mistake],
) -> list[Suspicion]:  # fmt: skip
    """What is asked once units and signs are right: scales, biases, points of measurement, commands.

    late: of commands on another clock, which a mistake of a column in `TIMED` could explain; units: mistakes of the
    units that a mapping states.
    """
    if not len(m.r):
        return []
    scales = scale_doubts(m, without, units)
    bad = [*without, *(doubt.column for doubt in scales if doubt.column is not None)]
    doubts = scales + bias_doubts(m, bad)
    if not {"v", "r", "omega_r"} & set(bad):
        doubts += arm_doubts(m, length)
    if not {"v", "r", "delta_cmd"} & set(bad) and length is not None:
        doubts += ratio_doubts(m, length)
    if "delta_cmd" not in without:
        doubts += reach_doubts(runs, vehicle)
    if not TIMED & {*bad, *(doubt.column for doubt in doubts)}:
        doubts += late
    return doubts + held_doubts(runs, periods)


def _unchecked(
    m: Kinematics, held: Sequence[Relation], derived: Sequence[str], without: Sequence[str], runs: Sequence[Columns]
) -> tuple[tuple[str, ...], list[str]]:
    """Columns that are in no relation that these logs could tell, but those in doubt; and those of `SCALED` that are
    only in one that tells their scale roughly."""
    exact = [set(at.powers) for at in agreements(m)] if len(m.r) else []
    # Of steering, with an understeer that is not known, hardly more than the sign is known.
    rough = [set() if at.name == "steer" else set(at.kind.powers) for at in held]
    signs = [set(at.kind.mirrors) for at in held]

    def named(found: Sequence[set[str]]) -> set[str]:
        return set().union(*(names for names in found if not names <= {*derived, "t"}))

    known = named([*exact, *(a | b for a, b in zip(rough, signs, strict=True))]) | set(without)
    unchecked = tuple(name for name in ASKED if name in runs[0] and name not in known)
    return unchecked, [name for name in SCALED if name in named(rough) - named(exact) - set(without)]
