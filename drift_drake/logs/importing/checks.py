"""Signs and units: what a log's columns say of each other, a sentence for each disagreement."""

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from drift_drake.logs.importing.clock import estimate_offset

Array = NDArray[np.float64]

AGREEMENT = 0.8  # correlation below which two columns say nothing of each other's scale
CLOSE = math.log(1.25)  # of a gain to one, where all is well
EQUAL = math.log(1.12)  # of a gain to a unit's factor
WINDOW = 0.3  # [s] over which noise is averaged out before columns are compared
JUMP = 0.5  # [rad] of heading from row to row
SIDEWAYS = 1.3  # [rad] of sideslip over most of a run
GRIP = 0.15  # [rad] sideslip up to which a car goes where it steers
FEWEST = 200  # rows to compare steering and yaw rate on
WHEELBASES = (0.1, 8.0)  # [m] of any vehicle, understeer included
UNDERSTEER = 3.0  # at most by this factor does a car turn less or more than it steers
LEAD = 0.25  # [s] from command to yaw: more is no car's response
LAG = 0.05  # [s] of yaw before its command
TREND = 3.0  # [s] over which steering and yaw rate change too slowly to tell a time
SEARCH = 1.5  # [s]
THINNED = 5  # rows that change too little from one to the next to tell more than one of them does
ALIKE = 0.7  # correlation from which a lead is believed
TILT = 0.7  # [m/s^2] of accelerometer that no motion explains
GRAVITY = 9.81

UNITS = {
    "angle": {180.0 / math.pi: "deg", math.pi / 180.0: "radians converted as if they were degrees"},
    "angular rate": {180.0 / math.pi: "deg/s", math.pi / 180.0: "rad/s converted as if they were deg/s"},
    "speed": {3.6: "km/h", 1.0 / 3.6: "m/s converted as if they were km/h", 1.0 / 0.44704: "mph"},
    "acceleration": {1.0 / 9.80665: "g", 9.80665: "m/s^2 converted as if they were g"},
}
TITLES = {
    "r": "yaw rate",
    "v": "speed",
    "beta": "sideslip",
    "psi": "heading",
    "ax": "longitudinal acceleration",
    "ay": "lateral acceleration",
    "vy": "v_y",
    "omega_r": "rear wheel speed",
}


def column_doubts(columns: Mapping[str, Array], period: float, wheelbase: float | None = None) -> list[str]:
    """Sentences on what looks wrong, none where all agrees.

    Columns are held against each other in the order of trust: positions, heading, yaw rate, speed, sideslip,
    accelerations, wheel speed, steering. One that was found wrong is not a witness against the next.

    Args:
        columns: of the log, by name, all [n] at the same rows; `vx`, `vy`, `az` too where they were recorded.
        period: time between rows [s]; wheelbase: of the vehicle [m], where known.
    """
    half = _half(period, WINDOW)
    if len(columns["r"]) < FEWEST + 2 * half:
        return []
    smoothed = {name: _averaged(values, period, WINDOW) for name, values in columns.items()}
    found = _jumps(columns)
    yaw_rate, wrong = _yaw_rate(smoothed, period, wheelbase)
    found += [sentence for sentences in wrong.values() for sentence in sentences]
    smoothed = {name: values for name, values in smoothed.items() if name not in wrong}
    speed = _speed(smoothed, yaw_rate, period, found)
    beta = _sideslip(smoothed, found)
    found += _accelerations(smoothed, speed, beta, yaw_rate, period)
    grip = np.abs(beta) < GRIP  # a sliding car's wheels spin
    if "omega_r" in smoothed and np.count_nonzero(grip) >= FEWEST:
        rolling = (speed * np.cos(beta))[grip]
        found += disagreement("omega_r", "speed", smoothed["omega_r"][grip], rolling, "vehicle's speed")
    if "delta_cmd" in columns:
        found += _steering(
            columns["delta_cmd"][half : len(columns["r"]) - half], speed, yaw_rate, beta, period, wheelbase
        )
    return found


def disagreement(name: str, kind: str, measured: Array, expected: Array, reference: str) -> list[str]:
    """One sentence if a column is not what it is expected to be, by its sign or its scale; none if it is, or if the two
    are too little alike to say.

    Args:
        kind: of the unit (a key of UNITS); measured, expected: [n]; reference: what says so, for the sentence.
    """
    title = TITLES.get(name, name)
    gain, correlation = _gain(measured, expected)
    if abs(correlation) < AGREEMENT:
        return []
    size = abs(gain)
    unit = next((text for number, text in UNITS[kind].items() if abs(math.log(size / number)) < EQUAL), None)
    sentences = []
    if unit is not None:
        sentences.append(f"{title} looks like {unit}: it is {size:.3g} times what the {reference} says.")
    elif abs(math.log(size)) > CLOSE:
        sentences.append(f"{title} is {size:.3g} times what the {reference} says: check its unit or scale.")
    if gain < 0.0:
        sentences.append(
            f"{title} has the opposite sign of what the {reference} says: another axis convention (NED, SAE) or sign?"
        )
    return sentences


def _half(period: float, window: float) -> int:
    return max(0, round(window / period / 2))


def _averaged(values: Array, period: float, window: float) -> Array:
    """Moving average; half a window shorter at both ends."""
    width = 2 * _half(period, window) + 1
    sums = np.cumsum(np.concatenate([[0.0], values]))
    return np.asarray((sums[width:] - sums[:-width]) / width)


def _gain(measured: Array, expected: Array) -> tuple[float, float]:
    """Ratio of the spreads, with the sign of the correlation, and the correlation."""
    a, b = measured - measured.mean(), expected - expected.mean()
    spread_a, spread_b = float(np.std(a)), float(np.std(b))
    if spread_a < 1e-9 or spread_b < 1e-9:
        return 1.0, 0.0
    correlation = float(np.mean(a * b)) / (spread_a * spread_b)
    return math.copysign(spread_a / spread_b, correlation), correlation


def _agree(measured: Array, expected: Array) -> bool:
    gain, correlation = _gain(measured, expected)
    return correlation > AGREEMENT and abs(math.log(gain)) < CLOSE


def _jumps(columns: Mapping[str, Array]) -> list[str]:
    if "psi" not in columns:
        return []
    steps = np.abs(np.diff(columns["psi"]))
    worst = int(np.argmax(steps))
    if steps[worst] < JUMP:
        return []
    return [
        f"heading jumps by {steps[worst]:.3g} rad from one row to the next (row {worst + 1}): "
        "wrapped at other than a full turn, or a frame lost?"
    ]


def _yaw_rate(
    columns: Mapping[str, Array], period: float, wheelbase: float | None
) -> tuple[Array, dict[str, list[str]]]:
    """The yaw rate to trust, and sentences on the columns that contradict it."""
    r, course = columns["r"], _course_rate(columns, period)
    if "psi" in columns:
        turning = np.gradient(columns["psi"], period)
        if _agree(r, turning):
            mirrored = course is not None and _gain(course, r)[1] < -AGREEMENT
            sentence = "the positions turn against heading and yaw rate: x or y has the opposite sign?"
            return r, {"y": [sentence]} if mirrored else {}
        if course is not None and _agree(r, course):
            return r, _named("psi", disagreement("psi", "angle", turning, r, "yaw rate"))
        return turning, _named("r", disagreement("r", "angular rate", r, turning, "heading"))
    if course is not None:
        wrong = disagreement("r", "angular rate", r, course, "course")
        return (course if wrong else r), _named("r", wrong)
    if "delta_cmd" in columns and "ay" in columns and wheelbase is not None:
        turning, steered = (
            columns["ay"] / np.maximum(columns["v"], 1.0),
            columns["delta_cmd"] * columns["v"] / wheelbase,
        )
        if _steers(turning, steered) and not _steers(r, steered):
            return turning, _named("r", disagreement("r", "angular rate", r, turning, "lateral acceleration"))
    return r, {}


def _named(name: str, sentences: list[str]) -> dict[str, list[str]]:
    return {name: sentences} if sentences else {}


def _steers(yaw_rate: Array, steered: Array) -> bool:
    gain, correlation = _gain(yaw_rate, steered)
    return correlation > AGREEMENT and abs(math.log(gain)) < math.log(UNDERSTEER)


def _course_rate(columns: Mapping[str, Array], period: float) -> Array | None:
    if "x" not in columns or "y" not in columns:
        return None
    vx, vy = np.gradient(columns["x"], period), np.gradient(columns["y"], period)
    squared = np.maximum(vx**2 + vy**2, 1e-2)
    return np.asarray((vx * np.gradient(vy, period) - vy * np.gradient(vx, period)) / squared)


def _speed(columns: Mapping[str, Array], yaw_rate: Array, period: float, found: list[str]) -> Array:
    """Checks the speed, and returns the one to trust."""
    v = columns["v"]
    if "x" in columns and "y" in columns:
        moved = np.hypot(np.gradient(columns["x"], period), np.gradient(columns["y"], period))
        sentences = disagreement("v", "speed", v, moved, "change of position")
        found += sentences
        return moved if sentences else v
    if "ax" in columns and "ay" in columns:
        along, likeness = _gain(np.gradient(v, period), columns["ax"])
        across, alike = _gain(yaw_rate * v, columns["ay"])
        units = [
            number for number in UNITS["speed"] if all(abs(math.log(abs(g) / number)) < CLOSE for g in (along, across))
        ]
        if units and min(likeness, alike) > AGREEMENT:
            found += disagreement("v", "speed", yaw_rate * v, columns["ay"], "accelerometer")
            return v / units[0]
    return v


def _sideslip(columns: Mapping[str, Array], found: list[str]) -> Array:
    """Checks the sideslip, and returns the one to trust (zero where nothing tells)."""
    if "beta" not in columns:
        return np.zeros_like(columns["v"])
    beta = columns["beta"]
    if "vx" in columns and "vy" in columns:
        moving = np.arctan2(columns["vy"], np.maximum(columns["vx"], 1e-3))
        sentences = disagreement("beta", "angle", beta, moving, "v_y")
        found += [text.replace("of what the v_y says", "of v_y") for text in sentences]
        beta = moving if sentences else beta
    elif {"x", "y", "psi"} <= set(columns):
        course = np.arctan2(np.gradient(columns["y"]), np.gradient(columns["x"]))
        apart = np.unwrap(np.mod(course - columns["psi"] + np.pi, 2.0 * np.pi) - np.pi)
        sentences = disagreement("beta", "angle", beta, apart, "course")
        found += sentences
        beta = apart if sentences else beta
        rest = float(np.median(np.angle(np.exp(1j * (apart - beta)))))
        if not sentences and abs(rest) > SIDEWAYS:
            found.append(
                f"the course lies {math.degrees(rest):.0f} deg from heading plus sideslip: another zero of the heading "
                "(north or east)?"
            )
    if float(np.median(np.abs(beta))) > SIDEWAYS:
        found.append(
            f"the vehicle moves {math.degrees(float(np.median(beta))):.0f} deg off its heading most of the time: "
            "another zero of the heading (north or east), or vx and vy exchanged?"
        )
    return beta


def _accelerations(
    columns: Mapping[str, Array], speed: Array, beta: Array, yaw_rate: Array, period: float
) -> list[str]:
    along, across = np.gradient(speed, period), speed * (yaw_rate + np.gradient(beta, period))
    expected = {
        "ax": along * np.cos(beta) - across * np.sin(beta),
        "ay": along * np.sin(beta) + across * np.cos(beta),
    }
    sentences = []
    for name in expected.keys() & columns.keys():
        wrong = disagreement(name, "acceleration", columns[name], expected[name], "change of velocity")
        rest = float(np.mean(columns[name] - expected[name]))
        if not wrong and abs(rest) > TILT:
            wrong = [
                f"{TITLES[name]} reads {rest:+.2g} m/s^2 besides the change of velocity: "
                "gravity on a tilted sensor or a slope, or a bias?"
            ]
        sentences += wrong
    if "az" in columns:
        rest = float(np.median(columns["az"]))
        if abs(abs(rest) - 1.0) < 0.3:
            sentences.append(f"vertical acceleration is {rest:.2g} m/s^2: it looks like g.")
        elif rest < -0.5 * GRAVITY:
            sentences.append(f"vertical acceleration is {rest:.2g} m/s^2: z points down (frame ned or sae)?")
    return sorted(sentences)


def _steering(
    delta: Array, speed: Array, yaw_rate: Array, beta: Array, period: float, wheelbase: float | None
) -> list[str]:
    grip = np.abs(beta) < GRIP
    if np.count_nonzero(grip) < FEWEST:
        return []
    steered = delta * speed
    _, correlation = _gain(steered[grip], yaw_rate[grip])
    if abs(correlation) < AGREEMENT:
        return []
    gain = float(steered[grip] @ yaw_rate[grip]) / float(
        yaw_rate[grip] @ yaw_rate[grip]
    )  # the wheelbase, if all is well
    size, true = abs(gain), wheelbase or abs(gain)
    sentences = []
    if not WHEELBASES[0] < size < WHEELBASES[1] or abs(math.log(size / true)) > math.log(UNDERSTEER):
        fits = f"a wheelbase of {size:.3g} m" + (f" where {wheelbase:g} m is known" if wheelbase else "")
        unit = "degrees, or like the steering wheel's angle" if size > true or size > WHEELBASES[1] else "another unit"
        sentences.append(f"steering looks like {unit}: speed and yaw rate fit {fits}.")
    if gain < 0.0:
        sentences.append("steering has the opposite sign of the yaw rate: another axis convention (NED, SAE) or sign?")
    if not sentences:
        sentences += _clocks(steered, yaw_rate, grip, period)
    return sentences


def _clocks(steered: Array, yaw_rate: Array, grip: NDArray[np.bool_], period: float) -> list[str]:
    """Whether the yaw rate follows the steering as late as a car's does."""
    t = np.asarray(np.arange(len(steered)) * period, dtype=float)
    # Slow changes tell little of a time, and an understeering car's follow the steering's with another shape.
    half = _half(period, TREND)
    if len(t) < FEWEST + 2 * half:
        return []
    inner = slice(half, len(t) - half)
    turned, steered = (values[inner] - _averaged(values, period, TREND) for values in (yaw_rate, steered))
    t, grip = t[inner], grip[inner]
    try:
        found = estimate_offset(t[grip][::THINNED], turned[grip][::THINNED], t, steered, 0.0, SEARCH)
    except ValueError:
        return []
    if found.correlation < ALIKE:
        return []
    lead = -found.offset
    if lead - 3.0 * found.std > LEAD:
        return [f"commands lead the motion by {lead:.2g} s (+- {found.std:.1g} s): clocks not aligned?"]
    if lead + 3.0 * found.std < -LAG:
        return [f"the motion leads its commands by {-lead:.2g} s (+- {found.std:.1g} s): clocks not aligned?"]
    return []
