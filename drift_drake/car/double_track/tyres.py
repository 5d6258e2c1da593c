"""Magic Formula tyre with load sensitivity, combined slip by similarity (Pacejka 2012, sections 1.2 and 4.2)."""

from typing import Any, NamedTuple

from drift_drake.car.scalar import atan, jitable, maximum, norm2, sin, sqrt

LEAST_FRICTION_SHARE = 0.2  # of the nominal friction, which a linear load sensitivity would undercut at some load
SLIDING_SLIP = 3.0  # [-] normalised slip at which a brush tyre slides as a whole


class TireConstants(NamedTuple):
    """The numbers that one tyre's force reads."""

    lateral_stiffness: Any  # [N per unit slip] largest, at the load `stiffest_load`
    longitudinal_stiffness: Any  # [N per unit slip] likewise
    stiffest_load: Any  # [N]
    lateral_friction: Any  # [-] at the nominal load
    longitudinal_friction: Any  # [-]
    nominal_load: Any  # [N]
    load_sensitivity: Any  # [-] relative loss of friction over a relative gain of load
    shape: Any  # [-] C of the Magic Formula
    curvature: Any  # [-] E of the Magic Formula
    lateral_relaxation: Any  # [m]
    longitudinal_relaxation: Any  # [m]


@jitable
def stiffness_per_load(largest: Any, load: Any, stiffest_load: Any) -> Any:
    """Slip stiffness over load [-], of K = largest sin(2 atan(F_z / stiffest_load)), written without either."""
    ratio = load / stiffest_load
    return 2.0 * largest / (stiffest_load * (1.0 + ratio * ratio))


@jitable
def friction_at(nominal: Any, load: Any, tire: TireConstants) -> Any:
    """Friction [-] at a load [N]: it falls linearly with the load."""
    excess = load / tire.nominal_load - 1.0
    return maximum(nominal * (1.0 - tire.load_sensitivity * excess), LEAST_FRICTION_SHARE * nominal)


@jitable
def magic_formula(slip: Any, shape: Any, curvature: Any) -> Any:
    """Force over peak force [-] at a normalised slip [-]; its slope at zero is one (B C = 1)."""
    stretched = slip / shape
    return sin(shape * atan(stretched - curvature * (stretched - atan(stretched))))


@jitable
def tire_force(sigma_x: Any, sigma_y: Any, load: Any, tire: TireConstants) -> tuple[Any, Any]:
    """Force of one tyre in the wheel frame.

    A slip is normalised by the one at which a linear tyre reaches its friction. At small slips each direction has its
    own stiffness; as the contact slides the force turns against the sliding velocity (but for the frictions' ratio).

    Args:
        sigma_x, sigma_y: longitudinal (positive driving) and lateral slip [-], slip velocity over rolling velocity.
        load: F_z [N], positive.
        tire: its numbers.

    Returns:
        (F_x, F_y) [N].
    """
    mu_x, mu_y = friction_at(tire.longitudinal_friction, load, tire), friction_at(tire.lateral_friction, load, tire)
    gain_x = stiffness_per_load(tire.longitudinal_stiffness, load, tire.stiffest_load) / mu_x
    gain_y = stiffness_per_load(tire.lateral_stiffness, load, tire.stiffest_load) / mu_y
    slip = norm2(gain_x * sigma_x, gain_y * sigma_y)
    adhering = 1.0 / (1.0 + slip * slip / (SLIDING_SLIP * SLIDING_SLIP))
    common = (1.0 - adhering) * sqrt(gain_x * gain_y)
    along = (adhering * gain_x + common) * sigma_x
    across = (adhering * gain_y + common) * sigma_y
    force = load * magic_formula(slip, tire.shape, tire.curvature) / norm2(along, across)
    return mu_x * force * along, -mu_y * force * across
