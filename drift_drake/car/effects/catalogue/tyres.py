"""Effects of the tyres."""

from drift_drake.car.effects.manoeuvres import CIRCLES, DRIFTS, SWEEPS, THROTTLE
from drift_drake.car.effects.record import Effect, ParameterChange, normal, uniform

TYRES: dict[str, Effect] = {
    "friction_level": Effect(
        "-", -0.35, 0.2, "friction of both axles times (1 + q)", tolerance="friction", daily=2.0, varies=True,
        of_tyres_or_body=True, shown_by=CIRCLES, factor=True, saturates=True, drawn=normal(0.08, 0.16, mean=-0.04),
        asked=True, watched=True, any_of_them=True,
        changes=tuple(map(ParameterChange, ("friction", "front_friction", "rear_friction")))),
    "front_rear_friction_split": Effect(
        "-", -0.2, 0.2, "friction times (1 + q) in front, (1 - q) at the rear", of_tyres_or_body=True, shown_by=CIRCLES,
        factor=True, share=True, saturates=True, at_the_limit=True, double_track="parameter",
        fitted=("further", "drives", "double_track"), drawn=normal(0.04, 0.08),
        changes=(ParameterChange("front_friction"), ParameterChange("rear_friction", -1.0))),
    "front_stiffness_error": Effect(
        "-", -0.4, 0.4, "front tyre stiffness times (1 + q)", tolerance="front_stiffness", of_tyres_or_body=True,
        shown_by=CIRCLES, factor=True, saturates=True, drawn=normal(0.15, 0.3),
        changes=(ParameterChange("front_stiffness"),)),
    "rear_stiffness_error": Effect(
        "-", -0.4, 0.4, "rear tyre stiffness times (1 + q)", tolerance="rear_stiffness", of_tyres_or_body=True,
        shown_by=CIRCLES, factor=True, saturates=True, drawn=normal(0.15, 0.3), asked=True,
        changes=(ParameterChange("rear_stiffness"),)),
    "tyre_relaxation": Effect(
        "m", 0.15, 1.0, "lateral slip follows the kinematic one over a rolled length q", spread=True, length=1.0,
        daily=0.2, of_tyres_or_body=True, shown_by=SWEEPS, double_track="parameter", fitted=("further", "drives"),
        drawn=uniform(0.15, 0.5), changes=(ParameterChange("tyre_relaxation", 1.0, False),)),
    "sliding_friction_drop": Effect(
        "-", 0.05, 0.35, "friction falls by q as the contact slides", daily=0.2, of_tyres_or_body=True, shown_by=DRIFTS,
        share=True, at_the_limit=True, double_track="nothing", fitted=("further", "drives"), drawn=uniform(0.05, 0.15)),
    "tyre_thermal_fade": Effect(
        "1/unit heat", 0.05, 0.4, "friction falls by q per unit of heat", mass=-1.0, length=-0.5, daily=0.2,
        of_tyres_or_body=True, shown_by=DRIFTS, at_the_limit=True, double_track="nothing", fitted=("alone",)),
    "longitudinal_stiffness_error": Effect(
        "-", -0.5, 1.0, "slope of the tyres' force along the wheel times (1 + q), not across it", daily=0.2,
        of_tyres_or_body=True, shown_by=THROTTLE, double_track="nothing", factor=True, fitted=("further", "drives"),
        changes=(ParameterChange("longitudinal_stiffness"),), since=5),
}  # fmt: skip
