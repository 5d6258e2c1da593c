"""Effects of the sensors."""

from drift_drake.car.effects.manoeuvres import CIRCLES, FULL_CIRCLES, STANDING, SWEEPS, THROTTLE
from drift_drake.car.effects.record import Effect

SENSORS: dict[str, Effect] = {
    "gyro_bias": Effect(
        "rad/s", -0.04, 0.04, "added to the measured yaw rate", stage="sensor", needs=("psi",), length=-0.5,
        varies=True, shown_by=STANDING, fitted=("alone",), watched=True,
        reading=lambda r, beta, omega_r, magnitude: (magnitude, 0.0, 0.0)),
    "sideslip_bias": Effect(
        "rad", -0.04, 0.04, "added to the measured sideslip", stage="sensor", needs=("beta",), varies=True,
        shown_by=CIRCLES, fitted=("alone",), watched=True,
        reading=lambda r, beta, omega_r, magnitude: (0.0, magnitude, 0.0)),
    "wheel_radius_error": Effect(
        "-", -0.05, 0.05, "measured rim speed times (1 + q)", stage="sensor", needs=("omega_r",), varies=True,
        shown_by=THROTTLE, factor=True, scales="omega_r"),
    "sensor_latency": Effect(
        "s", 0.02, 0.12, "every measured column is late by q", stage="sensor", spread=True, late=True,
        remembers=("delta_cmd", "tau_cmd"), shown_by=SWEEPS, fitted=("alone",)),
    "gyro_gain_error": Effect(
        "-", -0.1, 0.1, "measured yaw rate times (1 + q)", stage="sensor", needs=("psi",), daily=0.5,
        shown_by=FULL_CIRCLES, factor=True, scales="r", since=2),
    "speed_gain_error": Effect(
        "-", -0.08, 0.08, "measured speed times (1 + q), the rim's not", stage="sensor", shown_by=THROTTLE, factor=True,
        scales="v", since=2),
}  # fmt: skip
