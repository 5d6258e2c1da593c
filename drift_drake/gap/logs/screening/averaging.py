"""Averages and changes of columns over short windows: noise and sensors' lags matter little to them."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Self

import numpy as np

Columns = Mapping[str, np.ndarray | None]  # of the log format [rows]
WINDOW = 0.6  # [s]
PART = 0.08  # [s] at either end over which readings are averaged, and over which a course is taken
HALF_TURN_DEGREES = 180.0


@dataclasses.dataclass(frozen=True)
class Averaging:
    """Windows over rows of a run, each half over the one before: first rows `starts` [windows], of `width` rows."""

    starts: np.ndarray
    width: int
    part: int
    period: float

    @property
    def length(self) -> float:
        """Of a window [s]."""
        return self.width * self.period

    def change(self, values: np.ndarray) -> np.ndarray:
        """From the mean of a window's first rows to that of its last, per second [windows], of values [rows]."""
        sums = np.concatenate([[0.0], np.cumsum(values)])
        first = (sums[self.starts + self.part] - sums[self.starts]) / self.part
        last = (sums[self.starts + self.width] - sums[self.starts + self.width - self.part]) / self.part
        return np.asarray((last - first) / (self.length - self.part * self.period))

    def mean(self, values: np.ndarray) -> np.ndarray:
        """Weighted as the change of its integral is [windows], of values [rows]."""
        return self.change((np.cumsum(values) - 0.5 * values) * self.period)


class PerWindow:
    """For dataclasses whose fields are arrays with a value for each window."""

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Self:
        """The windows of all parts, one after another."""
        return cls(*(np.concatenate(values) for values in zip(*(part._arrays() for part in parts), strict=True)))

    def where(self, kept: np.ndarray) -> Self:
        """The windows [windows] (bool) that are kept."""
        return type(self)(*(values[kept] for values in self._arrays()))

    def _arrays(self) -> list[np.ndarray]:
        return [getattr(self, field.name) for field in dataclasses.fields(self)]  # type: ignore[arg-type]


@dataclasses.dataclass(frozen=True)
class Averages(PerWindow):
    """Of columns, windows [windows]; NaN where a column is missing.

    run: index of the run; r, v, omega_r, ax, ay, delta_cmd: means. turning, swing, gain, rim_gain: rates of `psi`,
    `beta`, `v` and `omega_r` per second of the log's clock.
    """

    run: np.ndarray
    r: np.ndarray
    v: np.ndarray
    omega_r: np.ndarray
    ax: np.ndarray
    ay: np.ndarray
    delta_cmd: np.ndarray
    turning: np.ndarray
    swing: np.ndarray
    gain: np.ndarray
    rim_gain: np.ndarray


def averages(columns: Columns, over: Averaging, index: int) -> dict[str, np.ndarray]:
    """The fields of `Averages`, of columns of the log format [rows] of the run of that index."""
    found = {name: over.mean(column(columns, name)) for name in ("r", "v", "omega_r", "ax", "ay", "delta_cmd")}
    angles = {"turning": "psi", "swing": "beta"}
    found |= {rate: over.change(continuous(column(columns, name))) for rate, name in angles.items()}
    found |= {rate: over.change(column(columns, name)) for rate, name in {"gain": "v", "rim_gain": "omega_r"}.items()}
    return found | {"run": np.full(len(over.starts), index)}


def column(columns: Columns, name: str) -> np.ndarray:
    """A column [rows]; NaN where it is missing."""
    values = columns.get(name)
    return np.full(len(np.asarray(columns["v"])), np.nan) if values is None else np.asarray(values, dtype=float)


def continuous(angle: np.ndarray) -> np.ndarray:
    """An angle [n] without the jumps of wrapping, by a full turn in radians or in degrees."""
    reach = float(np.max(np.abs(angle)))
    if not np.isfinite(reach):
        return angle
    # Within a turn of radians the numbers may be either: degrees of a car that hardly turned are continuous anyhow.
    turn = 2.0 * np.pi if reach <= 2.2 * np.pi or np.max(np.abs(np.diff(angle))) < HALF_TURN_DEGREES else 360.0
    return np.unwrap(angle, period=turn)


def averaging(rows: int, period: float) -> Averaging:
    """The windows of a run of so many rows, a row each period [s]."""
    width, part = max(round(WINDOW / period), 8), max(round(PART / period), 2)
    return Averaging(np.arange(0, rows - width, width // 2), width, part, period)
