"""The catalogue of effects: a record each, the package's own and those that other packages install.

The physics of the package's own is in `single_track.motion_with_effects`, but for delays of commands, of which the
record says all (`delays`); that of another package's is beside its record.
"""

from drift_drake.car.effects.installed import installed_effects
from drift_drake.car.effects.record import REFERENCE, Command, Effect, InvalidExtensionError, wheelbase

__all__ = ["CATALOGUE", "OFF_THE_MOTION", "REFERENCE", "Effect", "wheelbase"]

STEERING: tuple[Command, ...] = ("delta_cmd",)
TORQUE: tuple[Command, ...] = ("tau_cmd",)

OWN: dict[str, Effect] = {
    "friction_level": Effect(
        "-",
        -0.35,
        0.2,
        "friction of both axles times (1 + q)",
        tolerance="friction",
        daily=2.0,
        varies=True,
        of_tyres_or_body=True,
    ),
    "front_rear_friction_split": Effect(
        "-", -0.2, 0.2, "friction times (1 + q) in front, (1 - q) at the rear", of_tyres_or_body=True
    ),
    "front_stiffness_error": Effect(
        "-", -0.4, 0.4, "front tyre stiffness times (1 + q)", tolerance="front_stiffness", of_tyres_or_body=True
    ),
    "rear_stiffness_error": Effect(
        "-", -0.4, 0.4, "rear tyre stiffness times (1 + q)", tolerance="rear_stiffness", of_tyres_or_body=True
    ),
    "tyre_relaxation": Effect(
        "m",
        0.15,
        1.0,
        "lateral slip follows the kinematic one over a rolled length q",
        spread=True,
        length=1.0,
        daily=0.2,
        of_tyres_or_body=True,
    ),
    "sliding_friction_drop": Effect(
        "-", 0.05, 0.35, "friction falls by q as the contact slides", daily=0.2, of_tyres_or_body=True
    ),
    "tyre_thermal_fade": Effect(
        "1/unit heat",
        0.05,
        0.4,
        "friction falls by q per unit of heat",
        mass=-1.0,
        length=-0.5,
        daily=0.2,
        of_tyres_or_body=True,
    ),
    "longitudinal_load_transfer": Effect(
        "m",
        0.25,
        0.7,
        "axle loads shift with a centre of gravity at height q",
        length=1.0,
        daily=0.2,
        of_tyres_or_body=True,
    ),
    "lateral_load_transfer": Effect("-", 0.05, 0.3, "friction falls by q (a_y/g)^2", daily=0.2, of_tyres_or_body=True),
    "mass_error": Effect("-", -0.12, 0.2, "mass times (1 + q)", tolerance="mass", daily=1.5, of_tyres_or_body=True),
    "yaw_inertia_error": Effect(
        "-", -0.3, 0.4, "yaw inertia times (1 + q)", tolerance="yaw_inertia", of_tyres_or_body=True
    ),
    "cg_shift": Effect(
        "m",
        -0.12,
        0.12,
        "centre of gravity moved back by q",
        tolerance="front_axle_distance",
        length=1.0,
        of_tyres_or_body=True,
    ),
    "steering_lag": Effect(
        "s", 0.03, 0.2, "first-order lag from command to road wheel", stage="actuator", spread=True, remembers=STEERING
    ),
    "steering_delay": Effect(
        "s", 0.02, 0.15, "transport delay of the steering command", stage="command", spread=True, delays="delta_cmd"
    ),
    "steering_rate_limit": Effect(
        "rad/s",
        0.3,
        1.2,
        "the road wheel moves no faster than q",
        stage="actuator",
        spread=True,
        remembers=STEERING,
        length=-0.5,
    ),
    "steering_offset": Effect(
        "rad", -0.035, 0.035, "added to the road-wheel angle", stage="actuator", tolerance="steering_offset"
    ),
    "torque_lag": Effect(
        "s",
        0.05,
        0.4,
        "first-order lag of engine torque",
        stage="actuator",
        needs=TORQUE,
        spread=True,
        remembers=TORQUE,
    ),
    "torque_gain_error": Effect("-", -0.3, 0.2, "torque at the axle times (1 + q)", needs=TORQUE, tolerance="torque"),
    "drivetrain_inertia_error": Effect(
        "-",
        -0.4,
        0.8,
        "rear axle inertia times (1 + q)",
        needs=TORQUE,
        tolerance="rear_axle_inertia",
        daily=0.2,
        of_tyres_or_body=True,
    ),
    "drivetrain_friction": Effect(
        "N m", 40.0, 300.0, "torque q tanh(omega_r) opposes the rear axle", needs=TORQUE, mass=1.0, radius=1.0
    ),
    "aero_drag": Effect("N s^2/m^2", 0.4, 2.5, "force q v^2 against the course", mass=1.0, length=-1.0, varies=True),
    "rolling_resistance": Effect("-", 0.01, 0.05, "force q m g backwards along the body", varies=True),
    "road_grade": Effect("rad", -0.06, 0.06, "the fixed frame's +x is uphill by q", needs=("psi",), varies=True),
    "differential_yaw_moment": Effect(
        "N s^2",
        40.0,
        250.0,
        "yaw moment -q r v of a locking rear axle",
        mass=1.0,
        length=1.0,
        daily=0.2,
        of_tyres_or_body=True,
    ),
    "gyro_bias": Effect(
        "rad/s", -0.04, 0.04, "added to the measured yaw rate", stage="sensor", needs=("psi",), length=-0.5, varies=True
    ),
    "sideslip_bias": Effect(
        "rad", -0.04, 0.04, "added to the measured sideslip", stage="sensor", needs=("beta",), varies=True
    ),
    "wheel_radius_error": Effect(
        "-", -0.05, 0.05, "measured rim speed times (1 + q)", stage="sensor", needs=("omega_r",), varies=True
    ),
    "sensor_latency": Effect(
        "s",
        0.02,
        0.12,
        "every measured column is late by q",
        stage="sensor",
        spread=True,
        remembers=(*STEERING, *TORQUE),
    ),
    "steering_ratio_error": Effect(
        "-", -0.3, 0.3, "commanded road-wheel angle times (1 + q)", stage="actuator", daily=0.2
    ),
    "gyro_gain_error": Effect(
        "-", -0.1, 0.1, "measured yaw rate times (1 + q)", stage="sensor", needs=("psi",), daily=0.5
    ),
    "speed_gain_error": Effect("-", -0.08, 0.08, "measured speed times (1 + q), the rim's not", stage="sensor"),
    "road_bank": Effect(
        "rad", -0.2, 0.2, "the road's left side is higher by q; where it is logged, by (1 + q) times that", varies=True
    ),
    "command_clock_error": Effect(
        "s",
        -0.1,
        0.1,
        "commands act earlier by q than the log says",
        stage="command",
        hastens=(*STEERING, *TORQUE),
        below_zero="sensor_latency",
        daily=0.5,
        remembers=(*STEERING, *TORQUE),
    ),
    "longitudinal_stiffness_error": Effect(
        "-",
        -0.5,
        1.0,
        "slope of the tyres' force along the wheel times (1 + q), not across it",
        daily=0.2,
        of_tyres_or_body=True,
    ),
}

if twice := sorted(set(OWN) & set(installed_effects())):
    raise InvalidExtensionError(f"effect {', '.join(twice)}: is in the catalogue already; give yours another name")

CATALOGUE: dict[str, Effect] = OWN | installed_effects()

OFF_THE_MOTION = tuple(name for name, effect in CATALOGUE.items() if effect.stage in ("command", "sensor"))
"""Effects that act before the plant (transport delays) or after it (the sensors'), never on its motion."""
