"""The car that informative drives identify: physics, from the same logs that the learnt model's last layer takes in.

A lane tells the learnt model of drifts what its training vehicles had in common. The nominal car's equations with
effects of the catalogue, calibrated on the same drives, carry over from a lane to a drift for any car that follows
them, however far from those trained on; of a car that follows others, they tell less.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from drift_drake.control.effects_step import EffectsStepModel
from drift_drake.identification.identify import FURTHER, identify
from drift_drake.logs.table import COLUMNS, InvalidLogError, Run
from drift_drake.vehicle.effects import Effects
from drift_drake.vehicle.parameters import VehicleParameters

# Beside the vehicle's own parameters: what a driven car may have that a step of its model can hold.
EFFECTS = (*FURTHER, "rolling_resistance", "drivetrain_friction", "differential_yaw_moment")


class IdentifiedCar(NamedTuple):
    """A car as drives show it."""

    vehicle: VehicleParameters
    effects: Effects

    def step_model(self) -> EffectsStepModel:
        """What a controller plans with."""
        return EffectsStepModel(self.vehicle, self.effects)


def runs_of(tables: Sequence[pd.DataFrame]) -> list[Run]:
    """Drives' logs at 100 Hz as runs of the log format."""
    columns: list[dict[str, Any]] = [
        {name: table[name].to_numpy() for name in COLUMNS if name in table} for table in tables
    ]
    return [Run(name=f"drive_{k}", **found) for k, found in enumerate(columns)]


def identified(runs: Sequence[Run], first_guess: VehicleParameters) -> IdentifiedCar | None:
    """The car that fits the drives best, by the filter's likelihood; None where they are too short or the filter fails.

    Nothing is believed known but the equations: masses, inertias, stiffnesses, friction and the drive's gain have
    broad priors, and the effects that a driven car may have are fitted with them (`identify`).
    """
    try:
        found = identify(runs, first_guess, known=(), names=EFFECTS, criterion="likelihood")
    except (InvalidLogError, np.linalg.LinAlgError):
        return None
    return IdentifiedCar(found.vehicle, found.effects)
