"""Columns that say the same thing, compared: by how much they disagree, and the one column that explains the most."""

import dataclasses
import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from drift_drake.gap.logs.screening.gains import Bounds, coefficients, gain, mean
from drift_drake.gap.logs.screening.kinematics import Kinematics
from drift_drake.gap.logs.screening.suspicions import Suspicion
from drift_drake.gap.logs.screening.unit_mistakes import Mistake

MARGIN = 0.03  # of a gain: sensors' scales are that good, and sensors' axes are aligned that well
SIDEWAYS = 0.12  # of a rim's speed, where the sideslip is not known: half a radian makes as much
TILTING = 0.05  # of an acceleration's: a body that rolls or pitches by three degrees at 1 g reads as much more
GENTLE = 4.0  # [m/s^2] of v r up to which a car whose sideslip is not logged hardly slides
STEADY = 0.15  # [rad] of sideslip up to which wheels roll
LIKE, ALONG = 0.6, 0.97  # correlation of what is compared, and of a car whose sideslip is not known: it hardly slides
BIAS = 0.005  # [rad/s] of a yaw rate: 3 deg of heading in ten seconds
ARM = 0.04  # of the wheelbase: a point of measurement is known that well
LENGTH = 2.5  # [m] of a wheelbase that is not known
UNSURE, FAR = 0.25, 3.0  # of the wheelbase, beyond which a point of measurement is not known; [m] off any car
WORKING = 6.0  # [m/s^2] of v r, and of v' a third, below which a wheel's slip goes with the forces
SLIPPED = 0.05  # of rim speed over speed, beyond which a wheel spins or locks
MOST = 4  # mistakes of one log
# Columns that one mistake may touch together, and what they are called.
CANDIDATES = (("r",), ("psi",), ("v",), ("omega_r",), ("ax",), ("ay",), ("beta",), ("y",), ("t",), ("v", "omega_r"),
              ("ax", "ay"), ("r", "psi"))  # fmt: skip
NAMES = {"t": "the clock t", "y": "the scale of x and y"}


@dataclasses.dataclass(frozen=True)
class Compared:
    """A gain that should be one. powers: with which a factor on a column (`t`: the clock) enters it."""

    says: str
    powers: Mapping[str, int]
    margin: float
    gain: Bounds

    def power(self, columns: Sequence[str]) -> int:
        """Of a factor on all these columns."""
        return sum(self.powers.get(column, 0) for column in columns)

    def conflicts(self, columns: Sequence[str] = (), factor: float = 1.0) -> bool:
        """Whether it is not one for certain, once the columns are divided by the factor."""
        out = factor ** self.power(columns)
        return self.gain.over(out).beyond(1.0, self.margin)


def agreements(m: Kinematics) -> list[Compared]:
    """The gains that the columns allow to tell."""
    found: list[tuple[str, dict[str, int], float, Bounds | None]] = []
    slides = np.isfinite(m.beta).any()
    turning = np.column_stack([m.spin, m.circling])
    found.append(("r over the rate of psi", {"r": 1, "psi": -1, "t": 1}, MARGIN,
                  gain(m.r, m.turning, _lag(m, m.turning), m.block)))  # fmt: skip
    gentle = m.where(np.abs(m.turned) < GENTLE)
    regressors = np.column_stack([m.lag(m.course), m.spin])
    least = LIKE if slides else ALONG
    if np.isfinite(m.heading).any():
        says = f"the rate of psi{' and beta' if slides else ''} over that of the course of x, y"
        powers = {"psi": 1, "beta": 0} if slides else {"psi": 1}
        found.append((says, powers, MARGIN, gain(m.heading, m.course, regressors, m.block, least)))
    elif np.isfinite(m.course).any():
        found.append(
            (
                "r over the rate of the course of x, y",
                {"r": 1, "t": 1},
                MARGIN,
                gain(m.yawed, m.course, regressors, m.block, least),
            )
        )
    if slides:
        across = gain(m.ay, m.across, np.column_stack([_lag(m, m.across), turning]), m.block)
        along = gain(m.ax, m.along, np.column_stack([_lag(m, m.along), turning]), m.block)
        found.append(("ay over v r and the rate of v_y", {"ay": 1, "v": -1, "r": -1}, TILTING, across))
        found.append(("ax over the rate of v_x less v_y r", {"ax": 1, "v": -1, "t": 1}, TILTING, along))
    else:
        across = gain(gentle.ay, gentle.turned, np.column_stack([_lag(gentle, gentle.turned), gentle.spin]),
                      gentle.block, least)  # fmt: skip
        straight = m.where(np.abs(m.turned) < 0.5 * GENTLE)
        along = gain(straight.ax, straight.gain, _lag(straight, straight.gain), straight.block)
        found.append(("ay over v r", {"ay": 1, "v": -1, "r": -1}, TILTING, across))
        found.append(("ax over the rate of v", {"ax": 1, "v": -1, "t": 1}, TILTING, along))
    found.append(("v over the speed along x, y", {"v": 1, "t": 1, "y": -1}, MARGIN, _ratio(m.v, m.moved, m.block)))
    found.append(("omega_r over v", {"omega_r": 1, "v": -1}, MARGIN if slides else SIDEWAYS, _rolling(m)))
    return [Compared(says, powers, margin, g) for says, powers, margin, g in found if g is not None]


def _lag(m: Kinematics, values: np.ndarray) -> np.ndarray:
    return m.lag(values)[:, None]


def _ratio(measured: np.ndarray, expected: np.ndarray, blocks: np.ndarray) -> Bounds | None:
    """Of two speeds, about one in most windows."""
    known = (measured > 0.0) & (expected > 0.0)
    found = mean(np.log(measured[known] / expected[known]), blocks[known])
    return None if found is None else Bounds(math.exp(found.low), math.exp(found.middle), math.exp(found.high))


def _rolling(m: Kinematics) -> Bounds | None:
    """Rim speed over speed of a wheel that neither drives nor brakes: where slip is small, without what force makes."""
    forward = np.where(np.isfinite(m.forward), m.forward, m.v)
    rate = np.where(np.isfinite(m.along), m.along, m.gain)
    calm = (np.abs(np.nan_to_num(m.beta)) < STEADY) & (np.abs(m.turned) < GENTLE) & (forward > 0.0)
    known = calm & np.isfinite(m.omega_r)
    if not np.any(known):
        return None
    ratio = m.omega_r[known] / forward[known]
    usual = float(np.median(ratio))
    kept = np.abs(ratio / usual - 1.0) < SLIPPED
    part = np.flatnonzero(known)[kept]
    found = coefficients(np.column_stack([np.ones(len(part)), rate[part]]), ratio[kept], m.block[part])
    return None if found is None else found[0]


def scale_doubts(m: Kinematics, without: Sequence[str] = (), units: Sequence[Mistake] = ()) -> list[Suspicion]:
    """Columns whose scales are off: the one that explains most first, the relations that it explains folded under it.

    Args:
        without: columns that are in doubt already; units: mistakes of one size that explain a scale better than chance.
    """
    found = [at for at in agreements(m) if not set(at.powers) & set(without)]
    doubts = []
    for _ in range(MOST):
        wrong = [at for at in found if at.conflicts()]
        if not wrong:
            break
        fixes = list(_fixes(found, wrong, units))
        if not fixes:
            worst = max(wrong, key=lambda at: abs(math.log(at.gain.middle)))
            doubts.append(Suspicion(f"{_said(worst)}: check the scales of {', '.join(worst.powers)}", None, None,
                                    _said(worst)))  # fmt: skip
            found.remove(worst)
            continue
        best = max(score for score, *_ in fixes)
        rivals = sorted((fix for fix in fixes if fix[0] == best), key=lambda fix: fix[3] is None)  # a unit first
        _, columns, factor, unit = rivals[0]
        explained = [at for at in wrong if at.power(columns) and not at.conflicts(columns, factor)]
        doubts += _doubts(columns, factor, explained, [fix[1:3] for fix in rivals[1:]], unit)
        found = [dataclasses.replace(at, gain=at.gain.over(factor ** at.power(columns))) for at in found]
        found = [at for at in found if not at.conflicts() or at not in explained]
    return doubts


def _fixes(
    found: Sequence[Compared], wrong: Sequence[Compared], units: Sequence[Mistake]
) -> Iterator[tuple[int, tuple[str, ...], float, Mistake | None]]:
    """Columns with the factor that they are too large by, and the unit that has it: how many relations agree more once
    it is taken out. A unit that both columns have is as simple as one column's scale."""
    for columns in CANDIDATES:
        touched = [at for at in wrong if at.power(columns)]
        if not touched or not all(any(column in at.powers for at in found) for column in columns):
            continue
        tight = min(touched, key=lambda at: math.log(at.gain.high / max(at.gain.low, 1e-6)))
        factor = tight.gain.middle ** (1.0 / tight.power(columns))
        after = sum(at.conflicts(columns, factor) for at in found)
        named = [one for one in units if one.columns == columns
                 and sum(at.conflicts(columns, one.low) for at in found) <= after]  # fmt: skip
        unit = min(named, key=lambda one: abs(math.log(one.low / factor)), default=None)
        gained = len(wrong) - after
        if gained > 0:
            apart = 0 if unit is not None else len(columns) - 1
            yield 2 * gained - apart, columns, factor if unit is None else unit.low, unit


def _said(at: Compared) -> str:
    return f"{at.says} is {at.gain.middle:.3g} ({at.gain.low:.3g} to {at.gain.high:.3g})"


def _doubts(
    columns: tuple[str, ...], factor: float, explained: Sequence[Compared],
    rivals: Sequence[tuple[tuple[str, ...], float]], unit: Mistake | None,
) -> list[Suspicion]:  # fmt: skip
    evidence = "; ".join(_said(at) for at in explained)
    names = " and ".join(NAMES.get(column, f"column {column}") for column in columns)
    size = f"{100.0 * abs(factor - 1.0):.2g} % too {'large' if factor > 1.0 else 'small'}"
    verb = "read" if len(columns) > 1 else "reads"
    others = [f"{' and '.join(NAMES.get(c, c) for c in other)} {100.0 * abs(q - 1.0):.2g} % too "
              f"{'large' if q > 1.0 else 'small'}" for other, q in rivals]  # fmt: skip
    either = f"; or {', or '.join(others)}" if others else ""
    if unit is not None:
        return [Suspicion(f"column {column} looks like {unit.looks_like} ({evidence}){either}: {unit.remedy}", column,
                          factor, evidence) for column in columns]  # fmt: skip
    tilted = {"ax", "ay"} & set(columns)
    tilt = ", or let for the body's roll and pitch, which add gravity to it" if tilted else ""
    sentence = f"{names} {verb} {size} ({evidence}){either}: divide its scale by {factor:.3g} in the mapping{tilt}"
    return [Suspicion(sentence, column, factor, evidence) for column in columns[:1]]


def bias_doubts(m: Kinematics, without: Sequence[str] = ()) -> list[Suspicion]:
    """A yaw rate that is not zero where heading, or course, does not turn."""
    for column, read, expected, says in (
        ("psi", m.r, m.turning, "psi turns"),
        ("y", m.yawed, m.course, "the course of x, y turns"),
    ):
        found = None if {"r", column} & set(without) else mean(read - expected, m.block)
        if found is None:
            continue
        if not found.beyond(0.0, BIAS):
            return []
        sentence = (
            f"column r reads {found.middle:+.3g} rad/s ({found.low:.3g} to {found.high:.3g}) more than {says}: a bias "
            f"of the yaw-rate sensor; give it offset {-found.middle:.3g} in the mapping"
        )
        says = f"r less the rate of {column} is {found.middle:.3g} rad/s"
        return [Suspicion(sentence, "r", None, says, offset=-found.middle)]
    return []


def arm_doubts(m: Kinematics, wheelbase: float | None) -> list[Suspicion]:
    """A point of measurement away from the centre of gravity: by what wheels read in turns, and by accelerations."""
    least, widest = ARM * (wheelbase or LENGTH), UNSURE * (wheelbase or LENGTH)
    wheels, left, ahead = _arm_by_wheels(m), *_arm_by_accelerations(m)
    wheels = wheels if wheels is not None and 0.5 * _width(wheels) < widest else None
    where: list[tuple[int, Bounds, str]] = []
    if wheels is not None and wheels.beyond(0.0, least):
        # Accelerations that agree say it more closely.
        near = [at for at in (wheels, left[0]) if at is not None and wheels.low < at.middle < wheels.high]
        where.append((1, min(near, key=_width), "v less omega_r against r"))
    elif left[0] is not None and all(at is not None and at.beyond(0.0, least) for at in left) and _one_side(left):
        where.append((1, left[0], "ax and ay against the rates of v_x and v_y"))
    if all(at is not None and at.beyond(0.0, least) for at in ahead) and _one_side(ahead):
        closest = min((at for at in ahead if at is not None), key=_width)
        where.append((0, closest, "ax and ay against the rates of v_x and v_y"))
    if not where:
        return []
    point = [0.0, 0.0]
    parts = []
    for axis, at, says in where:
        point[axis] = round(at.middle, 2)
        side = (("ahead", "behind"), ("to the left", "to the right"))[axis][at.middle < 0.0]
        ends = sorted((abs(at.low), abs(at.high)))
        parts.append(f"{abs(at.middle):.2g} m ({ends[0]:.2g} to {ends[1]:.2g} m) {side} ({says})")
    across = "v less omega_r against r" in {says for *_, says in where}
    other = "; if omega_r is one wheel's, this alone says it: give the mean of both rear wheels instead" * across
    sentence = (
        f"speed is measured {' and '.join(parts)} of the centre of gravity: add measured_point: "
        f"[{point[0]:g}, {point[1]:g}] to what the mapping has{other}"
    )
    return [Suspicion(sentence, "v", None, "; ".join(says for _, _, says in where), point=(point[0], point[1]))]


def arm_found(m: Kinematics, wheelbase: float | None) -> tuple[Bounds | None, Bounds | None]:
    """How far ahead and to the left [m] of the centre of gravity the speed is measured, where the columns tell."""
    left, ahead = _arm_by_accelerations(m)
    several = ([at for at in found if at is not None] for found in (ahead, (_arm_by_wheels(m), *left)))
    closest = [min(found, key=_width, default=None) for found in several]
    known = [at if at is not None and 0.5 * _width(at) < UNSURE * (wheelbase or LENGTH) else None for at in closest]
    return known[0], known[1]


def undecided_arm(m: Kinematics, wheelbase: float | None) -> list[str]:
    """What cannot be known of the point where the speed is measured."""
    left, ahead = _arm_by_accelerations(m)
    known = [_closest(ahead), _closest((_arm_by_wheels(m), *left))]
    if max(known) < UNSURE * (wheelbase or LENGTH):
        return []
    sizes = [f"{way} it to {size:.2g} m" for way, size in zip(("along", "across"), known, strict=True) if size < FAR]
    but = f" (but {', '.join(sizes)})" if sizes else ""
    return [f"where on the car v is measured{but}"]


def _closest(found: Sequence[Bounds | None]) -> float:
    """Half the narrowest interval [m], endless where nothing tells it."""
    return min((0.5 * _width(at) for at in found if at is not None), default=math.inf)


def _width(at: Bounds) -> float:
    return at.high - at.low


def _one_side(found: Sequence[Bounds | None]) -> bool:
    return len({at.middle > 0.0 for at in found if at is not None}) == 1


def _arm_by_wheels(m: Kinematics) -> Bounds | None:
    """How far to the left [m] the speed is measured: it is slower in a left turn by the yaw rate times that.

    In addition to what turning to either side, the speed, and a driving force do to a wheel's slip.
    """
    forward = np.where(np.isfinite(m.forward), m.forward, m.v)
    rate = np.where(np.isfinite(m.along), m.along, m.gain)
    kept = (np.abs(np.nan_to_num(m.beta)) < STEADY) & (np.abs(m.turned) < WORKING) & np.isfinite(m.omega_r)
    kept &= 3.0 * np.abs(rate) < WORKING
    kept &= np.abs(m.omega_r / np.maximum(forward, 1e-6) - 1.0) < 4.0 * SLIPPED
    design = np.column_stack([-m.r, np.abs(m.r), np.ones(len(m.r)), forward, forward * rate])[kept]
    low, high = np.quantile(m.r[kept], [0.05, 0.95]) if kept.any() else (0.0, 0.0)
    if low >= 0.0 or high <= 0.0:
        return None  # what a turn to one side does to the slip looks alike
    found = coefficients(design, (forward - m.omega_r)[kept], m.block[kept])
    return None if found is None else found[0]


def _arm_by_accelerations(
    m: Kinematics,
) -> tuple[tuple[Bounds | None, Bounds | None], tuple[Bounds | None, Bounds | None]]:
    """How far to the left and ahead [m] of the accelerometer the velocity is measured, by ax and by ay each."""
    ones = np.ones(len(m.r))
    along = coefficients(np.column_stack([m.spin, m.circling, ones, m.along, m.lag(m.along)]), m.ax - m.along, m.block)
    across = coefficients(
        np.column_stack([m.circling, -m.spin, ones, m.across, m.lag(m.across)]), m.ay - m.across, m.block
    )
    by_ax: Sequence[Bounds | None] = along or [None, None]
    by_ay: Sequence[Bounds | None] = across or [None, None]
    return (by_ax[0], by_ay[0]), (by_ax[1], by_ay[1])
