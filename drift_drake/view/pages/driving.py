"""How a car was driven, as pages show it: stretches that are used and not, accelerations, steering against speed."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from markupsafe import Markup
from scipy.ndimage import uniform_filter1d

from drift_drake.car.log.driving import UsedStretch
from drift_drake.car.log.table import Run
from drift_drake.view.pages.charts import Array, Figure, cloud, placed

EVENED = 0.3  # [s] of the speed, where its rate stands for an acceleration


class Driven(NamedTuple):
    """One run: its name, start and end [s], its stretches, and how it was driven.

    accelerations: to the left and ahead [m/s^2]; steering: speed [m/s] and command [rad]; each of equal length.
    """

    name: str
    start: float
    stop: float
    stretches: Sequence[UsedStretch]
    accelerations: tuple[Array, Array]
    steering: tuple[Array, Array]

    @property
    def length(self) -> float:
        """[s]"""
        return max(self.stop - self.start, 1e-9)

    def in_words(self) -> str:
        """Every stretch."""
        return "; ".join(part.in_words() for part in self.stretches)

    def sentence(self) -> str:
        """How much is used, and what is not by reason."""
        lost = dict[str, float]()
        for part in self.stretches:
            if part.why:
                lost[part.why] = lost.get(part.why, 0.0) + part.stop - part.start
        used = sum(part.stop - part.start for part in self.stretches if not part.why)
        why = "; ".join(f"{what} {seconds:.1f} s" for what, seconds in lost.items())
        return f"{used:.1f} of {self.length:.1f} s are used{f' ({why})' if why else ''}"


def driven(run: Run, stretches: Sequence[UsedStretch] = (), name: str = "") -> Driven:
    """What is drawn of a run; name: if it is not its own."""
    evened = uniform_filter1d(run.v, max(round(EVENED / run.period), 1), mode="nearest")
    ahead = np.gradient(evened, run.period) if run.ax is None else run.ax
    left = run.v * run.r if run.ay is None else run.ay
    ends = float(run.t[0]), float(run.t[-1])
    return Driven(name or run.name, *ends, stretches, (left, ahead), (run.v, run.delta_cmd))


class DrivingCharts(NamedTuple):
    """What the macro `driving` draws of a page's runs."""

    runs: Sequence[Driven]
    accelerations: Markup
    steering: Markup


def accelerations(runs: Sequence[Driven]) -> Figure:
    """Accelerations ahead against those to the left."""
    points = [(run.name, *run.accelerations) for run in runs]
    return cloud(points, "acceleration to the left [m/s²]", "ahead [m/s²]")


def steering(runs: Sequence[Driven]) -> Figure:
    """Steering commands against speed."""
    return cloud([(run.name, *run.steering) for run in runs], "speed [m/s]", "steering [rad]")


def driving(runs: Sequence[Driven]) -> DrivingCharts:
    """Of a report."""
    return DrivingCharts(runs, placed(accelerations(runs)), placed(steering(runs)))
