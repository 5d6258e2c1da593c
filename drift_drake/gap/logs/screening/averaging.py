"""Averages and changes of columns over short windows: noise and sensors' lags matter little to them."""

import dataclasses
from collections.abc import Sequence
from typing import Self

import numpy as np

WINDOW = 0.6  # [s]
PART = 0.08  # [s] at either end over which readings are averaged, and over which a course is taken


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


def averaging(rows: int, period: float) -> Averaging:
    """The windows of a run of so many rows, a row each period [s]."""
    width, part = max(round(WINDOW / period), 8), max(round(PART / period), 2)
    return Averaging(np.arange(0, rows - width, width // 2), width, part, period)
