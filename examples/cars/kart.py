"""Your own kind of car: its parameters and its equations, which a package of yours names in its pyproject.toml:

    [project.entry-points."drift_drake.cars"]
    kart = "my_package.kart:KART"

Once that is installed, a vehicle file may hold `kart:`, and such a car is calibrated, diagnosed, watched and driven.
"""

import dataclasses
from typing import Any, ClassVar, NamedTuple

import numpy as np

from drift_drake.car.deviation import Deviation
from drift_drake.car.effects import changed
from drift_drake.car.effects.magnitudes import INSTALLED_STATES, NO_INTERNAL_STATES, Effects, actuation_of, with_forces
from drift_drake.car.kind import CarKind
from drift_drake.car.parameters import PlainCar, Tolerance, VehicleParameters, check_numbers, entry
from drift_drake.car.scalar import absolute, cos, loaded_tuple, maximum, select, sin, stored
from drift_drake.car.single_track.motion import planar_motion
from drift_drake.car.single_track.motion_with_effects import axle_torque, road_wheel, steering_rate
from drift_drake.car.tyre import tyre_force

SLOW = 0.5  # [m/s] floor of the speed that slips are divided by
LACKS = ("longitudinal_load_transfer", "lateral_load_transfer", "tyre_relaxation", "sliding_friction_drop",
         "tyre_thermal_fade", "longitudinal_stiffness_error", *INSTALLED_STATES)  # fmt: skip


class KartConstants(NamedTuple):
    """What the equations read."""

    mass: Any
    yaw_inertia: Any
    front_axle_distance: Any
    rear_axle_distance: Any
    wheel_radius: Any
    rear_axle_inertia: Any
    gear_ratio: Any
    friction: Any
    front_stiffness: Any
    rear_stiffness: Any
    gravity: Any
    scrub: Any


@dataclasses.dataclass(frozen=True)
class KartParameters(PlainCar):
    """A kart: the wheels of its rigid rear axle scrub in a turn."""

    key: ClassVar[str] = "kart"
    numbers: ClassVar[type[KartConstants]] = KartConstants
    mass: float = entry("kg", "m", 170.0)
    yaw_inertia: float = entry("kg m^2", "I_z", 22.0)
    front_axle_distance: float = entry("m", "a", 0.6)
    rear_axle_distance: float = entry("m", "b", 0.45)
    wheel_radius: float = entry("m", "R_w", 0.13)
    rear_axle_inertia: float = entry("kg m^2", "I_w", 0.35)
    gear_ratio: float = entry("-", "G", 6.0)
    friction: float = entry("-", "mu", 1.2)
    front_stiffness: float = entry("N per unit slip", "C_f", 14e3)
    rear_stiffness: float = entry("N per unit slip", "C_r", 22e3)
    gravity: float = entry("m/s^2", "g", 9.81)
    scrub: float = entry("N m s", "c_s", 25.0, positive=False)  # yaw moment of the rear axle over the yaw rate
    steering_limit: float = entry("rad", "delta_max", 0.5)
    torque_min: float = entry("N m", "tau_min", -20.0, positive=False)
    torque_max: float = entry("N m", "tau_max", 25.0, positive=False)
    tolerance: Tolerance = dataclasses.field(default_factory=Tolerance)

    def __post_init__(self) -> None:
        check_numbers(self)

    def single_track(self) -> VehicleParameters:
        """The same without scrub: sizes, limits and references."""
        same = {f.name: getattr(self, f.name) for f in dataclasses.fields(self) if f.name != "scrub"}
        return VehicleParameters(**same)


changed_constants = changed.constants_changed(KartConstants, {
    name: getattr(changed, name) for name in KartConstants._fields if hasattr(changed, name)
})  # fmt: skip


def rates(z: Any, command: Any, car: Any, out: Any) -> None:
    """Writes the rates of r, v, beta, omega_r, psi, and of the actuators' states: steering [rad], torque [N m]."""
    nominal, q, wrench = car
    r, v, beta, omega_r, psi, own_steering, own_torque = loaded_tuple(z, 0, 7, command[0])
    p, asked = changed_constants(nominal, q), road_wheel(command[0], q)
    lagged = q.steering_lag + q.steering_rate_limit
    angle = select(0.0, lagged, own_steering, asked) + q.steering_offset
    steering, torque = actuation_of(angle, select(0.0, q.torque_lag, own_torque, command[1]), v, q, NO_INTERNAL_STATES)

    a, b = p.front_axle_distance, p.rear_axle_distance
    front_peak = changed.front_friction(nominal.friction, q) * p.mass * p.gravity * b / (a + b)
    rear_peak = changed.rear_friction(nominal.friction, q) * p.mass * p.gravity * a / (a + b)
    u, w = v * cos(beta), v * sin(beta)
    rolling = maximum(absolute(u), SLOW)
    _, front = tyre_force(0.0 * u, (w + a * r - u * steering) / rolling, p.front_stiffness, front_peak, 0.0)
    rear_x, rear_y = tyre_force((omega_r - u) / rolling, (w - b * r) / rolling, p.rear_stiffness, rear_peak, 0.0)
    forces = (rear_x - front * sin(steering), rear_y + front * cos(steering),
              a * front * cos(steering) - b * rear_y - p.scrub * r)  # fmt: skip
    f_x, f_y, m_z = with_forces(r, v, beta, omega_r, psi, p, q, NO_INTERNAL_STATES, forces)
    v_dot, beta_dot = planar_motion(r, v, beta, (f_x + wrench[0]) / p.mass, (f_y + wrench[1]) / p.mass)
    axle = axle_torque(torque, omega_r, p.gear_ratio, p.wheel_radius, q)
    found = (
        (m_z + wrench[2]) / p.yaw_inertia,
        v_dot,
        beta_dot,
        (axle - rear_x * p.wheel_radius) * p.wheel_radius / p.rear_axle_inertia,
        r,
        select(0.0, lagged, steering_rate(own_steering, asked, q), 0.0 * asked),
        select(0.0, q.torque_lag, (command[1] - own_torque) / maximum(q.torque_lag, 1e-3), 0.0 * torque),
    )
    for i, rate in enumerate(found):
        stored(out, i, rate)


def settle(z: Any, delta: Any, torque: Any, constants: Any, effects: Any) -> None:  # noqa: ARG001
    """The actuators are where the commands are."""
    stored(z, 5, road_wheel(delta, effects))
    stored(z, 6, torque)


def fastest(z: Any, constants: Any, effects: Any) -> Any:
    """Rate [1/s] at which the rim settles in grip."""
    p = changed_constants(constants, effects)
    return p.rear_stiffness * p.wheel_radius * p.wheel_radius / (p.rear_axle_inertia * maximum(absolute(z[1]), SLOW))


KART = CarKind(label="kart", constants=KartConstants, own=("steering", "torque"), own_scale=(0.3, 10.0), rates=rates,
               settle=settle, fastest=fastest, changed_constants=changed_constants, lacks=LACKS,
               deviations={"scrub": Deviation("N m s", 0.5)}, parameters=KartParameters)  # fmt: skip


def main() -> Any:
    """Yaw accelerations [rad/s^2] of a kart that turns at 1 rad/s, with little scrub and with much."""
    found = []
    for scrub in (5.0, 50.0):
        out, p = np.zeros(7), KartParameters(scrub=scrub).constants()
        rates(np.array([1.0, 8.0, 0.0, 8.0, 0.0, 0.1, 0.0]), (0.1, 0.0), (p, Effects(), np.zeros(3)), out)
        print(f"scrub {scrub:g} N m s: yaw acceleration {out[0]:.2f} rad/s^2")
        found.append(float(out[0]))
    return found


if __name__ == "__main__":
    main()
