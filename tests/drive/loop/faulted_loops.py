"""A short drift of the coupe under a small, quick controller, with faults in it."""

import dataclasses
from typing import Any

from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.step_model import NominalStepModel, StepModel
from drift_drake.drive.loop.closed_loop import ClosedLoop, ControlConfig
from drift_drake.drive.loop.faults import parse_fault
from drift_drake.drive.reference.trajectory import Reference

PARAMETERS = VehicleParameters()
FAST = ControlConfig(horizon=15, period=0.02, delay=0.02)


def loop_with(
    reference: Reference, *faults: str, effects: Effects | None = None, model: StepModel | None = None, **control: Any
) -> ClosedLoop:
    """A loop with faults as they are written; the controller's model is the nominal car's, if none is given."""
    return ClosedLoop(
        PARAMETERS,
        reference,
        model or NominalStepModel(PARAMETERS),
        effects or Effects(),
        control=dataclasses.replace(FAST, **control),
        faults=[parse_fault(text) for text in faults],
    )
