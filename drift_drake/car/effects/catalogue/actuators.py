"""Effects of the actuators and of the drivetrain, and times of the commands."""

from drift_drake.car.effects.manoeuvres import CIRCLES, COASTING, FULL_THROTTLE, SPINNING, SWEEPS, THROTTLE
from drift_drake.car.effects.record import Command, Effect, ParameterChange, normal, uniform

STEERING: tuple[Command, ...] = ("delta_cmd",)
TORQUE: tuple[Command, ...] = ("tau_cmd",)

ACTUATORS: dict[str, Effect] = {
    "steering_lag": Effect(
        "s", 0.03, 0.2, "first-order lag from command to road wheel", stage="actuator", spread=True, remembers=STEERING,
        shown_by=SWEEPS, fitted=("further", "drives", "double_track"), drawn=uniform(0.03, 0.07), watched=True),
    "steering_delay": Effect(
        "s", 0.02, 0.15, "transport delay of the steering command", stage="command", spread=True, delays="delta_cmd",
        shown_by=SWEEPS, fitted=("alone",), asked=True,
        distinguished_from={"steering_lag": SWEEPS}),  # which loses more of it
    "steering_rate_limit": Effect(
        "rad/s", 0.3, 1.2, "the road wheel moves no faster than q", stage="actuator", spread=True, remembers=STEERING,
        length=-0.5, shown_by=SWEEPS, limit=True, possible=(0.01, 100.0), fitted=("alone",)),
    "steering_offset": Effect(
        "rad", -0.035, 0.035, "added to the road-wheel angle", stage="actuator", tolerance="steering_offset",
        shown_by=CIRCLES, drawn_out_of_distribution=uniform(-0.015, 0.015), watched=True),
    "torque_lag": Effect(
        "s", 0.05, 0.4, "first-order lag of engine torque", stage="actuator", needs=TORQUE, spread=True,
        remembers=TORQUE, shown_by=THROTTLE, fitted=("further", "drives", "double_track"), drawn=uniform(0.05, 0.15),
        watched=True),
    "torque_gain_error": Effect(
        "-", -0.3, 0.2, "torque at the axle times (1 + q)", needs=TORQUE, tolerance="torque", shown_by=THROTTLE,
        factor=True, drawn=normal(0.07, 0.14), asked=True, watched=True, by_torque=True,
        distinguished_from={"mass_error": SPINNING}),  # where the body weighs nothing
    "drivetrain_inertia_error": Effect(
        "-", -0.4, 0.8, "rear axle inertia times (1 + q)", needs=TORQUE, tolerance="rear_axle_inertia", daily=0.2,
        of_tyres_or_body=True, shown_by=THROTTLE, factor=True, drawn_out_of_distribution=uniform(-0.2, 0.4),
        changes=(ParameterChange("rear_axle_inertia"),)),
    "drivetrain_friction": Effect(
        "N m", 40.0, 300.0, "torque q tanh(omega_r) opposes the rear axle", needs=TORQUE, mass=1.0, radius=1.0,
        shown_by=THROTTLE, resists=True, fitted=("drives", "double_track"),
        drawn_out_of_distribution=uniform(40.0, 150.0), by_torque=True,
        distinguished_from={"rolling_resistance": SPINNING, "aero_drag": COASTING}),
    "power_limit": Effect(
        "kW", 50.0, 250.0, "the engine's power at the rear axle is at most q", needs=(*TORQUE, "omega_r"), spread=True,
        mass=1.0, length=0.5, daily=0.5, shown_by=FULL_THROTTLE, limit=True, possible=(1e-4, 1e5), fitted=("alone",),
        by_torque=True, distinguished_from={"torque_gain_error": FULL_THROTTLE}, since=6),
    "steering_ratio_error": Effect(
        "-", -0.3, 0.3, "commanded road-wheel angle times (1 + q)", stage="actuator", daily=0.2, shown_by=CIRCLES,
        factor=True, watched=True, since=2),
    "command_clock_error": Effect(
        "s", -0.1, 0.1, "commands act earlier by q than the log says", stage="command", hastens=(*STEERING, *TORQUE),
        below_zero="sensor_latency", daily=0.5, remembers=(*STEERING, *TORQUE), shown_by=SWEEPS, since=4),
}  # fmt: skip
