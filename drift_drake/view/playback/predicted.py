"""A run as measured and as two cars predict it, as the panels of a chart."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from drift_drake.car.given_vehicle import Vehicle
from drift_drake.car.log.table import Run
from drift_drake.view.colours import RUNS
from drift_drake.view.pages.charts import Line, Panel, reach_of
from drift_drake.view.playback.play import UNITS, drawn
from drift_drake.view.playback.replay import replay

STATES = ("r", "beta", "v", "omega_r")
BEFORE, AFTER = "first guess", "calibrated"


class Predicted(NamedTuple):
    """Panels of the states over time, and the errors in words, a line each."""

    panels: Sequence[Panel]
    sentence: str


def predicted(log: str | Path | Run, first: Vehicle, calibrated: Vehicle) -> Predicted:
    """A run's commands played to both cars, put back onto the real one every second.

    Raises:
        InvalidLogError, InvalidVehicleError: of the files.
    """
    played = replay(log, first, calibrated)
    tables = drawn(played.played)
    panels = []
    for state in STATES:
        t, measured = (tables["real"][column].to_numpy(float) for column in ("t", state))
        if np.isfinite(measured).any():
            lines = [
                Line(name, tables[car]["t"].to_numpy(float), tables[car][state].to_numpy(float), colour)
                for name, car, colour in ((BEFORE, "nominal", RUNS[1]), (AFTER, "corrected", RUNS[0]))
            ]
            reach = reach_of(measured[np.isfinite(measured)], [line.y for line in lines])
            panels.append(Panel(f"{state} [{UNITS[state]}]", [Line("measured", t, measured), *lines], reach=reach))
    return Predicted(panels, played.sentence().replace("nominal", BEFORE).replace("corrected", AFTER))
