"""Effects of the body: masses, and loads that move with it."""

from drift_drake.car.effects.manoeuvres import CIRCLES, SWEEPS, THROTTLE
from drift_drake.car.effects.record import Effect, ParameterChange, normal, uniform

BODY: dict[str, Effect] = {
    "longitudinal_load_transfer": Effect(
        "m", 0.25, 0.7, "axle loads shift with a centre of gravity at height q", length=1.0, daily=0.2,
        of_tyres_or_body=True, shown_by=THROTTLE, double_track="nothing", fitted=("further", "drives"),
        drawn=uniform(0.3, 0.6), rolls=True),
    "lateral_load_transfer": Effect(
        "-", 0.05, 0.3, "friction falls by q (a_y/g)^2", daily=0.2, of_tyres_or_body=True, shown_by=CIRCLES, share=True,
        at_the_limit=True, double_track="nothing", fitted=("further", "drives"), drawn=uniform(0.05, 0.12)),
    "mass_error": Effect(
        "-", -0.12, 0.2, "mass times (1 + q)", tolerance="mass", daily=1.5, of_tyres_or_body=True, shown_by=THROTTLE,
        factor=True, drawn=uniform(-0.05, 0.12), asked=True, moves_loads=True, changes=(ParameterChange("mass"),)),
    "yaw_inertia_error": Effect(
        "-", -0.3, 0.4, "yaw inertia times (1 + q)", tolerance="yaw_inertia", of_tyres_or_body=True, shown_by=SWEEPS,
        factor=True, drawn=normal(0.1, 0.2), rolls=True, changes=(ParameterChange("yaw_inertia"),)),
    "cg_shift": Effect(
        "m", -0.12, 0.12, "centre of gravity moved back by q", tolerance="front_axle_distance", length=1.0,
        of_tyres_or_body=True, shown_by=CIRCLES, drawn_out_of_distribution=uniform(-0.06, 0.06), moves_loads=True,
        any_of_them=True, changes=(
            ParameterChange("front_axle_distance", 1.0, False), ParameterChange("rear_axle_distance", -1.0, False))),
}  # fmt: skip
