"""Relations among a log's columns that hold for any car, and how well they hold: each one ratio that should be one.

A ratio is far from one where a column is in another unit, mirrored, or on another clock; what an effect of the
catalogue can do to it is its tolerance.
"""

import dataclasses
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from drift_drake.car.effects.record import wheelbase
from drift_drake.car.parameters import VehicleParameters
from drift_drake.common.arrays import correlation
from drift_drake.gap.logs.screening.averaging import Averages, Columns, averages, averaging, column

MOVING = 0.15  # of a run's high speeds, below which headings and ratios of speeds mean nothing
# What a column's factor scales; positions and the clock scale rates alone.
FIELDS = {
    "r": ("r",), "psi": ("turning",), "y": ("course",), "v": ("v", "gain"), "beta": ("beta", "swing"), "ax": ("ax",),
    "omega_r": ("omega_r", "rim_gain"), "ay": ("ay",), "delta_cmd": ("delta_cmd",), "tau_cmd": ("tau_cmd",),
}  # fmt: skip
RATES = ("turning", "course", "moved", "gain", "swing", "rim_gain")
FEWEST = 12  # windows
MOST = 400  # windows that slopes are taken over: their cost grows with the square
GRIP = 0.15  # [rad] of sideslip up to which a car goes where it steers and its wheels roll
CALM = 0.4  # of the windows, those with least lateral acceleration
GENTLE = 3.0  # [m/s^2] of v r below which a car whose sideslip is not logged hardly slides
SMALLEST = 1e-9  # spread of a column that says something
SWINGING = 0.7  # of the heading's rate, below which that of the course is a swinging car's
WITNESS = 3.0  # tolerances within which a relation can be a witness for others


@dataclasses.dataclass(frozen=True)
class Windows(Averages):
    """Means and changes over windows [windows], in the columns' units, changes per second of the log's clock.

    course: rate of the direction of travel; moved: speed along the positions; beta, tau_cmd: means.
    """

    course: np.ndarray
    moved: np.ndarray
    beta: np.ndarray
    tau_cmd: np.ndarray

    def corrected(self, column: str, factor: float) -> "Windows":
        """As if the column (`t`: the clock) had not been too large by the factor."""
        fields, scale = (RATES, factor) if column == "t" else (FIELDS[column], 1.0 / factor)
        return dataclasses.replace(self, **{name: scale * getattr(self, name) for name in fields})


def windows_of(runs: Sequence[Columns], periods: Sequence[float]) -> Windows:
    """Windows through the columns of all runs, each half over the one before, without those in which the car hardly
    moves; they may lack all but `v`; periods: between rows [s].

    What is differentiated is so over a window, a rate is averaged over it: noise and sensors' lags then matter little.
    """
    return Windows.joined([_of_run(columns, period, index)
                           for index, (columns, period) in enumerate(zip(runs, periods, strict=True))])  # fmt: skip


def _of_run(columns: Columns, period: float, index: int) -> Windows:
    over = averaging(len(np.asarray(columns["v"])), period)
    starts, width, part = over.starts, over.width, over.part
    x, y, v = (column(columns, name) for name in ("x", "y", "v"))
    ends = [starts, starts + part, starts + width - part, starts + width]
    first_course = np.arctan2(y[ends[1]] - y[ends[0]], x[ends[1]] - x[ends[0]])
    last_course = np.arctan2(y[ends[3]] - y[ends[2]], x[ends[3]] - x[ends[2]])
    turned = np.angle(np.exp(1j * (last_course - first_course)))
    at = starts[:, None] + np.append(np.arange(0, width, part), width)
    path = np.sum(np.hypot(np.diff(x[at]), np.diff(y[at])), axis=1)
    found = Windows(
        **averages(columns, over, index), course=turned / (over.length - part * period), moved=path / over.length,
        beta=over.mean(column(columns, "beta")), tau_cmd=over.mean(column(columns, "tau_cmd")),
    )  # fmt: skip
    return found.where(found.v > MOVING * float(np.quantile(v, 0.9)))


@dataclasses.dataclass(frozen=True)
class Kind:
    """A ratio of columns that should be one, measured over expected in the windows that count.

    powers: with which a factor on a column (`t`: the clock) enters the ratio; mirrors: columns whose signs it holds
    against each other; tolerance: standard deviation of log(size) among cars of the catalogue's effects, with noise;
    least_likeness: rank correlation from which the slope is believed, None of speeds, whose ratio is taken; witness:
    the relation that has to hold first.
    """

    powers: Mapping[str, int]
    mirrors: tuple[str, ...]
    tolerance: float
    least_likeness: float | None
    says: str  # the ratio in words
    columns: Callable[[Windows, VehicleParameters], tuple[np.ndarray, np.ndarray]]
    witness: str | None = None


@dataclasses.dataclass(frozen=True)
class Relation:
    """One ratio as found: `size` and `sign` are one and positive where all is well; likeness: its rank correlation;
    tight: the regressions of either column on the other are this factor and its inverse from it; windows: number."""

    name: str
    kind: Kind
    size: float
    sign: float
    likeness: float
    tight: float
    windows: int

    @property
    def off(self) -> float:
        """How far from one, in tolerances."""
        return float(np.log(self.size)) / self.kind.tolerance

    @property
    def surely_off(self) -> float:
        """The same in standard deviations, always positive, of the tolerance and of a slope of few windows (every other
        one tells anew), from the nearer of both regressions, between which the slope is whatever the noise of either
        column (Frisch)."""
        error = np.sqrt((1.0 - self.likeness**2) / max(0.5 * self.windows - 2.0, 1.0)) / self.likeness
        apart = abs(float(np.log(self.size))) + float(np.log(self.tight))
        return max(apart, 0.0) / float(np.hypot(self.kind.tolerance, error))

    @property
    def holds(self) -> bool:
        """Whether it can be a witness for others."""
        return self.sign > 0.0 and abs(self.off) < WITNESS


def _grip(w: Windows) -> np.ndarray:
    """Windows without much sideslip; where none is logged, those of little lateral acceleration."""
    unseen = np.isnan(w.beta)
    return np.where(unseen, np.abs(w.v * w.r) < GENTLE, np.abs(w.beta) < GRIP)


def _straight(w: Windows) -> np.ndarray:
    """Windows in which the car goes more or less straight, so that body and course have one direction."""
    across = np.abs(w.v * w.r)
    rows: np.ndarray = across <= np.quantile(across, CALM) if len(across) else across > 0.0
    return rows & _grip(w)


def _steer(w: Windows, p: VehicleParameters) -> tuple[np.ndarray, np.ndarray]:
    grip = _grip(w)
    return w.delta_cmd[grip], (wheelbase(p) * w.r / w.v)[grip]


def _drive(w: Windows, p: VehicleParameters) -> tuple[np.ndarray, np.ndarray]:
    """Force at the rim that the torque makes, and the one that mass and axle take up."""
    kept = _straight(w)
    spun_up = p.rear_axle_inertia / p.wheel_radius**2 * np.nan_to_num(w.rim_gain)
    return (p.gear_ratio / p.wheel_radius * w.tau_cmd)[kept], (p.mass * w.gain + spun_up)[kept]


KINDS = {
    "turn": Kind({"r": 1, "psi": -1, "t": 1}, ("r", "psi"), 0.05, 0.8, "r over the rate of psi",
                 lambda w, _: (w.r, w.turning)),
    "course": Kind({"psi": -1}, ("y", "psi"), 0.15, 0.8, "the rate of the course of x, y over that of psi",
                   lambda w, _: (w.course, w.turning)),
    "across": Kind({"ay": 1, "v": -1, "r": -1}, ("ay", "r"), 0.2, 0.75, "ay over v r",
                   lambda w, _: (w.ay, w.v * w.r)),
    "along": Kind({"ax": 1, "v": -1, "t": 1}, ("ax",), 0.13, 0.8, "ax over the rate of v",
                  lambda w, _: (w.ax[_straight(w)], w.gain[_straight(w)])),
    "steer": Kind({"delta_cmd": 1, "r": -1, "v": 1}, ("delta_cmd", "r"), 0.4, 0.75,
                  "delta_cmd over r (a + b) / v", _steer),
    "drive": Kind({"tau_cmd": 1, "v": -1, "t": 1}, ("tau_cmd",), 0.25, 0.6,
                  "gear_ratio tau_cmd / wheel_radius over mass times the rate of v", _drive),
    "path": Kind({"v": 1, "t": 1}, (), 0.05, None, "v over the speed along x, y", lambda w, _: (w.v, w.moved)),
    "rim": Kind({"omega_r": 1, "v": -1}, (), 0.08, None, "omega_r over v",
                lambda w, _: (np.abs(w.omega_r)[_grip(w)], w.v[_grip(w)])),
    "slide": Kind({"beta": 1, "t": -1}, ("beta", "r"), 0.15, 0.6, "the rate of beta over ay / v - r",
                  lambda w, _: (w.swing, w.ay / w.v - w.r), "across"),
    "slide by course": Kind({"beta": 1}, ("beta", "psi"), 0.35, 0.7, "the rate of beta over that of course less psi",
                            lambda w, _: (w.swing, w.course - w.turning), "course"),
}  # fmt: skip


def relations(windows: Windows, vehicle: VehicleParameters, kinds: Mapping[str, Kind] = KINDS) -> list[Relation]:
    """The relations that the columns allow, those left out that are too unlike to say."""
    found: dict[str, Relation] = {}
    for name, kind in kinds.items():
        if kind.witness is not None and not (kind.witness in found and found[kind.witness].holds):
            continue
        measured, expected = kind.columns(windows, vehicle)
        known = np.isfinite(measured) & np.isfinite(expected)
        measured, expected = measured[known], expected[known]
        if len(measured) < FEWEST:
            continue
        least = kind.least_likeness
        at = _ratio(measured, expected) if least is None else _slope(measured, expected, least)
        if at is not None:
            found[name] = Relation(name, kind, *at, len(measured))
    if _swings(found):
        found.pop("across", None)
    return list(found.values())


def _swings(found: Mapping[str, Relation]) -> bool:
    """Whether the car turns about its course rather than along it, its yaw rate and its heading in agreement: the
    lateral acceleration is then not that of a turn."""
    turn, course = found.get("turn"), found.get("course")
    return turn is not None and turn.holds and course is not None and course.sign > 0.0 and course.size < SWINGING


def _slope(measured: np.ndarray, expected: np.ndarray, least: float) -> tuple[float, float, float, float] | None:
    """Size, sign, likeness (not below `least`) and tightness of the robust slope between two columns, of which neither
    is exact: the geometric mean of both ways (Theil-Sen)."""
    if len(measured) > MOST:
        chosen = np.linspace(0, len(measured) - 1, MOST).astype(int)
        measured, expected = measured[chosen], expected[chosen]
    if min(np.ptp(measured), np.ptp(expected)) < SMALLEST:
        return None
    likeness = correlation(_ranks(measured), _ranks(expected))
    if abs(likeness) < least:
        return None
    there, back = _theil_sen(measured, expected), _theil_sen(expected, measured)
    if there * back <= 0.0:
        return None
    return float(np.sqrt(there / back)), float(np.sign(there)), abs(likeness), min(float(np.sqrt(there * back)), 1.0)


# As `spearmanr` and `theilslopes` of scipy.stats have them, which takes half a second to import.


def _ranks(values: np.ndarray) -> np.ndarray:
    """Of values [n], from 1; the mean of theirs for equal ones."""
    _, place, counts = np.unique(values, return_inverse=True, return_counts=True)
    return np.asarray((np.cumsum(counts) - 0.5 * (counts - 1))[place])


def _theil_sen(values: np.ndarray, of: np.ndarray) -> float:
    """The median of the slopes of all pairs [n]."""
    first, second = np.triu_indices(len(of), 1)
    step = of[second] - of[first]
    apart = step != 0.0
    return float(np.median((values[second] - values[first])[apart] / step[apart]))


def _ratio(measured: np.ndarray, expected: np.ndarray) -> tuple[float, float, float, float] | None:
    """The same of two speeds: of what most windows show the tenth that is nearest to one, as a wheel may slip."""
    if np.min(expected) <= 0.0 or np.min(measured) <= 0.0:
        return None
    low, middle, high = np.quantile(np.log(measured / expected), [0.1, 0.5, 0.9])
    return float(np.exp(max(low, 0.0) if middle > 0.0 else min(high, 0.0))), 1.0, 1.0, 1.0
