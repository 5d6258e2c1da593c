"""What looks wrong in a recording's columns: units, signs and clocks that contradict each other, a sentence for each.

Units and signs are judged by the relations that every log is judged by (`screening.suspicions`), without a vehicle
file; zeros of headings, tilted sensors and late clocks, which a file is imported with once and for all, beside them.
"""

import dataclasses
import math
from collections.abc import Mapping

import numpy as np
from scipy.ndimage import uniform_filter1d

from drift_drake.arrays import Array
from drift_drake.logs.importing.offsets import estimate_offset
from drift_drake.logs.screening.relations import GRIP, KINDS, Relation, Windows, relations, windows_of_columns
from drift_drake.logs.screening.suspicions import contradictions
from drift_drake.logs.screening.unit_mistakes import mistakes
from drift_drake.vehicle.parameters import VehicleParameters

FEWEST = 230  # rows
SCALE = math.log(1.25)  # of a ratio to one, beyond which a column's scale is doubted though no unit explains it
SCALED = ("turn", "path", "rim")  # relations whose ratio no car changes that much
WINDOW, TREND = 0.3, 3.0  # [s] over which noise is averaged out, and what changes too slowly to tell a time is
JUMP = 0.5  # [rad] of heading from row to row
SIDEWAYS = 1.3  # [rad] of sideslip over most of a run
WHEELBASES = (0.1, 8.0)  # [m] of any vehicle, understeer included
LEAD, LAG = 0.25, 0.05  # [s] from command to yaw, and of yaw before its command: more is no car's response
SEARCH = 1.5  # [s]
THINNED = 5  # rows that change too little from one to the next to tell more than one of them does
LIKENESS, ALIKE = 0.8, 0.7  # correlation of steering and yaw rate from which clocks are asked, and a lead is believed
TILT = 0.7  # [m/s^2] of accelerometer that no motion explains
GRAVITY = 9.81


def column_doubts(columns: Mapping[str, Array], period: float, wheelbase: float | None = None) -> list[str]:
    """Sentences on what looks wrong, none where all agrees.

    Args:
        columns: of the log, by name, all [n] at the same rows; `vx`, `vy`, `az` too where they were recorded.
        period: time between rows [s]; wheelbase: of the vehicle [m], where known.
    """
    if len(columns["r"]) < FEWEST:
        return []
    length = 0.5 * (wheelbase or 1.0)
    car = dataclasses.replace(VehicleParameters(), front_axle_distance=length, rear_axle_distance=length)
    kinds = {name: kind for name, kind in KINDS.items() if name != "drive"}
    if wheelbase is None:  # of steering then only the sign is judged
        kinds["steer"] = dataclasses.replace(kinds["steer"], tolerance=math.inf)
    found, windows = contradictions(
        windows_of_columns(columns, period), lambda w: relations(w, car, kinds), mistakes(None)
    )
    sentences = [f"{doubt.sentence}." for doubt in found]
    factors = {doubt.column: doubt.factor or 1.0 for doubt in found if doubt.column is not None}
    right = {name: values / factors.get(name, 1.0) for name, values in columns.items()}
    sentences += _jumps(columns)
    sentences += _scales(relations(windows, car, kinds), wheelbase)
    sentences += _directions(right, max(round(WINDOW / period), 1)) + _accelerometer(right, windows)
    return sentences or _clocks(right, period)


def _jumps(columns: Mapping[str, Array]) -> list[str]:
    steps = np.abs(np.diff(columns.get("psi", np.zeros(2))))
    worst = int(np.argmax(steps))
    if steps[worst] < JUMP:
        return []
    return [
        f"heading jumps by {steps[worst]:.3g} rad from one row to the next (row {worst + 1}): "
        "wrapped at other than a full turn, or a frame lost?"
    ]


def _scales(found: list[Relation], wheelbase: float | None) -> list[str]:
    """Of ratios that are off by no known mistake."""
    sentences = [
        f"{at.kind.says} is {at.size:.3g}: check the unit or scale of column {next(iter(at.kind.powers))}."
        for at in found
        if at.name in SCALED and abs(math.log(at.size)) > SCALE
    ]
    steer = next((at.size for at in found if at.name == "steer"), 1.0)
    if wheelbase is None and not WHEELBASES[0] < steer < WHEELBASES[1]:
        unit = "degrees, or like the steering wheel's angle" if steer > 1.0 else "another unit"
        sentences.append(
            f"column delta_cmd looks like {unit}: speed and yaw rate fit a wheelbase of {steer:.3g} m; give the "
            "wheelbase in the mapping for more."
        )
    return sentences


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
    if slip is not None and _likeness(uniform_filter1d(beta, rows), uniform_filter1d(slip, rows)) < -LIKENESS:
        sentences.append("column beta looks mirrored: it is heading minus course, or of another axis convention.")
    if float(np.median(np.abs(beta))) > SIDEWAYS:
        sentences.append(
            f"the vehicle moves {math.degrees(float(np.median(beta))):.0f} deg off its heading most of the time: "
            "another zero of the heading (north or east), or vx and vy exchanged?"
        )
    return sentences


def _accelerometer(columns: Mapping[str, Array], w: Windows) -> list[str]:
    """Of gravity in the accelerations, and of an axis that points down."""
    sentences = []
    beta, swing = np.nan_to_num(w.beta), np.nan_to_num(w.swing)
    along, across = w.gain, w.v * (w.r + swing)
    expected = {
        "ax": along * np.cos(beta) - across * np.sin(beta),
        "ay": along * np.sin(beta) + across * np.cos(beta),
    }
    for name, motion in expected.items():
        read = getattr(w, name)
        rest = float(np.mean(read - motion)) if len(motion) else 0.0
        size = float(np.std(read) / max(np.std(motion), 1e-9)) if _likeness(read, motion) > LIKENESS else 1.0
        if abs(math.log(size)) > SCALE:
            sentences.append(f"column {name} is {size:.3g} times the change of velocity: check its unit or scale.")
        elif abs(rest) > TILT:
            sentences.append(
                f"column {name} reads {rest:+.2g} m/s^2 besides the change of velocity: "
                "gravity on a tilted sensor or a slope, or a bias?"
            )
    rest = float(np.median(columns.get("az", 0.0)))
    if abs(abs(rest) - 1.0) < 0.3:
        sentences.append(f"vertical acceleration is {rest:.2g} m/s^2: it looks like g.")
    elif rest < -0.5 * GRAVITY:
        sentences.append(f"vertical acceleration is {rest:.2g} m/s^2: z points down (frame ned or sae)?")
    return sentences


def _likeness(a: Array, b: Array) -> float:
    """Correlation of two signals, zero where one does not vary or is not there."""
    if len(a) < 2 or not np.isfinite(a).all() or min(np.ptp(a), np.ptp(b)) < 1e-9:
        return 0.0
    return float(np.corrcoef(a, b)[0, 1])


def _clocks(columns: Mapping[str, Array], period: float) -> list[str]:
    """Whether the yaw rate follows the steering as late as a car's does."""
    if "delta_cmd" not in columns:
        return []
    grip = np.abs(columns.get("beta", np.zeros_like(columns["r"]))) < GRIP
    turned, steered = (uniform_filter1d(z, max(round(WINDOW / period), 1))
                       for z in (columns["r"], columns["delta_cmd"] * columns["v"]))  # fmt: skip
    if np.count_nonzero(grip) < FEWEST or _likeness(turned[grip], steered[grip]) < LIKENESS:
        return []
    t = np.asarray(np.arange(len(turned)) * period, dtype=float)
    # Slow changes tell little of a time, and an understeering car's follow the steering's with another shape.
    turned, steered = (z - uniform_filter1d(z, round(TREND / period)) for z in (turned, steered))
    try:
        found = estimate_offset(t[grip][::THINNED], turned[grip][::THINNED], t, steered, 0.0, SEARCH)
    except ValueError:
        return []
    lead = -found.offset
    if found.correlation < ALIKE:
        return []
    if lead - 3.0 * found.std > LEAD:
        return [f"commands lead the motion by {lead:.2g} s (+- {found.std:.1g} s): clocks not aligned?"]
    if lead + 3.0 * found.std < -LAG:
        return [f"the motion leads its commands by {-lead:.2g} s (+- {found.std:.1g} s): clocks not aligned?"]
    return []
