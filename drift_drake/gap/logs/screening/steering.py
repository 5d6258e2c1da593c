"""Steering commands: their ratio to what the wheelbase asks for, and how far they go."""

import dataclasses
import re
from collections.abc import Sequence

import numpy as np

from drift_drake.car.log.plausible import LARGEST
from drift_drake.car.parameters import VehicleParameters
from drift_drake.gap.logs.screening.averaging import Columns
from drift_drake.gap.logs.screening.gains import Bounds, gain
from drift_drake.gap.logs.screening.kinematics import Kinematics
from drift_drake.gap.logs.screening.suspicions import Suspicion
from drift_drake.gap.logs.screening.unit_mistakes import WHEEL

GENTLE = 4.0  # [m/s^2] of v r below which a tyre's slip goes with its force
STEADY = 0.15  # [rad] of sideslip
MARGIN = 0.1  # of the ratio: what a wheelbase, toe and a steering ratio that is not linear may be off by
FARTHEST = 0.8  # [rad] that hardly any car's front wheels turn
REACHED = 0.995  # of the rows: less is a spike
BEYOND = 1.05  # times the limit of the vehicle file
HELD = 0.025  # [s] that a command stands still for
FEWEST_STEPS = 30  # of a command that is held
IN_STEP = 0.9  # of the changes that come after a whole number of holds
SAID = 3.0  # times the usual hold, for a reading that repeats
ONE_STEP = 1.5  # from small changes to large ones, below which all are of one step


def ratio_found(m: Kinematics, length: float) -> Bounds | None:
    """How many times as large the steering commands are as gentle turns ask for, where they tell.

    The steered angle is (L + K v^2) r / v: what goes with r / v tells the ratio, what goes with v r the understeer, and
    what goes with 1 / v a bias of r.

    Args:
        length: the wheelbase [m].
    """
    slow = (np.abs(m.turned) < GENTLE) & (np.abs(np.nan_to_num(m.beta)) < STEADY)
    w = m.where(slow)
    asked = length * w.r / w.v
    return gain(w.delta_cmd, asked, np.column_stack([w.turned, w.spin / w.v, w.lag(asked), 1.0 / w.v]), w.block)


def ratio_doubts(m: Kinematics, length: float) -> list[Suspicion]:
    """A steering ratio that gentle turns contradict; length: the wheelbase [m]."""
    found = ratio_found(m, length)
    if found is None or not found.beyond(1.0, MARGIN):
        return []
    says = _says(found, length)
    return [Suspicion(
        f"column delta_cmd reads {100.0 * abs(found.middle - 1.0):.2g} % too "
        f"{'large' if found.middle > 1.0 else 'small'} ({says}): the steering ratio is off, or the wheelbase; divide "
        f"its scale by {found.middle:.3g} in the mapping", "delta_cmd", found.middle, says)]  # fmt: skip


def wheel_ratio(doubt: Suspicion, m: Kinematics, length: float | None) -> Suspicion:
    """A doubt with the steering wheel's ratio as gentle turns tell it, without understeer; any other, or where they do
    not tell it, as it is.

    Args:
        m: of columns that the doubt's factor was taken out of; length: the wheelbase [m].
    """
    if WHEEL not in doubt.sentence or doubt.factor is None or length is None or not len(m.r):
        return doubt
    found = ratio_found(m, length)
    if found is None:
        return doubt
    found = found.over(1.0 / doubt.factor)
    says = _says(found, length)
    sentence = re.sub(r"\([^()]* what other columns say[^()]*\)", f"({says})", doubt.sentence)
    return dataclasses.replace(doubt, sentence=sentence, factor=found.middle, evidence=says)


def _says(found: Bounds, length: float) -> str:
    return (
        f"in gentle turns it is {found.middle:.3g} ({found.low:.3g} to {found.high:.3g}) times what a wheelbase of "
        f"{length:.3g} m and r / v ask for, understeer aside"
    )


def reach_doubts(runs: Sequence[Columns], vehicle: VehicleParameters | None) -> list[Suspicion]:
    """Commands beyond what the front wheels can turn."""
    angles = np.concatenate([np.abs(np.asarray(columns["delta_cmd"])) for columns in runs])
    far = float(np.quantile(angles, REACHED))
    if vehicle is None:
        limit, whose = FARTHEST, f"{FARTHEST:g} rad that hardly any car's front wheels turn"
    else:
        limit, whose = BEYOND * vehicle.steering_limit, f"steering_limit of {vehicle.steering_limit:.3g} rad"
    if not limit < far <= LARGEST["delta_cmd"][0]:
        return []  # what is larger is refused
    says = f"delta_cmd reaches {far:.3g} rad, beyond the {whose}"
    return [Suspicion(
        f"{says}: the wheels did not follow there; give the angle that they took, its unit or the steering ratio",
        "delta_cmd", None, says)]  # fmt: skip


def held_doubts(runs: Sequence[Columns], periods: Sequence[float]) -> list[Suspicion]:
    """Commands that stand still for some rows each: read at a lower rate, and held."""
    found = {}
    for name in ("delta_cmd", "tau_cmd"):
        holds = [_hold(np.asarray(values)) * period for columns, period in zip(runs, periods, strict=True)
                 if (values := columns.get(name)) is not None]  # fmt: skip
        if holds and float(np.median(holds)) >= HELD:
            found[name] = float(np.median(holds))
    if not found:
        return []
    names, held, rate = " and ".join(found), max(found.values()), 1.0 / periods[0]
    verb = "are" if len(found) > 1 else "is"
    says = f"{names} {verb} held for {held:.3g} s each, {1.0 / held:.3g} Hz in a log of {rate:.3g} Hz"
    return [Suspicion(
        f"{says}: a command that changed in between is up to {held:.3g} s late; log it faster, or give it a clock "
        "of its own in the mapping", next(iter(found)), None, says)]  # fmt: skip


def _hold(values: np.ndarray) -> int:
    """Rows that a command is held for, zero of one that changes as it likes."""
    changes = np.flatnonzero(np.diff(values) != 0.0)
    if len(changes) < FEWEST_STEPS:
        return 0
    lengths, sizes = np.diff(changes), np.abs(np.diff(values)[changes])
    usual = int(np.median(lengths))
    one_step = float(np.quantile(sizes, 0.9)) < ONE_STEP * float(np.quantile(sizes, 0.1))
    if usual < 2 or one_step:
        return 0  # as it likes, or a slow change in steps of its resolution
    off = np.abs(lengths - usual * np.maximum(np.round(lengths / usual), 1.0))
    steady = (off <= 1.0) & (lengths <= SAID * usual)
    return usual if float(np.mean(steady)) >= IN_STEP else 0
