"""What each column of a log says of the car's motion over short windows, so that columns can be held against another.

Whatever is differentiated (positions, headings, speeds) is so over a window, whatever is a rate is averaged over it:
noise and sensors' lags then matter little.
"""

import dataclasses
import itertools
from collections.abc import Mapping, Sequence

import numpy as np

from drift_drake.logs.table import Run

WINDOW = 0.6  # [s]
PART = 0.08  # [s] at either end over which readings are averaged, and over which a course is taken
MOVING = 0.15  # of a run's high speeds, below which headings and ratios of speeds mean nothing
HALF_TURN_DEGREES = 180.0
# What a column's factor scales; positions and the clock scale rates alone.
FIELDS = {
    "r": ("r",), "psi": ("turning",), "y": ("course",), "v": ("v", "gain"), "beta": ("beta", "swing"), "ax": ("ax",),
    "omega_r": ("omega_r", "rim_gain"), "ay": ("ay",), "delta_cmd": ("delta_cmd",), "tau_cmd": ("tau_cmd",),
}  # fmt: skip
RATES = ("turning", "course", "moved", "gain", "swing", "rim_gain")


@dataclasses.dataclass(frozen=True)
class Windows:
    """Means and changes over windows [windows], in the columns' units, changes per second of the log's clock.

    Columns that a run lacks are NaN. turning: rate of the heading `psi`; course: rate of the direction of travel;
    moved: speed along the positions; swing: rate of `beta`; gain, rim_gain: rates of `v` and `omega_r`. The others are
    means.
    """

    run: np.ndarray  # index of the run
    r: np.ndarray
    turning: np.ndarray
    course: np.ndarray
    moved: np.ndarray
    v: np.ndarray
    gain: np.ndarray
    beta: np.ndarray
    swing: np.ndarray
    omega_r: np.ndarray
    rim_gain: np.ndarray
    ax: np.ndarray
    ay: np.ndarray
    delta_cmd: np.ndarray
    tau_cmd: np.ndarray

    def where(self, kept: np.ndarray) -> "Windows":
        """The windows [windows] (bool) that are kept."""
        return Windows(*(getattr(self, field.name)[kept] for field in dataclasses.fields(self)))

    def corrected(self, column: str, factor: float) -> "Windows":
        """As if the column (`t`: the clock) had not been too large by the factor."""
        fields, scale = (RATES, factor) if column == "t" else (FIELDS[column], 1.0 / factor)
        return dataclasses.replace(self, **{name: scale * getattr(self, name) for name in fields})


def windows_of(runs: Sequence[Run]) -> Windows:
    """Windows through all runs, each half over the one before, without those in which the car hardly moves."""
    columns = ("x", "y", "psi", "r", "v", "beta", "omega_r", "ax", "ay", "delta_cmd", "tau_cmd")
    parts = [
        windows_of_columns({name: run.column(name) for name in columns}, run.period, index)
        for index, run in enumerate(runs)
    ]
    names = [field.name for field in dataclasses.fields(Windows)]
    return Windows(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))


def windows_of_columns(columns: Mapping[str, np.ndarray | None], period: float, index: int = 0) -> Windows:
    """Windows through columns of the log format [rows], which may lack all but `v`, of the run of that index."""
    rows = len(np.asarray(columns["v"]))
    width, part = max(round(WINDOW / period), 8), max(round(PART / period), 2)
    starts = np.arange(0, rows - width, width // 2)
    length = width * period

    def column(name: str) -> np.ndarray:
        values = columns.get(name)
        return np.full(rows, np.nan) if values is None else np.asarray(values, dtype=float)

    def change(values: np.ndarray) -> np.ndarray:
        """From the mean of the first rows to that of the last, per second."""
        sums = np.concatenate([[0.0], np.cumsum(values)])
        first = (sums[starts + part] - sums[starts]) / part
        last = (sums[starts + width] - sums[starts + width - part]) / part
        return (last - first) / (length - part * period)

    def mean(values: np.ndarray) -> np.ndarray:
        """Weighted as the change of its integral is."""
        return change(np.cumsum(values) * period)

    x, y, v = column("x"), column("y"), column("v")
    ends = [starts, starts + part, starts + width - part, starts + width]
    first_course = np.arctan2(y[ends[1]] - y[ends[0]], x[ends[1]] - x[ends[0]])
    last_course = np.arctan2(y[ends[3]] - y[ends[2]], x[ends[3]] - x[ends[2]])
    turned = np.angle(np.exp(1j * (last_course - first_course)))
    steps = [np.append(np.arange(start, start + width, part), start + width) for start in starts]
    path = [sum(np.hypot(x[b] - x[a], y[b] - y[a]) for a, b in itertools.pairwise(rows)) for rows in steps]
    speed = mean(v)
    found = Windows(
        run=np.full(len(starts), index),
        r=mean(column("r")),
        turning=change(_continuous(column("psi"))),
        course=turned / (length - part * period),
        moved=np.array(path, dtype=float) / length,
        v=speed,
        gain=change(v),
        beta=mean(column("beta")),
        swing=change(_continuous(column("beta"))),
        omega_r=mean(column("omega_r")),
        rim_gain=change(column("omega_r")),
        ax=mean(column("ax")),
        ay=mean(column("ay")),
        delta_cmd=mean(column("delta_cmd")),
        tau_cmd=mean(column("tau_cmd")),
    )
    return found.where(speed > MOVING * float(np.quantile(v, 0.9)))


def _continuous(angle: np.ndarray) -> np.ndarray:
    """An angle [n] without the jumps of wrapping, by a full turn in radians or in degrees."""
    reach = float(np.max(np.abs(angle)))
    if not np.isfinite(reach):
        return angle
    # Within a turn of radians the numbers may be either: degrees of a car that hardly turned are continuous anyhow.
    turn = 2.0 * np.pi if reach <= 2.2 * np.pi or np.max(np.abs(np.diff(angle))) < HALF_TURN_DEGREES else 360.0
    return np.unwrap(angle, period=turn)
