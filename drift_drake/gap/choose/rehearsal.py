"""Whether a car can be drifted: the figure-8 in simulation first, with the car that its informative drives identify.

The controller knows that car and its effects, so that the real one will hardly be drifted better. A car without the
torque or the grip, or whose steering is too slow for the transitions, leaves the lane here.
"""

import math
from typing import NamedTuple

from drift_drake.car.known_car import known_car_model, plant_of_car
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.sensor_errors import sensor_errors
from drift_drake.drive.loop.closed_loop import ClosedLoop, ControlConfig
from drift_drake.drive.loop.endings import RunLimits
from drift_drake.drive.reference.chain import NoTransitionError
from drift_drake.drive.reference.equilibrium import NoEquilibriumError
from drift_drake.drive.reference.similarity import similarity, time_step
from drift_drake.drive.reference.trajectory import figure_8
from drift_drake.gap.choose.identified import IdentifiedCar

HELD = 0.5  # of the distance in steady drifts, that a car which can be drifted holds


class Rehearsal(NamedTuple):
    """How the identified car was driven."""

    outcome: str  # of the run, or that no such drift exists
    completion: float = 0.0  # [-] of the path
    held: float = 0.0  # [-] of the distance in steady drifts, driven in one
    rms_e: float = math.nan  # [m]; NaN without a run

    @property
    def can(self) -> bool:
        """Whether it was drifted to the end."""
        return self.outcome == "completed" and self.held >= HELD

    def sentence(self) -> str:
        """What follows from it."""
        if self.can:
            return f"rehearsed in simulation, the identified car drifts the figure-8 (RMS e {self.rms_e:.2f} m)"
        if math.isnan(self.rms_e):
            return (
                f"not rehearsed, since the vehicle file's car has no such figure-8: {self.outcome}; if that file is a "
                "guess, give the one that --out writes"
            )
        return (
            f"do not drift this car: rehearsed in simulation, the identified car cannot ({self.outcome} after "
            f"{self.completion:.0%} of the figure-8, {self.held:.0%} of its steady drifts held); look at its torque, "
            "grip and steering"
        )


def rehearse(car: IdentifiedCar, believed: VehicleParameters, seed: int = 0) -> Rehearsal:
    """Drives an identified car round the figure-8.

    Args:
        believed: the vehicle file's car, whose figure-8 is to be driven, and whose limits of commands hold;
        seed: of the sensors' noise.
    """
    try:
        reference = figure_8(believed)
    except (NoEquilibriumError, NoTransitionError) as error:
        return Rehearsal(str(error))
    plant = plant_of_car(car.vehicle, car.effects, reference.path)
    model = known_car_model(car.vehicle, car.effects, time_step(believed, ControlConfig().period))
    loop = ClosedLoop(car.vehicle.single_track(), reference, model, car.effects, plant=plant,
                      sensor_errors=sensor_errors(car.effects))  # fmt: skip
    limits = RunLimits(lane_margin=RunLimits().lane_margin * similarity(believed).length)
    m = loop.run(loop.initial_context(seed), limits).metrics()
    return Rehearsal(m.outcome, m.completion, m.drifting, m.rms_e)
