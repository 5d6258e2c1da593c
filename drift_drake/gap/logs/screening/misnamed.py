"""Columns that are not what they are called: a magnitude without its sign, another's readings, no speed at all."""

from collections.abc import Mapping, Sequence

import numpy as np

from drift_drake.common.arrays import correlation
from drift_drake.gap.logs.screening.averaging import Columns
from drift_drake.gap.logs.screening.gains import gain, mean
from drift_drake.gap.logs.screening.kinematics import Kinematics
from drift_drake.gap.logs.screening.suspicions import Suspicion

FEWEST = 12  # windows
LARGE, BOTH_SIDES = 0.25, 0.05  # of the largest, that so many of the windows go beyond to either side
BELOW = 0.03  # of a magnitude's size that noise takes it below zero
SURELY, ABOUT = 0.9, 2.0  # correlation of two columns that are each other, and the factor that they agree within
HALF = 0.5  # of the size that a magnitude has at the other sign
LIKE = 0.8  # correlation from which a column follows another
UNLIKE = 0.5  # below which it does not
NEARLY_ZERO, FASTEST = 0.5, 150.0  # [m/s] of a car that hardly moves, and of none
SLOWER = 5.0  # times slower than the motion asks for
APART = 0.03  # of a speed by which two of them have to differ to be distinguished
NEARER = 3.0  # times nearer to what the positions or the accelerations say
STEADY = 0.15  # [rad] of sideslip up to which a car goes where it steers
SMALLEST = 1e-9


def magnitudes(runs: Sequence[Columns], m: Kinematics) -> list[Suspicion]:
    """Columns that are never negative though others say that the car turns, slides or speeds up both ways."""
    swing = np.where(np.isfinite(m.swing), m.swing, 0.0)
    steered = np.where(np.abs(np.nan_to_num(m.beta)) < STEADY, m.delta_cmd * m.v, np.nan)  # a drift steers against r
    witnesses = {
        "r": (m.r, [(m.turning, "psi turns"), (m.course - swing, "the course of x, y turns"), (m.ay, "ay points"),
                    (steered, "delta_cmd points")]),
        "ay": (m.ay, [(m.turned, "r turns"), (m.v * m.turning, "psi turns")]),
        "delta_cmd": (m.delta_cmd * m.v, [(m.r, "r turns"), (m.turning, "psi turns")]),
        "beta": (m.beta, [(m.slid, "the course of x, y leaves psi"), (m.turned, "r turns")]),
        "ax": (m.ax, [(m.gain, "v changes")]),
    }  # fmt: skip
    found = []
    for name, (own, others) in witnesses.items():
        side = _only_side(runs, name)
        if side == 0:
            continue
        for other, words in others:
            if _both_sides(other) and _like(np.abs(own), np.abs(other)) > LIKE and _as_large(own, other):
                found.append(Suspicion(
                    f"column {name} is never {'negative' if side > 0 else 'positive'} though {words} to both sides: it "
                    "is a magnitude, and its sign stands in another column; multiply the two in 'formulas' "
                    f"({name}: magnitude * direction)", name, None, f"{words} to both sides"))  # fmt: skip
                break
    return found


def _as_large(own: np.ndarray, other: np.ndarray) -> bool:
    """Whether a column without a sign is as large where the other one is far below zero as where it is far above: noise
    and a bias of the other one are no turns."""
    known = np.isfinite(own) & np.isfinite(other)
    own, other = own[known], other[known]
    far = np.abs(other) > LARGE * float(np.quantile(np.abs(other), 0.95))
    sides = (far & (other > 0.0), far & (other < 0.0))
    sizes = [abs(float(np.sum(own[rows]))) / float(np.sum(np.abs(other[rows]))) for rows in sides if rows.any()]
    return len(sizes) == 2 and min(sizes) > HALF * max(sizes)


def _only_side(runs: Sequence[Columns], name: str) -> int:
    """The sign of a column that has one, zero of one that has both or is not there."""
    parts = [np.asarray(values) for columns in runs if (values := columns.get(name)) is not None]
    if not parts:
        return 0
    low, high = np.quantile(np.concatenate(parts), [0.002, 0.998])
    if high > 0.0 and -low < BELOW * high:
        return 1
    return -1 if low < 0.0 and high < BELOW * -low else 0


def _both_sides(values: np.ndarray) -> bool:
    values = values[np.isfinite(values)]
    if len(values) < FEWEST:
        return False
    top = float(np.quantile(np.abs(values), 0.95))
    return top > 0.0 and min(float(np.mean(sign * values > LARGE * top)) for sign in (1.0, -1.0)) > BOTH_SIDES


def _like(a: np.ndarray, b: np.ndarray) -> float:
    """Correlation of two signals [windows], zero where one does not vary or is not there."""
    known = np.isfinite(a) & np.isfinite(b)
    return correlation(a[known], b[known]) if np.count_nonzero(known) >= FEWEST else 0.0


def swapped_accelerations(m: Kinematics) -> list[Suspicion]:
    """Accelerations of which one follows what the other should: swapped, or of a sensor that is turned by 90 deg."""
    along = np.where(np.isfinite(m.along), m.along, m.gain)
    across = np.where(np.isfinite(m.across), m.across, m.turned)
    right = max(abs(_like(m.ax, along)), abs(_like(m.ay, across)))
    crossed = {"ax": _like(m.ax, across), "ay": _like(m.ay, along)}
    strong = {name: q for name, q in crossed.items() if abs(q) > LIKE}
    if right > UNLIKE or not strong:
        return []
    # The other one may be too small to tell, or not be there: it may not speak against it.
    words = {"ax": "v r, the lateral acceleration", "ay": "the rate of v, the longitudinal one"}
    said = " and ".join(f"{name} follows {words[name]} (correlation {q:.2f})" for name, q in strong.items())
    signs = " and their signs" if any(q < 0.0 for q in strong.values()) else ""
    return [Suspicion(f"columns ax and ay look swapped: {said}; exchange the two{signs} in the mapping", "ax", None,
                      said)]  # fmt: skip


def swapped_headings(m: Kinematics) -> list[Suspicion]:
    """A heading and a yaw rate that are each other: what is called the yaw rate turns by what is called the heading."""
    kept = np.abs(m.spin) < ABOUT * np.max(np.abs(m.psi), initial=0.0)  # not where a heading jumps by a full turn
    spin, psi = m.spin[kept], m.psi[kept]
    crossed = _like(spin, psi)
    if crossed < SURELY or _like(m.r, m.turning) > UNLIKE or not 1.0 / ABOUT < np.std(spin) / np.std(psi) < ABOUT:
        return []
    said = f"the rate of r follows psi (correlation {crossed:.2f})"
    return [Suspicion(f"columns r and psi look swapped: {said}; exchange the two in the mapping", "r", None, said)]


def swapped_speeds(m: Kinematics) -> list[Suspicion]:
    """A speed and a rim's speed that are each other: where a wheel slips, the positions or accelerations say which."""
    off, where, unit = _apart(m)
    if not _nearer(off, "omega_r", "v"):
        return []
    said = f"{where[1]} lies {off['omega_r']:.2g} {unit} from {where[0]}, {where[2]} {off['v']:.2g} {unit}"
    return [Suspicion(f"columns v and omega_r look swapped: {said}; exchange the two in the mapping", "v", None, said)]


def undecided_speeds(m: Kinematics) -> list[str]:
    """What cannot be known of a speed and a rim's speed that are too much alike."""
    known = np.isfinite(m.omega_r) & (m.v > 0.0)
    off, _, _ = _apart(m)
    if np.count_nonzero(known) < FEWEST or _nearer(off, "v", "omega_r") or _nearer(off, "omega_r", "v"):
        return []
    slipped = float(np.quantile(np.abs(m.omega_r[known] / m.v[known] - 1.0), 0.95))
    return [f"whether v and omega_r are exchanged (they differ by {100.0 * slipped:.2g} % at most)"]


def _nearer(off: Mapping[str, float], one: str, other: str) -> bool:
    """Whether one of the two speeds is certainly the car's."""
    return bool(off) and off["slipped"] > APART and off[other] > NEARER * off[one]


def _apart(m: Kinematics) -> tuple[dict[str, float], tuple[str, str, str], str]:
    """How far `v` and `omega_r` are off what the positions, else `ax`, say, and from each other (`slipped`, a share).

    Empty where neither says anything; words for what is compared, and the unit.
    """
    known = np.isfinite(m.omega_r) & np.isfinite(m.moved) & (m.moved > 0.0)
    if np.count_nonzero(known) >= FEWEST:
        off = {name: _slips(values, m.moved, m, known) for name, values in (("v", m.v), ("omega_r", m.omega_r))}
        slipped = max(off.values())
        return (
            {k: 100.0 * q for k, q in off.items()} | {"slipped": slipped},
            ("the speed along x, y", "omega_r", "v"),
            "%",
        )
    words = ("ax", "the rate of omega_r", "that of v")
    known = np.isfinite(m.omega_r) & np.isfinite(m.ax) & np.isfinite(m.rim_gain)
    if np.count_nonzero(known) < FEWEST:
        return {}, words, "m/s^2"
    slipped = _slips(m.v, m.omega_r, m, known)
    straight = np.abs(m.turned[known] * np.sin(np.nan_to_num(m.beta[known]))) < 1.0
    off = {name: _left(m.ax[known][straight], rate[known][straight])
           for name, rate in (("v", m.gain), ("omega_r", m.rim_gain))}  # fmt: skip
    return off | {"slipped": slipped}, words, "m/s^2"


def _slips(speed: np.ndarray, of: np.ndarray, m: Kinematics, known: np.ndarray) -> float:
    """How far a speed that may be a rim's moves from another one, as a share, over the windows that are known.

    A scale that is off moves all alike, noise is averaged over blocks, and a reading that comes late is too low while
    the car speeds up: a driven wheel is not.
    """
    off = np.log(np.maximum(speed[known], SMALLEST) / np.maximum(of[known], SMALLEST))
    gains = m.gain[known] / np.maximum(m.v[known], SMALLEST)
    gains = gains - np.mean(gains)
    slope = float(gains @ off) / max(float(gains @ gains), SMALLEST)
    label = np.unique(m.block[known], return_inverse=True)[1]
    return float(np.std(np.bincount(label, weights=off - min(slope, 0.0) * gains) / np.bincount(label)))


def _left(values: np.ndarray, of: np.ndarray) -> float:
    """Standard deviation [windows] of what one signal leaves of another."""
    return float(np.std(values - of)) if len(values) >= FEWEST else 0.0


def no_speed(m_all: Kinematics) -> list[Suspicion]:
    """A speed that is nearly zero for a car that turns or moves: another column was taken.

    Args:
        m_all: windows of any speed.
    """
    if not len(m_all.v) or np.median(np.abs(m_all.v)) > NEARLY_ZERO:
        return []
    # A car may stand for most of a log: v is compared where the other columns say that it moves.
    turning = np.abs(m_all.r) >= np.sqrt(np.mean(m_all.r**2))
    asked = [(gain(m_all.ay, m_all.r, m_all.spin[:, None], m_all.block), turning, "ay over r")]
    for values, words in ((m_all.moved, "x, y"), (m_all.omega_r, "omega_r")):
        moving = np.abs(values) > NEARLY_ZERO  # not where it is unknown
        asked.append((mean(values[moving], m_all.block[moving]) if moving.any() else None, moving, words))
    for found, where, words in asked:
        if found is None:
            continue
        usual = float(np.median(np.abs(m_all.v[where])))
        if max(SLOWER * usual, NEARLY_ZERO) < found.low and found.high < FASTEST:
            sentence = (
                f"column v reads {usual:.2g} m/s though {words} ask for {found.middle:.2g} m/s: it is no speed of the "
                "car; map the column that is"
            )
            return [Suspicion(sentence, "v", None, f"{words} ask for {found.middle:.2g} m/s")]
    return []
