"""The catalogue of effects as records: unit, practical range, where each acts and what it needs to be seen.

The physics of an effect is in `effects.motion_with_effects`; this is all else that is known of it, in one place.
"""

import dataclasses
from typing import Literal

from drift_drake.vehicle.parameters import VehicleParameters

Stage = Literal["command", "actuator", "motion", "sensor"]
Command = Literal["delta_cmd", "tau_cmd"]


@dataclasses.dataclass(frozen=True)
class EffectInfo:
    """What the catalogue says of one effect."""

    unit: str
    low: float  # end of the practical range of the reference car, `VehicleParameters()`
    high: float
    change: str  # in words
    stage: Stage = "motion"
    needs: tuple[str, ...] = ()  # columns without which a filter cannot see it
    tolerance: str | None = None  # of the vehicle file, that this effect is a larger deviation of
    spread: bool = False  # magnitudes are spread evenly by their logarithm
    remembers: tuple[Command, ...] = ()  # commands whose values before the first row matter
    mass: float = (
        0.0  # powers of a car's mass, length and wheel radius, beside the reference car's, that scale the range
    )
    length: float = 0.0
    radius: float = 0.0

    daily: float = 1.0  # how often it changes from one day to another, beside the others

    @property
    def signed(self) -> bool:
        """Whether the magnitude may have either sign."""
        return self.low < 0.0

    def range_for(self, vehicle: VehicleParameters) -> tuple[float, float]:
        """Practical range of the magnitude for a car of another size (1.6 kg to 40 t)."""
        size = (
            (vehicle.mass / REFERENCE.mass) ** self.mass
            * (wheelbase(vehicle) / wheelbase(REFERENCE)) ** self.length
            * (vehicle.wheel_radius / REFERENCE.wheel_radius) ** self.radius
        )
        return self.low * size, self.high * size


def wheelbase(vehicle: VehicleParameters) -> float:
    """Distance between the axles [m]."""
    return vehicle.front_axle_distance + vehicle.rear_axle_distance


REFERENCE = VehicleParameters()

STEERING: tuple[Command, ...] = ("delta_cmd",)
TORQUE: tuple[Command, ...] = ("tau_cmd",)

CATALOGUE: dict[str, EffectInfo] = {
    "friction_level": EffectInfo(
        "-", -0.35, 0.2, "friction of both axles times (1 + q)", tolerance="friction", daily=2.0
    ),
    "front_rear_friction_split": EffectInfo("-", -0.2, 0.2, "friction times (1 + q) in front, (1 - q) at the rear"),
    "front_stiffness_error": EffectInfo(
        "-", -0.4, 0.4, "front tyre stiffness times (1 + q)", tolerance="front_stiffness"
    ),
    "rear_stiffness_error": EffectInfo("-", -0.4, 0.4, "rear tyre stiffness times (1 + q)", tolerance="rear_stiffness"),
    "tyre_relaxation": EffectInfo(
        "m",
        0.15,
        1.0,
        "lateral slip follows the kinematic one over a rolled length q",
        spread=True,
        length=1.0,
        daily=0.2,
    ),
    "sliding_friction_drop": EffectInfo("-", 0.05, 0.35, "friction falls by q as the contact slides", daily=0.2),
    "tyre_thermal_fade": EffectInfo(
        "1/unit heat", 0.05, 0.4, "friction falls by q per unit of heat", mass=-1.0, length=-0.5, daily=0.2
    ),
    "longitudinal_load_transfer": EffectInfo(
        "m", 0.25, 0.7, "axle loads shift with a centre of gravity at height q", length=1.0, daily=0.2
    ),
    "lateral_load_transfer": EffectInfo("-", 0.05, 0.3, "friction falls by q (a_y/g)^2", daily=0.2),
    "mass_error": EffectInfo("-", -0.12, 0.2, "mass times (1 + q)", tolerance="mass", daily=2.0),
    "yaw_inertia_error": EffectInfo("-", -0.3, 0.4, "yaw inertia times (1 + q)", tolerance="yaw_inertia"),
    "cg_shift": EffectInfo(
        "m", -0.12, 0.12, "centre of gravity moved back by q", tolerance="front_axle_distance", length=1.0
    ),
    "steering_lag": EffectInfo(
        "s", 0.03, 0.2, "first-order lag from command to road wheel", stage="actuator", spread=True, remembers=STEERING
    ),
    "steering_delay": EffectInfo(
        "s", 0.02, 0.15, "transport delay of the steering command", stage="command", spread=True, remembers=STEERING
    ),
    "steering_rate_limit": EffectInfo(
        "rad/s",
        0.3,
        1.2,
        "the road wheel moves no faster than q",
        stage="actuator",
        spread=True,
        remembers=STEERING,
        length=-0.5,
    ),
    "steering_offset": EffectInfo(
        "rad", -0.035, 0.035, "added to the road-wheel angle", stage="actuator", tolerance="steering_offset"
    ),
    "torque_lag": EffectInfo(
        "s",
        0.05,
        0.4,
        "first-order lag of engine torque",
        stage="actuator",
        needs=TORQUE,
        spread=True,
        remembers=TORQUE,
    ),
    "torque_gain_error": EffectInfo(
        "-", -0.3, 0.2, "torque at the axle times (1 + q)", needs=TORQUE, tolerance="torque"
    ),
    "drivetrain_inertia_error": EffectInfo(
        "-", -0.4, 0.8, "rear axle inertia times (1 + q)", needs=TORQUE, tolerance="rear_axle_inertia", daily=0.2
    ),
    "drivetrain_friction": EffectInfo(
        "N m", 40.0, 300.0, "torque q tanh(omega_r) opposes the rear axle", needs=TORQUE, mass=1.0, radius=1.0
    ),
    "aero_drag": EffectInfo("N s^2/m^2", 0.4, 2.5, "force q v^2 against the course", mass=1.0, length=-1.0),
    "rolling_resistance": EffectInfo("-", 0.01, 0.05, "force q m g backwards along the body"),
    "road_grade": EffectInfo("rad", -0.06, 0.06, "the fixed frame's +x is uphill by q", needs=("psi",)),
    "differential_yaw_moment": EffectInfo(
        "N s^2", 40.0, 250.0, "yaw moment -q r v of a locking rear axle", mass=1.0, length=1.0, daily=0.2
    ),
    "gyro_bias": EffectInfo(
        "rad/s", -0.04, 0.04, "added to the measured yaw rate", stage="sensor", needs=("psi",), length=-0.5
    ),
    "sideslip_bias": EffectInfo("rad", -0.04, 0.04, "added to the measured sideslip", stage="sensor", needs=("beta",)),
    "wheel_radius_error": EffectInfo(
        "-", -0.05, 0.05, "measured rim speed times (1 + q)", stage="sensor", needs=("omega_r",)
    ),
    "sensor_latency": EffectInfo(
        "s",
        0.02,
        0.12,
        "every measured column is late by q",
        stage="sensor",
        spread=True,
        remembers=(*STEERING, *TORQUE),
    ),
}
