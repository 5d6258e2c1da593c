"""Froude similarity: a car of any size as one of the default car's size, which moves alike in its own units.

Lengths are measured in wheelbases, times in the square root of wheelbase over gravity, masses in the car's own. In
these units a car and its exact dynamic copy, twice or a tenth as large, are one car: what is planned for it with step
sizes, tolerances and first guesses made for the default car holds for both.
"""

import dataclasses
import math
from typing import NamedTuple

from drift_drake.car.effects.record import wheelbase
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.step_model import STEP


class Similarity(NamedTuple):
    """How many of the default car's units one of this car's is: of length, time and mass. All are 1 for the default."""

    length: float
    time: float
    mass: float

    @property
    def speed(self) -> float:
        """Unit of speed."""
        return self.length / self.time

    @property
    def torque(self) -> float:
        """Unit of torque, as of energy."""
        return self.mass * self.speed**2

    def usual(self, p: VehicleParameters) -> VehicleParameters:
        """The car as one of the default car's size, mass and gravity."""
        force, inertia = self.mass * self.length / self.time**2, self.mass * self.length**2
        tolerance = dataclasses.replace(p.tolerance, front_axle_distance=p.tolerance.front_axle_distance / self.length)
        return p.replace(
            mass=p.mass / self.mass,
            yaw_inertia=p.yaw_inertia / inertia,
            rear_axle_inertia=p.rear_axle_inertia / inertia,
            front_axle_distance=p.front_axle_distance / self.length,
            rear_axle_distance=p.rear_axle_distance / self.length,
            wheel_radius=p.wheel_radius / self.length,
            front_stiffness=p.front_stiffness / force,
            rear_stiffness=p.rear_stiffness / force,
            gravity=p.gravity * self.time**2 / self.length,
            torque_min=p.torque_min / self.torque,
            torque_max=p.torque_max / self.torque,
            tolerance=tolerance,
        )


def similarity(p: VehicleParameters) -> Similarity:
    """The units of a car, relative to those of the default one."""
    usual = VehicleParameters()
    length = wheelbase(p) / wheelbase(usual)
    return Similarity(length, math.sqrt(length * usual.gravity / p.gravity), p.mass / usual.mass)


def time_step(p: VehicleParameters, period: float) -> float:
    """Step [s] of a horizon for a car of any size: `STEP` for the default one, a multiple of the control period."""
    return max(round(STEP * similarity(p).time / period), 1) * period
