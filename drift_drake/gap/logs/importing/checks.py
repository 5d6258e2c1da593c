"""What looks wrong in recordings: units, signs and clocks that contradict each other, a sentence for each.

Columns are held against each other as every log's are (`screening.consistency`), without a vehicle file; zeros of
headings and tilted sensors, which a file is imported with once and for all, in addition.
"""

import math
import re
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from scipy.ndimage import uniform_filter1d

from drift_drake.common.arrays import Array, correlation
from drift_drake.gap.logs.importing.known import POSITION
from drift_drake.gap.logs.importing.mapping import RecorderMapping
from drift_drake.gap.logs.importing.position import against_position
from drift_drake.gap.logs.screening.bad_samples import without_stuck
from drift_drake.gap.logs.screening.consistency import consistency
from drift_drake.gap.logs.screening.relations import GENTLE, Windows
from drift_drake.gap.logs.screening.suspicions import Suspicion

FEWEST = 230  # rows
WINDOW = 0.3  # [s] over which noise is averaged out
JUMP = 0.5  # [rad] of heading from row to row
SIDEWAYS = 1.3  # [rad] of sideslip over most of a run
TURNED = 0.35  # [rad] about which the sideslip of a heading with another zero lies, and not that of a spin
MOST_TURNED = 0.8  # of the rows
WHEELBASES = (0.1, 8.0)  # [m] of any vehicle, understeer included
TILT = 0.7  # [m/s^2] of accelerometer that no motion explains
GRAVITY = 9.81
LIKENESS = 0.8  # correlation from which one signal is another's negative


class Doubts(NamedTuple):
    """Sentences on what looks wrong, none where all agrees; unchecked: columns that no other one tells anything of;
    undecided: what else they cannot tell; suspicions: of those sentences that name a column's mistake, by sentence."""

    sentences: list[str]
    unchecked: tuple[str, ...]
    undecided: tuple[str, ...] = ()
    suspicions: Mapping[str, Suspicion] = {}


def recording_doubts(
    runs: Sequence[Mapping[str, Array]], period: float, wheelbase: float | None = None,
    stated: Mapping[str, str] | None = None, derived: Sequence[str] = (),
) -> Doubts:  # fmt: skip
    """What looks wrong in runs of one vehicle.

    Args:
        runs: columns of the log, by name, [n] at the same rows each; `vx`, `vy`, `az` too where they were recorded.
        period: time between rows [s]; wheelbase: of the vehicle [m], where known; stated: units of the mapping, by
            column; derived: columns that were made of each other.
    """
    runs, stuck = without_stuck(runs, period, FEWEST)
    if sum(len(columns["r"]) for columns in runs) < FEWEST:
        return Doubts(stuck, ())
    found = consistency(runs, [period] * len(runs), length=wheelbase, stated=stated, derived=derived)
    named = {f"{doubt.sentence.removesuffix('?').removesuffix('.')}.": doubt for doubt in found.doubts}
    sentences = stuck + list(named)
    names = set.intersection(*(set(columns) for columns in found.right))
    right = {name: np.concatenate([columns[name] for columns in found.right]) for name in names}
    if not found.complete:
        return Doubts(sentences, (), suspicions=named)
    doubted = {doubt.column for doubt in found.doubts}
    jumps = [sentence for columns in runs for sentence in _jumps(columns)]
    sentences += jumps[:1]
    sentences += _any_wheelbase(found.steer) if wheelbase is None else []
    sentences += _directions(right, max(round(WINDOW / period), 1)) + _accelerometer(right, found.windows, doubted)
    return Doubts(sentences, found.unchecked, found.undecided, named)


def doubts_of(
    parts: Sequence[tuple[str, Mapping[str, Array]]], period: float, mapping: RecorderMapping
) -> tuple[Doubts, dict[str, list[str]]]:
    """What looks wrong in all recordings together, and by recording: what only some of them have is said of these.

    Args:
        parts: of each run the name of its recording, and its columns; period: time between rows [s].
    """
    stated = {key: signal.unit for key, signal in mapping.signals.items() if key not in mapping.formulas}
    stated |= {"v": stated["vx"]} if "vx" in stated and "v" not in stated else {}
    made = {"x", "y", "psi"} <= set(mapping.signals)
    derived = [*mapping.derive, "x", "y", "psi"] if made else []
    derived = [name for name in derived if name in ("x", "y", "psi") or name not in mapping.signals]

    def asked(runs: Sequence[Mapping[str, Array]]) -> Doubts:
        said: list[str] = []
        if set(mapping.signals) >= POSITION:
            runs, said = against_position(runs, period, {*mapping.signals, *mapping.formulas})
        found = recording_doubts(runs, period, mapping.wheelbase, stated, derived)
        return found._replace(sentences=said + found.sentences)

    together = asked([columns for _, columns in parts])
    labels = list(dict.fromkeys(label for label, _ in parts))
    if len(labels) == 1:
        return together, {labels[0]: together.sentences}
    alone = {label: asked([columns for other, columns in parts if other == label]).sentences for label in labels}
    odd = [label for label in labels if {_cause(said) for said in alone[label]} - {*map(_cause, together.sentences)}]
    if len(odd) < len(labels) and odd:
        shared = [{*map(_cause, alone[label])} for label in labels]
        common = [said for said in together.sentences if all(_cause(said) in causes for causes in shared)]
        return together, {label: common + [said for said in alone[label] if _cause(said) not in {*map(_cause, common)}]
                          for label in labels}  # fmt: skip
    return together, dict.fromkeys(labels, together.sentences)


def _cause(sentence: str) -> str:
    """A sentence without its numbers."""
    return re.sub(r"[-+]?[0-9][0-9.e+-]*", "", sentence.split("(")[0])


def _any_wheelbase(steer: float) -> list[str]:
    """Of steering that fits no vehicle's wheelbase; steer: the one that it fits [m]."""
    if WHEELBASES[0] < steer < WHEELBASES[1]:
        return []
    unit = "degrees, or like the steering wheel's angle" if steer > 1.0 else "another unit"
    return [
        f"column delta_cmd looks like {unit}: speed and yaw rate fit a wheelbase of {steer:.3g} m; give the "
        "wheelbase in the mapping for more."
    ]


def _jumps(columns: Mapping[str, Array]) -> list[str]:
    steps = np.abs(np.diff(columns.get("psi", np.zeros(2))))
    worst = int(np.argmax(steps))
    if steps[worst] < JUMP:
        return []
    return [
        f"heading jumps by {steps[worst]:.3g} rad from one row to the next (row {worst + 1}): "
        "wrapped at other than a full turn, or a frame lost?"
    ]


def _directions(columns: Mapping[str, Array], rows: int) -> list[str]:
    """Of headings with another zero, and a sideslip that contradicts them; rows: that noise is averaged over."""
    if "beta" not in columns:
        return []
    beta, slip, sentences = columns["beta"], None, []
    if "vy" in columns:
        slip = np.arctan2(columns["vy"], np.maximum(columns["vx"], 1e-3))
    elif {"x", "y", "psi"} <= set(columns):
        vx, vy = (np.gradient(uniform_filter1d(columns[name], rows)) for name in ("x", "y"))
        slip = np.angle(np.exp(1j * (np.arctan2(vy, vx) - columns["psi"])))
        rest = float(np.median(np.angle(np.exp(1j * (slip - beta)))))
        if abs(rest) > SIDEWAYS:
            sentences.append(
                f"the course lies {math.degrees(rest):.0f} deg from heading plus sideslip: another zero of the heading "
                "(north or east)?"
            )
    if slip is not None and correlation(uniform_filter1d(beta, rows), uniform_filter1d(slip, rows)) < -LIKENESS:
        sentences.append("column beta looks mirrored: it is heading minus course, or of another axis convention.")
    turned = float(np.angle(np.mean(np.exp(1j * beta))))
    about = float(np.mean(np.abs(np.angle(np.exp(1j * (beta - turned)))) < TURNED))
    if abs(turned) > SIDEWAYS and about > MOST_TURNED:
        sentences.append(
            f"the vehicle moves {math.degrees(turned):.0f} deg off its heading most of the time: "
            "another zero of the heading (north or east), or vx and vy exchanged?"
        )
    return sentences


def _accelerometer(columns: Mapping[str, Array], w: Windows, doubted: set[str | None]) -> list[str]:
    """Of gravity in the accelerations, and of an axis that points down."""
    sentences = []
    if not np.isfinite(w.beta).any():
        w = w.where(np.abs(w.v * w.r) < GENTLE)  # what slides feels its turn ahead, too
    beta, swing = np.nan_to_num(w.beta), np.nan_to_num(w.swing)
    along, across = w.gain, w.v * (w.r + swing)
    expected = {
        "ax": along * np.cos(beta) - across * np.sin(beta),
        "ay": along * np.sin(beta) + across * np.cos(beta),
    }
    for name, motion in expected.items():
        read = getattr(w, name)
        rest = float(np.mean(read - motion)) if len(motion) else 0.0
        if not {name, "r", "v"} & doubted and abs(rest) > TILT:
            turns = name == "ay" and not {"psi", "x"} & set(columns)  # nothing else has seen the yaw rate's bias
            either = f", or does r read {-rest / np.mean(w.v):+.2g} rad/s in a straight line?" if turns else "?"
            sentences.append(
                f"column {name} reads {rest:+.2g} m/s^2 besides the change of velocity: "
                f"gravity on a tilted sensor or a slope, or a bias{either}"
            )
    rest = float(np.median(columns.get("az", 0.0)))
    if abs(abs(rest) - 1.0) < 0.3:
        sentences.append(f"vertical acceleration is {rest:.2g} m/s^2: it looks like g.")
    elif rest < -0.5 * GRAVITY:
        sentences.append(f"vertical acceleration is {rest:.2g} m/s^2: z points down (frame ned or sae)?")
    return sentences
