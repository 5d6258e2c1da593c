"""The tyre of a car: the brush tyre, or one of another package, found by its entry point.

A package names a tyre in its pyproject.toml, and a vehicle file asks for it with `tyre: smooth`:

    [project.entry-points."drift_drake.tyres"]
    smooth = "my_package.tyres:smooth"

A tyre is one function, its secant. Forces are isotropic in combined slip, without states of the tyre's own: what it
gives along and across follows from the one length of the slip.
"""

import math
from collections.abc import Callable
from functools import cache
from typing import Any, Protocol

from drift_drake.car.effects.record import InvalidExtensionError
from drift_drake.car.effects.trial import TYRES as TYRE_POINTS
from drift_drake.car.effects.trial import extensions, loaded, see_that_they_end
from drift_drake.car.scalar import jitable, norm2, select
from drift_drake.common.errors import one_line

TRIAL_SLIPS = (1e-9, 0.01, 0.04, 0.15, 0.5, 3.0)
TRIAL_STIFFNESS, TRIAL_PEAK = 1.4e5, 8000.0  # [N per unit slip], [N]
STEP, LOOSE = 1e-6, 1e-3  # relative, of a difference, and of what it is held to


@jitable
def brush_secant(sigma: Any, stiffness: Any, peak: Any) -> tuple[Any, Any]:
    """The brush (Fiala) tyre (Svendenius 2007): force over slip, F(sigma) / sigma, and its derivative by sigma.

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


class Tyre(Protocol):
    """Force over slip of one axle, as a function of the combined slip: the whole of a tyre.

    Plain arithmetic and the functions of `drift_drake.car.scalar` (exp, tanh, atan, select, ...), finite for every
    positive slip, since it is compiled, and evaluated on complex numbers and Drake's scalars.

    Slip sigma [-], stiffness at zero slip [N per unit slip] and largest force [N] give F / sigma [N] and its derivative
    by sigma [N]; numbers, not arrays. `InvalidExtensionError` says what is wrong with a tyre when it is loaded.

    Examples:
        >>> def saturating(sigma, stiffness, peak):  # F = peak tanh(C sigma / peak), by the secant
        ...     force = tanh(stiffness * sigma / peak)
        ...     return peak * force / sigma, (stiffness * (1.0 - force**2) - peak * force / sigma) / sigma
    """

    def __call__(self, sigma: Any, stiffness: Any, peak: Any) -> tuple[Any, Any]:
        """The secant F / sigma [N] and its derivative with respect to sigma [N].

        Args:
            sigma: combined slip [-], positive; stiffness: slope of the force at zero slip [N per unit slip]; peak: the
                largest force, friction times load [N].
        """


@cache
def installed_tyres() -> dict[str, Callable[..., Any]]:
    """Tyres of other packages by name, in the order of their names.

    Raises:
        InvalidExtensionError: one cannot be imported, or is none, or two have one name.
    """
    points = extensions(TYRE_POINTS)
    for where, point in points.items():
        if point.name == "brush":
            raise InvalidExtensionError(f"{where}: brush is there already; give yours another name")
    see_that_they_end(points, try_tyres)
    return {point.name: _checked(where, loaded(where, point)) for where, point in points.items()}


def try_tyres(begin: Callable[[str], None]) -> None:
    """Loads and checks all, for a process of its own (`trial`).

    Args:
        begin: called with what messages call a tyre, as its turn comes.

    Raises:
        InvalidExtensionError: one cannot be used.
    """
    for where, point in extensions(TYRE_POINTS).items():
        begin(where)
        _checked(where, loaded(where, point))


def _checked(where: str, tyre: Any) -> Callable[..., Any]:
    """Sees that a function is a tyre's secant: its slope at zero slip, its peak, its derivative."""
    for sigma in TRIAL_SLIPS:
        try:
            (secant, slope), (after, _) = (
                map(float, tyre(at, TRIAL_STIFFNESS, TRIAL_PEAK)) for at in (sigma, sigma * (1.0 + STEP))
            )
        except Exception as error:
            raise InvalidExtensionError(
                f"{where}: fails at a slip of {sigma:g} ({one_line(error)}); correct it"
            ) from None
        if not 0.0 <= secant * sigma <= TRIAL_PEAK * (1.0 + LOOSE):
            raise InvalidExtensionError(
                f"{where}: gives {secant * sigma:g} N at a slip of {sigma:g} and a peak of {TRIAL_PEAK:g} N; let it "
                "give the force over the slip, and forces within the peak"
            )
        # Of the secant times 1 / sigma, so that what is small relative to it does not matter.
        if not math.isclose((after - secant) / STEP, slope * sigma, rel_tol=LOOSE, abs_tol=LOOSE * secant):
            raise InvalidExtensionError(
                f"{where}: its derivative at a slip of {sigma:g} is {slope:g} N, but by differences "
                f"{(after - secant) / STEP / sigma:g} N; correct it"
            )
    start, _ = tyre(TRIAL_SLIPS[0], TRIAL_STIFFNESS, TRIAL_PEAK)
    if not math.isclose(start, TRIAL_STIFFNESS, rel_tol=LOOSE):
        raise InvalidExtensionError(
            f"{where}: its slope at zero slip is {start:g} N, not the stiffness; scale its slip"
        )
    return tyre  # type: ignore[no-any-return]


TYRES: dict[str, Callable[..., Any]] = {"brush": brush_secant, **installed_tyres()}
"""Tyres by name; `Constants.tyre` is a place in it."""


def _or(before: Any, own: Any, place: int) -> Callable[..., Any]:
    def secant(sigma: Any, stiffness: Any, peak: Any, kind: Any) -> Any:
        one, other = before(sigma, stiffness, peak, kind), own(sigma, stiffness, peak)
        return select(kind, place - 0.5, one[0], other[0]), select(kind, place - 0.5, one[1], other[1])

    return secant


def _chosen() -> Callable[..., Any]:
    """One function of all tyres, which takes the tyre's place as its last argument."""
    chain = jitable(lambda sigma, stiffness, peak, kind: brush_secant(sigma, stiffness, peak))  # noqa: ARG005
    for place, own in enumerate(installed_tyres().values(), 1):
        chain = jitable(_or(chain, jitable(own), place))
    return chain


tyre_secant = _chosen()


@jitable
def tyre_force(sigma_x: Any, sigma_y: Any, stiffness: Any, peak: Any, kind: Any) -> tuple[Any, Any]:
    """Force (F_x, F_y) [N] of one axle in the wheel frame: F(sigma) / sigma * (sigma_x, -sigma_y).

    Args:
        sigma_x, sigma_y: longitudinal (positive driving) and lateral slip [-].
        stiffness: C [N per unit slip]; peak: friction times load [N]; kind: the tyre's place in `TYRES`.
    """
    secant, _ = tyre_secant(norm2(sigma_x, sigma_y), stiffness, peak, kind)
    return secant * sigma_x, -secant * sigma_y


@jitable
def tyre_gradient(
    sigma_x: Any, sigma_y: Any, stiffness: Any, peak: Any, kind: Any
) -> tuple[Any, Any, Any, Any, Any, Any]:
    """(F_x, F_y, dF_x/dsigma_x, dF_x/dsigma_y, dF_y/dsigma_x, dF_y/dsigma_y) of one axle."""
    sigma = norm2(sigma_x, sigma_y)
    secant, slope = tyre_secant(sigma, stiffness, peak, kind)
    slope_over_sigma = slope / sigma
    cross = slope_over_sigma * sigma_x * sigma_y
    return (secant * sigma_x, -secant * sigma_y, secant + slope_over_sigma * sigma_x * sigma_x, cross, -cross,
            -(secant + slope_over_sigma * sigma_y * sigma_y))  # fmt: skip
