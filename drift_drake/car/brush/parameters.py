"""A car on brush tyres: its parameters with units, validated, and what a vehicle file says nothing of."""

import dataclasses
from typing import Any, ClassVar, NamedTuple

from drift_drake.car.deviation import Deviation
from drift_drake.car.effects import changed
from drift_drake.car.effects.catalogue import PARAMETRIC
from drift_drake.car.effects.changed import constants_changed
from drift_drake.car.parameters import (
    InvalidVehicleError,
    PlainCar,
    Tolerance,
    VehicleParameters,
    check_numbers,
    check_tolerance,
    check_torques,
    entry,
)

NOT_NEGATIVE = ("cg_height", "front_roll_share", "load_sensitivity", "rolling_resistance", "aero_drag", "lock",
                "lock_share", "lock_least", "vectoring")  # fmt: skip


class BrushConstants(NamedTuple):
    """The numbers that the equations read (SI); `BrushParameters` says what each is."""

    mass: Any
    yaw_inertia: Any
    front_axle_distance: Any
    rear_axle_distance: Any
    track: Any
    cg_height: Any
    front_roll_share: Any
    roll_frequency: Any
    roll_damping: Any
    pitch_time: Any
    wheel_radius: Any
    rear_axle_inertia: Any
    gear_ratio: Any
    friction: Any
    sliding_friction: Any
    sliding_speed: Any
    load_sensitivity: Any
    nominal_load: Any
    front_cornering: Any
    rear_cornering: Any
    relaxation: Any
    rolling_resistance: Any
    aero_drag: Any
    front_compliance: Any
    rear_compliance: Any
    roll_steer: Any
    rear_steer: Any
    lock: Any
    lock_share: Any
    lock_least: Any
    vectoring: Any
    gravity: Any

    @property
    def front_stiffness(self) -> float:
        """Lateral stiffness [N per unit slip] of the front axle at its static load."""
        return float(self.front_cornering * self.mass * self.gravity * self.rear_axle_distance / self._wheelbase)

    @property
    def rear_stiffness(self) -> float:
        """The same of the rear axle."""
        return float(self.rear_cornering * self.mass * self.gravity * self.front_axle_distance / self._wheelbase)

    @property
    def _wheelbase(self) -> float:
        return float(self.front_axle_distance + self.rear_axle_distance)


CHANGES = {name: getattr(changed, name) for name in ("mass", "yaw_inertia", "front_axle_distance", "rear_axle_distance",
                                                     "rear_axle_inertia", "gear_ratio", "friction", "aero_drag",
                                                     "rolling_resistance")}  # fmt: skip
CHANGES |= {"front_cornering": changed.front_stiffness, "rear_cornering": changed.rear_stiffness,
            "relaxation": changed.tyre_relaxation}  # fmt: skip
FOLDED = (*sorted(PARAMETRIC), "tyre_relaxation", "rolling_resistance", "aero_drag")  # effects of these changes
DEVIATIONS = {
    "cg_height": Deviation("m", 0.15),
    "front_roll_share": Deviation("-", 0.08, relative=False, low=0.1, high=0.9),
    "roll_frequency": Deviation("rad/s", 0.2),
    "roll_damping": Deviation("-", 0.3),
    "pitch_time": Deviation("s", 0.3),
    "sliding_friction": Deviation("-", 0.06, relative=False, low=0.5, high=1.0),
    "sliding_speed": Deviation("m/s", 0.4),
    "load_sensitivity": Deviation("-", 0.06, relative=False, high=0.4),
    "relaxation": Deviation("m", 0.4),
    "front_compliance": Deviation("rad", 0.008, relative=False, low=-0.05, high=0.05),
    "rear_compliance": Deviation("rad", 0.005, relative=False, low=-0.05, high=0.05),
    "roll_steer": Deviation("rad s^2/m", 0.0007, relative=False, low=-0.01, high=0.01),
    "rear_steer": Deviation("-", 0.03, relative=False, low=-0.3, high=0.3),
    "lock": Deviation("N m s/m", 0.6),
    "lock_share": Deviation("-", 0.2, relative=False, high=1.0),
    "lock_least": Deviation("N m", 0.6),
    "vectoring": Deviation("N m s", 0.4),
}
"""Of what a vehicle file says nothing of; those of a differential or motors that the car has not stay zero."""


@dataclasses.dataclass(frozen=True)
class BrushParameters(PlainCar):
    """A rear-wheel-drive car on brush tyres. Defaults: the class of car of `VehicleParameters`, no measured vehicle."""

    key: ClassVar[str] = "brush"
    numbers: ClassVar[type[BrushConstants]] = BrushConstants

    mass: float = entry("kg", "m", 1650.0)
    yaw_inertia: float = entry("kg m^2", "I_z", 2350.0)
    front_axle_distance: float = entry("m", "a", 1.23)
    rear_axle_distance: float = entry("m", "b", 1.24)
    track: float = entry("m", "t", 1.55)
    cg_height: float = entry("m", "h", 0.5, positive=False)
    front_roll_share: float = entry("-", "s_f", 0.58, positive=False)  # of the load that crosses over in a turn
    roll_frequency: float = entry("rad/s", "w_roll", 10.0)  # with which it follows
    roll_damping: float = entry("-", "D_roll", 0.45)
    pitch_time: float = entry("s", "T_z", 0.08)  # in which load moves between the axles
    wheel_radius: float = entry("m", "R_w", 0.337)
    rear_axle_inertia: float = entry("kg m^2", "I_w", 20.0)  # of both rear wheels and what drives them
    gear_ratio: float = entry("-", "G", 10.6)
    friction: float = entry("-", "mu", 1.05)
    sliding_friction: float = entry("-", "s_mu", 0.9)  # share of it that is left at a high sliding speed
    sliding_speed: float = entry("m/s", "v_mu", 6.0)  # over which it falls
    load_sensitivity: float = entry("-", "k_mu", 0.13, positive=False)  # by which it falls as a wheel's load doubles
    nominal_load: float = entry("N", "F_z0", 4050.0)  # of a wheel, at which the friction is this
    front_cornering: float = entry("-", "C_f", 15.0)  # an axle's force per unit slip over its load
    rear_cornering: float = entry("-", "C_r", 20.0)
    relaxation: float = entry("m", "sigma", 0.2)
    rolling_resistance: float = entry("-", "c_r", 0.012, positive=False)
    aero_drag: float = entry("N s^2/m^2", "c_v", 0.4, positive=False)
    front_compliance: float = entry("rad", "c_f", 0.01, positive=False)  # yielded under the static load as a side force
    rear_compliance: float = entry("rad", "c_b", 0.003, positive=False)
    roll_steer: float = entry("rad s^2/m", "e_f", -0.0005, positive=False)  # of the front wheels
    rear_steer: float = entry("-", "e_r", 0.0, positive=False)  # share of the front's angle
    lock: float = entry("N m s/m", "k_l", 150.0, positive=False)  # of a differential, per difference of rim speeds
    lock_share: float = entry("-", "s_l", 0.3, positive=False)  # of the axle's torque that it locks with at most
    lock_least: float = entry("N m", "M_l", 50.0, positive=False)  # that it locks with in any case
    vectoring: float = entry("N m s", "k_v", 0.0, positive=False)
    """Yaw moment of the rear motors per yaw rate that steering asks for and the car has not."""
    gravity: float = entry("m/s^2", "g", 9.81)
    steering_limit: float = entry("rad", "delta_max", 0.66)
    torque_min: float = entry("N m", "tau_min", -50.0, positive=False)
    torque_max: float = entry("N m", "tau_max", 450.0, positive=False)
    tolerance: Tolerance = dataclasses.field(default_factory=Tolerance)

    def __post_init__(self) -> None:
        check_numbers(self)
        for name in NOT_NEGATIVE:
            if getattr(self, name) < 0.0:
                raise InvalidVehicleError(f"{name} is {getattr(self, name):g}; give zero or more")
        for name in ("front_roll_share", "sliding_friction", "load_sensitivity", "rolling_resistance"):
            if getattr(self, name) > 1.0:
                raise InvalidVehicleError(f"{name} is {getattr(self, name):g}; give a share, 1 at most")
        check_torques(self.torque_min, self.torque_max)
        check_tolerance(self.tolerance)

    def single_track(self) -> VehicleParameters:
        """The nearest single-track car: its tyres are this car's at the static loads."""
        c = self.constants()
        shared = ("mass", "yaw_inertia", "front_axle_distance", "rear_axle_distance", "wheel_radius", "gear_ratio",
                  "rear_axle_inertia", "gravity", "steering_limit", "torque_min", "torque_max", "friction",
                  "tolerance")  # fmt: skip
        return VehicleParameters(front_stiffness=c.front_stiffness, rear_stiffness=c.rear_stiffness,
                                 **{name: getattr(self, name) for name in shared})  # fmt: skip


changed_constants = constants_changed(BrushConstants, CHANGES)
"""The car with the effects that only change parameters."""
