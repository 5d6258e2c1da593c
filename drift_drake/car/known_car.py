"""What a controller plans with that knows the car: the one-step model of its equations and effects."""

from drift_drake.car.double_track.parameters import DoubleTrackParameters
from drift_drake.car.double_track.step_model import DoubleTrackStepModel
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.single_track.effects_step import EffectsStepModel, planned_with

KnownVehicle = VehicleParameters | DoubleTrackParameters


def known_car_model(vehicle: KnownVehicle, effects: Effects) -> EffectsStepModel | DoubleTrackStepModel:
    """The car of either kind with what of its effects can be planned with (`effects_step.planned_with`)."""
    if isinstance(vehicle, DoubleTrackParameters):
        return DoubleTrackStepModel(vehicle, planned_with(effects))
    return EffectsStepModel(vehicle, planned_with(effects), exact=False)
