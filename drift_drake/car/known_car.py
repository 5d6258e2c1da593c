"""What a controller plans with that knows the car: the one-step model of its equations and effects."""

from drift_drake.car.double_track.parameters import DoubleTrackParameters
from drift_drake.car.double_track.step_model import DoubleTrackStepModel
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.internal_states import planned_with
from drift_drake.car.parameters import CarParameters
from drift_drake.car.single_track.effects_step import EffectsStepModel
from drift_drake.car.step_model import STEP


def known_car_model(
    vehicle: CarParameters, effects: Effects, dt: float = STEP
) -> EffectsStepModel | DoubleTrackStepModel:
    """The car of either kind with what of its effects can be planned with (`internal_states.planned_with`).

    dt: [s] of a step of a single-track car; a double-track one has its own.
    """
    if isinstance(vehicle, DoubleTrackParameters):
        return DoubleTrackStepModel(vehicle, planned_with(effects))
    return EffectsStepModel(vehicle.single_track(), planned_with(effects), exact=False, dt=dt)
