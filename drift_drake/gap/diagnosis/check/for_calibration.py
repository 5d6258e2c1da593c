"""`drift-drake check --for-calibration`: whether a car can be calibrated on logs, and which drive is missing."""

import dataclasses
from collections.abc import Sequence

from drift_drake.car.effects.catalogue import CATALOGUE, shown_by
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.log.table import Run
from drift_drake.car.parameters import CarParameters
from drift_drake.common.errors import significant
from drift_drake.gap.identification.driving import Driving, Missing, driving_of
from drift_drake.gap.identification.forecast import forecast
from drift_drake.gap.identification.options import KNOWN
from drift_drake.gap.identification.outlook import TIMES, Outlook, never
from drift_drake.gap.identification.stated import EFFECT_OF, NEVER

WITHOUT_BETA = (
    "column beta is missing: a calibration goes by likelihood; whether recordings agree, and what a later log "
    "would show, can only be known with the sideslip logged"
)


@dataclasses.dataclass(frozen=True)
class ForCalibration:
    """What is said of logs before a car is calibrated on them."""

    good_enough: bool
    refused: bool  # by `identify`, which is too little for any parameter
    driving: Driving
    missing: list[Missing]  # drives, the gravest first
    kept: list[str]  # parameters that would stay at their first guess
    disagreed: dict[str, str]  # parameters that recordings ask different values of, and which pulls each the most
    outlook: Outlook  # by effect the least magnitude of a change that would be seen, after `TIMES` as many recordings
    remarks: list[str]


def for_calibration(
    runs: Sequence[Run], vehicle: CarParameters, effects: Effects, stated: frozenset[str]
) -> ForCalibration:
    """Whether usable runs are good enough to calibrate a car on.

    Args:
        vehicle, effects: the first guess; stated: tolerances that its file states.
    """
    driving = driving_of(runs, vehicle.single_track())
    missing = driving.missing()
    disagreed, found, remarks = dict[str, str](), Outlook(), list[str]()
    if any(run.beta is None for run in runs):
        remarks = [WITHOUT_BETA]
    elif not driving.gentle:
        expected = forecast(runs, vehicle, effects, (*KNOWN, *driving.unseen), stated)
        disagreed = expected.left_open.disagreed
        found = expected.outlook | {
            EFFECT_OF[name]: NEVER for name in driving.unseen if EFFECT_OF[name] in expected.outlook
        }
        remarks = expected.left_open.sentences[driving.recordings == 1 :]  # that there is one is among what is missing
    return ForCalibration(
        not any(one.grave for one in missing), driving.gentle, driving, missing, list(driving.unseen), disagreed, found,
        remarks,
    )  # fmt: skip


def said(found: ForCalibration) -> list[str]:
    """What is said of it, a line each, to be wrapped where it begins with two spaces."""
    verdict = "good enough" if found.good_enough else "not good enough"
    refused = "; 'drift-drake identify' refuses them without --force" if found.refused else ""
    lines = [f"to calibrate a car on: {verdict}{refused}"]
    lines += [f"  - {one.sentence()}" for one in found.missing]
    if found.kept:
        lines.append(f"  - would stay at the first guess: {', '.join(found.kept)}")
    lines += [f"  - {remark}" for remark in found.remarks]
    named = {name: column for name, column in found.outlook.items() if name not in never(found.outlook)}
    if named:
        times = ", ".join(f"{n}" for n in TIMES)
        lines.append(f"a later log would show, from this magnitude on, after {times} times as many such recordings:")
        lines += [f"  {name} {limits(column)}{CATALOGUE[name].suffix}" for name, column in named.items()]
    unseen = never(found.outlook)
    if unseen:
        lines.append(f"no number of such recordings would show: {', '.join(unseen)}")
        lines += [f"  to see {', '.join(names)}: {words}" for words, names in shown_by(unseen)]
    return lines


def limits(column: Sequence[float | None]) -> str:
    """Magnitudes after more and more recordings."""
    return ", ".join("never" if q is None else significant(q, 2) for q in column)
