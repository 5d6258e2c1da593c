"""Brush (Fiala) tyre with isotropic combined slip (Svendenius 2007; the nominal simulator's tyre)."""

from typing import Any

from drift_drake.vehicle.scalar import jitable, select


@jitable
def brush_secant(sigma: Any, stiffness: Any, peak: Any) -> tuple[Any, Any]:
    """Force over slip, F(sigma) / sigma, and its derivative with respect to sigma.

    F = q - q^2/(3 mu F_z) + q^3/(27 mu^2 F_z^2), q = C sigma below 3 mu F_z, and mu F_z beyond.

    Args:
        sigma: combined slip [-], positive.
        stiffness: C, slope of the force at zero slip [N per unit slip].
        peak: mu F_z, the largest force [N].

    Returns:
        (F / sigma [N], d(F / sigma) / d(sigma) [N]). The secant rather than the force is regular at zero slip.
    """
    full_slide = 3.0 * peak
    q = stiffness * sigma
    # The grip branch is evaluated at q = 0 when sliding and the sliding branch at the limit when gripping, so that the
    # branch not taken is finite too.
    grip_q = select(q, full_slide, q, 0.0 * q)
    grip = stiffness * (1.0 - grip_q / full_slide + grip_q * grip_q / (3.0 * full_slide * full_slide))
    grip_slope = stiffness * stiffness * (-1.0 / full_slide + 2.0 * grip_q / (3.0 * full_slide * full_slide))
    slide_sigma = select(q, full_slide, full_slide / stiffness + 0.0 * sigma, sigma)
    slide = peak / slide_sigma
    slide_slope = -peak / (slide_sigma * slide_sigma)
    return select(q, full_slide, grip, slide), select(q, full_slide, grip_slope, slide_slope)
