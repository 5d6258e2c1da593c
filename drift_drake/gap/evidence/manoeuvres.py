"""Which manoeuvre shows which effect: what to drive where logs cannot tell."""

from collections.abc import Iterable

from drift_drake.car.effects.catalogue import CATALOGUE

SHOWN_BY: tuple[tuple[str, tuple[str, ...]], ...] = (
    (
        "steps and fast sine sweeps of the steering (up to 2 Hz) at constant speed, well within grip",
        ("steering_lag", "steering_delay", "steering_rate_limit", "tyre_relaxation", "yaw_inertia_error",
         "sensor_latency", "command_clock_error"),
    ),
    (
        "steady circles to the left and to the right at several speeds, slowly tightened until the car slides",
        ("friction_level", "front_rear_friction_split", "front_stiffness_error", "rear_stiffness_error", "cg_shift",
         "lateral_load_transfer", "steering_offset", "sideslip_bias", "steering_ratio_error"),
    ),
    (
        "full throttle, part throttle and lift-off, in steps, straight on and in a turn",
        ("mass_error", "torque_gain_error", "torque_lag", "drivetrain_inertia_error", "drivetrain_friction",
         "longitudinal_load_transfer", "longitudinal_stiffness_error", "wheel_radius_error", "speed_gain_error"),
    ),
    (
        "coasting straight on from top speed to walking pace, there and back on the same road",
        ("aero_drag", "rolling_resistance", "road_grade"),
    ),
    ("standing still, then straight on for some seconds, heading logged", ("gyro_bias",)),
    ("full circles to the left and to the right, heading logged", ("gyro_gain_error",)),
    ("straight on in both directions on the same road", ("road_bank",)),
    (
        "long drifts with the rear wheels spinning, from cold tyres to hot ones",
        ("sliding_friction_drop", "tyre_thermal_fade", "differential_yaw_moment"),
    ),
)  # fmt: skip


def shown_by(effects: Iterable[str]) -> list[tuple[str, list[str]]]:
    """Manoeuvres that show some of the effects, each with those."""
    asked = set(effects)
    others = tuple((effect.shown_by, (name,)) for name, effect in CATALOGUE.items() if effect.shown_by)
    parts = [(words, [name for name in shown if name in asked]) for words, shown in (*SHOWN_BY, *others)]
    return [(words, names) for words, names in parts if names]
