"""Further forces on the body: of the air, the road and the rear axle."""

from drift_drake.car.effects.manoeuvres import BOTH_WAYS, COASTING, DRIFTS
from drift_drake.car.effects.record import Effect, uniform
from drift_drake.car.scalar import absolute, cos, forwards, sin, switched

FORCES: dict[str, Effect] = {
    "aero_drag": Effect(
        "N s^2/m^2", 0.4, 2.5, "force q v^2 against the course", mass=1.0, length=-1.0, varies=True, shown_by=COASTING,
        resists=True, double_track="parameter", fitted=("further", "drives", "double_track"), drawn=uniform(0.4, 1.0),
        force=lambda r, v, beta, omega_r, psi, car, magnitude: (
            -magnitude * v * absolute(v) * cos(beta), -magnitude * v * absolute(v) * sin(beta), 0.0)),
    "rolling_resistance": Effect(
        "-", 0.01, 0.05, "force q m g along the body, against the motion", varies=True, shown_by=COASTING, resists=True,
        double_track="parameter", fitted=("drives", "double_track"),
        distinguished_from={"aero_drag": COASTING},  # which falls with the square of the speed
        force=lambda r, v, beta, omega_r, psi, car, magnitude: (
            -magnitude * (car.mass * car.gravity) * forwards(v), 0.0, 0.0)),
    "road_grade": Effect(
        "rad", -0.06, 0.06, "the fixed frame's +x is uphill by q", needs=("psi",), varies=True, shown_by=COASTING,
        of_road=True,
        force=lambda r, v, beta, omega_r, psi, car, magnitude: (
            -switched(car.mass * car.gravity * sin(magnitude), cos, psi),
            switched(car.mass * car.gravity * sin(magnitude), sin, psi), 0.0)),
    "differential_yaw_moment": Effect(
        "N s^2", 40.0, 250.0, "yaw moment -q r v of a locking rear axle", mass=1.0, length=1.0, daily=0.2,
        of_tyres_or_body=True, shown_by=DRIFTS, double_track="nothing", fitted=("drives",),
        drawn_out_of_distribution=uniform(40.0, 150.0),
        force=lambda r, v, beta, omega_r, psi, car, magnitude: (0.0, 0.0, -magnitude * r * absolute(v))),
    "road_bank": Effect(
        "rad", -0.2, 0.2, "the road's left side is higher by q; where it is logged, by (1 + q) times that", varies=True,
        shown_by=BOTH_WAYS, of_road=True,
        force=lambda r, v, beta, omega_r, psi, car, magnitude: (0.0, -car.mass * car.gravity * sin(magnitude), 0.0),
        since=3),
}  # fmt: skip
