"""What a car looks like from above: outlines of body and wheels in its own frame, and in the world."""

import dataclasses

import numpy as np

from drift_drake.car.parameters import VehicleParameters
from drift_drake.common.arrays import Array

WHEELBASE = 2.47  # [m] of the car that the other sizes are of
FULL_SIZE = 1.0  # [m] of wheelbase from which a car is no model


def model_scale(parameters: VehicleParameters) -> float:
    """1 for a full-size car; for a model, its wheelbase relative to one's (a tenth or so)."""
    wheelbase = parameters.front_axle_distance + parameters.rear_axle_distance
    return 1.0 if wheelbase > FULL_SIZE else wheelbase / WHEELBASE


@dataclasses.dataclass(frozen=True)
class CarShape:
    """Sizes [m] of a car for pictures; axles and wheels come from the vehicle, the rest from its scale."""

    front_axle: float
    rear_axle: float
    wheel_radius: float
    track: float = 1.56
    wheel_width: float = 0.26
    width: float = 1.84
    front_overhang: float = 0.92
    rear_overhang: float = 0.84
    scale: float = 1.0

    @classmethod
    def of(cls, parameters: VehicleParameters) -> "CarShape":
        scale = model_scale(parameters)
        p = parameters
        return cls(p.front_axle_distance / scale, p.rear_axle_distance / scale, p.wheel_radius / scale).scaled(scale)

    def scaled(self, scale: float) -> "CarShape":
        """The same car, so many times as large."""
        return CarShape(*(scale * getattr(self, field.name) for field in dataclasses.fields(self)))

    @property
    def nose(self) -> float:
        """x [m] of the front end."""
        return self.front_axle + self.front_overhang

    @property
    def tail(self) -> float:
        """x [m] of the rear end."""
        return -self.rear_axle - self.rear_overhang

    @property
    def length(self) -> float:
        """From end to end [m]."""
        return self.nose - self.tail

    def body(self) -> Array:
        """Outline of the body [K, 2] [m], counter-clockwise from the rear right, the nose tapering."""
        half = 0.5 * self.width
        right = np.array([
            [self.tail, -0.80 * half], [self.tail + 0.25 * self.scale, -half], [self.nose - 1.0 * self.scale, -half],
            [self.nose - 0.30 * self.scale, -0.86 * half], [self.nose, -0.48 * half]])  # fmt: skip
        return np.concatenate([right, right[::-1] * [1.0, -1.0]])

    def cabin(self) -> Array:
        """Outline of the glass house [K, 2] [m]; it tells the front from the rear."""
        half = 0.5 * self.width
        right = np.array([
            [self.tail + 0.55 * self.scale, -0.62 * half], [self.front_axle - 0.95 * self.scale, -0.72 * half],
            [self.front_axle - 0.30 * self.scale, -0.80 * half]])  # fmt: skip
        return np.concatenate([right, right[::-1] * [1.0, -1.0]])

    def wheel_centres(self) -> Array:
        """(x, y) [4, 2] [m]: front left, front right, rear left, rear right."""
        half = 0.5 * self.track
        return np.array([
            [self.front_axle, half], [self.front_axle, -half], [-self.rear_axle, half], [-self.rear_axle, -half]
        ])  # fmt: skip

    def wheels(self, delta: float) -> list[Array]:
        """Outlines of the four wheels, each [4, 2] [m], the front ones steered by delta [rad]."""
        r, w = self.wheel_radius, 0.5 * self.wheel_width
        tread = np.array([[-r, -w], [r, -w], [r, w], [-r, w]])
        angles = (delta, delta, 0.0, 0.0)
        return [turned(tread, angle) + c for angle, c in zip(angles, self.wheel_centres(), strict=True)]


def turned(points: Array, angle: float) -> Array:
    """Points [K, 2] turned counter-clockwise by an angle [rad]."""
    c, s = np.cos(angle), np.sin(angle)
    return points @ np.array([[c, s], [-s, c]])


def placed(points: Array, x: float, y: float, psi: float) -> Array:
    """Points [K, 2] of the car's frame in the world, the car being at (x, y) [m] with heading psi [rad]."""
    return turned(points, psi) + np.array([x, y])
