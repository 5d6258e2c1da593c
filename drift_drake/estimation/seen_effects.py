"""Which effects the columns of a log can show."""

from collections.abc import Sequence

from drift_drake.logs.table import OPTIONAL, Run

BLIND = {  # effects that need a column to be seen
    "gyro_bias": ("psi",),
    "sideslip_bias": ("beta",),
    "wheel_radius_error": ("omega_r",),
    "road_grade": ("psi",),
    "torque_lag": ("tau_cmd",),
    "torque_gain_error": ("tau_cmd",),
    "drivetrain_inertia_error": ("tau_cmd",),
    "drivetrain_friction": ("tau_cmd",),
}


def seen_effects(runs: Sequence[Run], names: Sequence[str]) -> tuple[list[str], list[str]]:
    """Effects that the columns of the log can show, and warnings about the others and about missing columns."""
    missing = [name for name in OPTIONAL if any(run.column(name) is None for run in runs)]
    kept = [name for name in names if not set(BLIND.get(name, ())) & set(missing)]
    warnings = [f"column {name} is missing: its channel is dropped" for name in missing]
    lost = [name for name in names if name not in kept]
    if lost:
        warnings.append(f"without these columns nothing can be said of {', '.join(lost)}")
    return kept, warnings
