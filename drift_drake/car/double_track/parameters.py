"""A double-track car: parameters with units, validated, and four cars of different kinds."""

import dataclasses
from typing import Any

from drift_drake.car.double_track.constants import DoubleTrackConstants
from drift_drake.car.double_track.tyres import TireConstants
from drift_drake.car.parameters import (
    InvalidVehicleError,
    Tolerance,
    VehicleParameters,
    check_numbers,
    check_tolerance,
    check_torques,
    entry,
)


@dataclasses.dataclass(frozen=True)
class TireParameters:
    """One tyre; see `tires`. Defaults: a plausible sports tyre, no measured one."""

    lateral_stiffness: float = entry("N per unit slip", "K_y", 1.0e5)  # largest over the load
    longitudinal_stiffness: float = entry("N per unit slip", "K_x", 1.3e5)
    stiffest_load: float = entry("N", "F_zk", 9000.0)
    lateral_friction: float = entry("-", "mu_y", 1.04)  # at the nominal load
    longitudinal_friction: float = entry("-", "mu_x", 1.1)
    nominal_load: float = entry("N", "F_z0", 4000.0)
    load_sensitivity: float = entry("-", "s_mu", 0.12, positive=False)
    shape: float = entry("-", "C", 1.35)
    curvature: float = entry("-", "E", -0.4, positive=False)
    lateral_relaxation: float = entry("m", "sigma_y", 0.35)
    longitudinal_relaxation: float = entry("m", "sigma_x", 0.15)

    def __post_init__(self) -> None:
        check_numbers(self)
        if not 1.0 <= self.shape < 2.0:
            raise InvalidVehicleError(f"shape (C) is {self.shape:g}; give 1 to below 2 (a sliding tyre still brakes)")
        if self.curvature > 1.0:
            raise InvalidVehicleError(f"curvature (E) is {self.curvature:g}; the Magic Formula takes 1 at most")
        if not 0.0 <= self.load_sensitivity < 1.0:
            raise InvalidVehicleError(f"load_sensitivity (s_mu) is {self.load_sensitivity:g}; give 0 to below 1")

    def constants(self) -> TireConstants:
        """The form that the equations read."""
        return TireConstants(*(float(getattr(self, name)) for name in TireConstants._fields))


@dataclasses.dataclass(frozen=True)
class DoubleTrackParameters:
    """A rear-wheel-drive car on four tyres. Defaults: the class of car of `VehicleParameters`, no measured vehicle.

    Inertias are about the whole car's centre of gravity, the roll inertia for roll about the roll axis. The unsprung
    masses have their centres at wheel height. `rear_axle_inertia` is that of both rear wheels with engine and gearbox.
    """

    mass: float = entry("kg", "m", 1650.0)
    yaw_inertia: float = entry("kg m^2", "I_z", 2350.0)
    roll_inertia: float = entry("kg m^2", "I_x", 560.0)
    front_axle_distance: float = entry("m", "a", 1.23)
    rear_axle_distance: float = entry("m", "b", 1.24)
    front_track: float = entry("m", "t_f", 1.54)
    rear_track: float = entry("m", "t_r", 1.55)
    cg_height: float = entry("m", "h", 0.50, positive=False)
    front_roll_center: float = entry("m", "h_rf", 0.05, positive=False)  # above the road
    rear_roll_center: float = entry("m", "h_rr", 0.10, positive=False)
    front_unsprung_mass: float = entry("kg", "m_uf", 85.0, positive=False)  # of the axle
    rear_unsprung_mass: float = entry("kg", "m_ur", 95.0, positive=False)
    front_roll_stiffness: float = entry("N m/rad", "k_f", 55e3)  # springs and stabiliser
    rear_roll_stiffness: float = entry("N m/rad", "k_r", 35e3)
    roll_damping: float = entry("N m s/rad", "c_roll", 4500.0)
    load_time: float = entry("s", "T_z", 0.03)  # in which ground forces reach the wheel loads past the springs
    wheel_radius: float = entry("m", "R_w", 0.337)
    wheel_inertia: float = entry("kg m^2", "I_wheel", 1.3)  # of one rear wheel
    rear_axle_inertia: float = entry("kg m^2", "I_w", 20.0)
    gear_ratio: float = entry("-", "G", 10.6)
    differential_preload: float = entry("N m", "M_l", 0.0, positive=False)  # that locks it in any case; 0: open
    differential_share: float = entry("-", "s_l", 0.0, positive=False)  # of the axle's torque that locks it, too
    ackermann: float = entry("-", "A", 0.5, positive=False)  # share of Ackermann's geometry
    steering_compliance: float = entry("rad/N", "c_s", 1.0e-6, positive=False)  # by the front axle's lateral force
    aero_drag: float = entry("N s^2/m^2", "c_v", 0.42, positive=False)
    rolling_resistance: float = entry("-", "c_r", 0.012, positive=False)
    gravity: float = entry("m/s^2", "g", 9.81)
    steering_limit: float = entry("rad", "delta_max", 0.66)
    torque_min: float = entry("N m", "tau_min", -50.0, positive=False)
    torque_max: float = entry("N m", "tau_max", 450.0, positive=False)
    front_tire: TireParameters = dataclasses.field(default_factory=TireParameters)
    rear_tire: TireParameters = dataclasses.field(
        default_factory=lambda: TireParameters(lateral_stiffness=1.35e5, longitudinal_stiffness=1.6e5)
    )
    tolerance: Tolerance = dataclasses.field(default_factory=Tolerance)

    def __post_init__(self) -> None:
        check_numbers(self)
        for name in ("cg_height", "front_roll_center", "rear_roll_center", "front_unsprung_mass", "rear_unsprung_mass",
                     "differential_preload", "differential_share", "ackermann", "steering_compliance", "aero_drag",
                     "rolling_resistance"):  # fmt: skip
            if getattr(self, name) < 0.0:
                raise InvalidVehicleError(f"{name} is {getattr(self, name):g}; give zero or more")
        if self.rolling_resistance >= 1.0:
            raise InvalidVehicleError(
                f"rolling_resistance is {self.rolling_resistance:g}; give a share of the weight, such as 0.012"
            )
        check_torques(self.torque_min, self.torque_max)
        check_tolerance(self.tolerance)
        if self.front_unsprung_mass + self.rear_unsprung_mass >= self.mass:
            raise InvalidVehicleError("the unsprung masses must weigh less than the car (mass)")
        if self.rear_axle_inertia < 2.0 * self.wheel_inertia:
            raise InvalidVehicleError(
                f"rear_axle_inertia ({self.rear_axle_inertia:g} kg m^2) holds both rear wheels; give at least twice "
                f"wheel_inertia ({self.wheel_inertia:g} kg m^2)"
            )
        if self.front_roll_stiffness + self.rear_roll_stiffness <= self.mass * self.cg_height * self.gravity:
            raise InvalidVehicleError(
                "the car would fall over: front_roll_stiffness and rear_roll_stiffness must sum to more than "
                f"mass cg_height gravity ({self.mass * self.cg_height * self.gravity:.0f} N m/rad)"
            )

    def constants(self) -> DoubleTrackConstants:
        """The part of the parameters that the equations of motion read."""
        tires = ("front_tire", "rear_tire")
        values = {name: float(getattr(self, name)) for name in DoubleTrackConstants._fields if name not in tires}
        return DoubleTrackConstants(
            **values, front_tire=self.front_tire.constants(), rear_tire=self.rear_tire.constants()
        )

    def with_constants(self, constants: DoubleTrackConstants) -> "DoubleTrackParameters":
        """The car with other numbers in its equations, validated again.

        Raises:
            InvalidVehicleError: a number that no car has.
        """
        numbers = constants._asdict()
        tires = {name: TireParameters(**numbers.pop(name)._asdict()) for name in ("front_tire", "rear_tire")}
        return self.replace(**numbers, **tires)

    def to_dict(self) -> dict[str, Any]:
        """Plain data, as in a vehicle file."""
        return {"double_track": {
            name: {key: float(number) for key, number in value.items()} if isinstance(value, dict) else float(value)
            for name, value in dataclasses.asdict(self).items()
        }}  # fmt: skip

    def replace(self, **changes: Any) -> "DoubleTrackParameters":
        """A copy with some parameters changed, validated again."""
        return dataclasses.replace(self, **changes)

    def single_track(self) -> VehicleParameters:
        """The nearest single-track car: its tyres are this car's at the static loads, its friction the lateral one."""
        shared = ("mass", "yaw_inertia", "front_axle_distance", "rear_axle_distance", "wheel_radius", "gear_ratio",
                  "rear_axle_inertia", "gravity", "steering_limit", "torque_min", "torque_max", "tolerance", "friction",
                  "front_stiffness", "rear_stiffness")  # fmt: skip
        return VehicleParameters(**{name: getattr(self, name) for name in shared})

    @property
    def friction(self) -> float:
        """Lateral friction [-] at the static loads, the mean of both axles."""
        return self.constants().friction

    @property
    def front_stiffness(self) -> float:
        """Lateral stiffness [N per unit slip] of the front axle at the static loads."""
        return self.constants().front_stiffness

    @property
    def rear_stiffness(self) -> float:
        """The same of the rear axle."""
        return self.constants().rear_stiffness


def _roadster() -> DoubleTrackParameters:
    """A light car with narrow tyres, low and stiff."""
    tire = TireParameters(lateral_stiffness=6.2e4, longitudinal_stiffness=8.0e4, stiffest_load=5500.0,
                          lateral_friction=1.0, longitudinal_friction=1.04, nominal_load=2500.0, load_sensitivity=0.1,
                          shape=1.4, curvature=-0.2, lateral_relaxation=0.25, longitudinal_relaxation=0.12)  # fmt: skip
    return DoubleTrackParameters(
        mass=1030.0, yaw_inertia=1220.0, roll_inertia=270.0, front_axle_distance=1.19, rear_axle_distance=1.12,
        front_track=1.41, rear_track=1.43, cg_height=0.46, front_roll_center=0.06, rear_roll_center=0.09,
        front_unsprung_mass=60.0, rear_unsprung_mass=64.0, front_roll_stiffness=34e3, rear_roll_stiffness=21e3,
        roll_damping=2300.0, load_time=0.025, wheel_radius=0.293, wheel_inertia=0.75, rear_axle_inertia=9.0,
        gear_ratio=8.4, ackermann=0.8, steering_compliance=1.5e-6, aero_drag=0.38, rolling_resistance=0.011,
        front_tire=tire, rear_tire=tire,
    )  # fmt: skip


def _rear_engined() -> DoubleTrackParameters:
    """Three fifths of the weight at the rear, on wider tyres there."""
    front = TireParameters(lateral_stiffness=8.4e4, longitudinal_stiffness=1.0e5, stiffest_load=7000.0,
                           lateral_friction=1.12, longitudinal_friction=1.16, nominal_load=3200.0,
                           load_sensitivity=0.14, shape=1.45, lateral_relaxation=0.3)  # fmt: skip
    rear = TireParameters(lateral_stiffness=1.55e5, longitudinal_stiffness=1.8e5, stiffest_load=10500.0,
                          lateral_friction=1.14, longitudinal_friction=1.2, nominal_load=4700.0,
                          load_sensitivity=0.14, shape=1.4, lateral_relaxation=0.4)  # fmt: skip
    return DoubleTrackParameters(
        mass=1490.0, yaw_inertia=2050.0, roll_inertia=460.0, front_axle_distance=1.47, rear_axle_distance=0.98,
        front_track=1.55, rear_track=1.54, cg_height=0.47, front_roll_center=0.03, rear_roll_center=0.09,
        front_roll_stiffness=62e3, rear_roll_stiffness=38e3, roll_damping=4600.0, rear_axle_inertia=24.0,
        gear_ratio=9.8, wheel_radius=0.345, ackermann=0.4, steering_compliance=0.8e-6, aero_drag=0.4,
        front_tire=front, rear_tire=rear,
    )  # fmt: skip


def _saloon() -> DoubleTrackParameters:
    """A heavy car on soft springs and soft, slow tyres of little friction."""
    tire = TireParameters(lateral_stiffness=9.4e4, longitudinal_stiffness=1.2e5, stiffest_load=10500.0,
                          lateral_friction=0.88, longitudinal_friction=0.95, nominal_load=4800.0,
                          load_sensitivity=0.18, shape=1.25, curvature=-0.8, lateral_relaxation=0.6,
                          longitudinal_relaxation=0.22)  # fmt: skip
    return DoubleTrackParameters(
        mass=1890.0, yaw_inertia=3250.0, roll_inertia=780.0, front_axle_distance=1.38, rear_axle_distance=1.5,
        front_track=1.58, rear_track=1.59, cg_height=0.57, front_roll_center=0.08, rear_roll_center=0.14,
        front_unsprung_mass=100.0, rear_unsprung_mass=110.0, front_roll_stiffness=46e3, rear_roll_stiffness=27e3,
        roll_damping=4200.0, load_time=0.04, wheel_radius=0.33, rear_axle_inertia=26.0, gear_ratio=11.5,
        ackermann=0.6, steering_compliance=2.2e-6, aero_drag=0.45, rolling_resistance=0.014,
        front_tire=tire, rear_tire=dataclasses.replace(tire, lateral_stiffness=1.15e5),
    )  # fmt: skip


CARS = {
    "coupe": DoubleTrackParameters(),
    "roadster": _roadster(),
    "rear_engined": _rear_engined(),
    "saloon": _saloon(),
}
