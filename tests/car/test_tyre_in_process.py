"""Tyres without entry points: which one a place chooses, and what is seen to before one is taken."""

import math
from collections.abc import Callable

import pytest

from drift_drake.car import tyre
from drift_drake.car.effects.record import InvalidExtensionError
from drift_drake.car.tyre import brush_secant, tyre_force, tyre_gradient

STIFFNESS, PEAK = 1.4e5, 8000.0
Secant = Callable[[float, float, float], tuple[float, float]]


def smooth(sigma: float, stiffness: float, peak: float) -> tuple[float, float]:
    force = math.tanh(stiffness * sigma / peak)
    slope = stiffness * (1.0 - force * force)
    return peak * force / sigma, (slope - peak * force / sigma) / sigma


def rational(sigma: float, stiffness: float, peak: float) -> tuple[float, float]:
    """F = C sigma / (1 + C sigma / peak)."""
    ratio = 1.0 + stiffness * sigma / peak
    return stiffness / ratio, -stiffness * stiffness / (peak * ratio * ratio)


@pytest.fixture
def chosen(monkeypatch: pytest.MonkeyPatch) -> Callable[..., tuple[float, float]]:
    """All of them as one function, as on an installation with two packages; nothing is compiled."""
    monkeypatch.setattr(tyre, "installed_tyres", lambda: {"rational": rational, "smooth": smooth})
    monkeypatch.setattr(tyre, "jitable", lambda function: function)
    return tyre._chosen()


def test_each_place_has_its_tyre(chosen: Callable[..., tuple[float, float]]) -> None:
    for place, one in enumerate((brush_secant, rational, smooth)):
        for sigma in (0.01, 0.1, 0.8):
            assert chosen(sigma, STIFFNESS, PEAK, float(place)) == pytest.approx(one(sigma, STIFFNESS, PEAK), rel=1e-12)


@pytest.mark.parametrize("secant", [brush_secant, smooth, rational])
def test_good_ones_are_taken(secant: Secant) -> None:
    assert tyre._checked("one", secant) is secant


def scaled(force: float, slope: float) -> Secant:
    """The smooth tyre with its secant and derivative times these."""

    def changed(sigma: float, stiffness: float, peak: float) -> tuple[float, float]:
        found = smooth(sigma, stiffness, peak)
        return force * found[0], slope * found[1]

    return changed


@pytest.mark.parametrize(
    ("secant", "says"),
    [
        (
            scaled(1.1, 1.1),
            f"gives {1.1 * PEAK * math.tanh(0.15 * STIFFNESS / PEAK):g} N at a slip of 0.15 and a peak of",
        ),
        (scaled(-1.0, -1.0), r"gives -0.00014 N at a slip of 1e-09 and"),
        (scaled(1.0, 1.05), r"its derivative at a slip of 0.01 is -.* N, but by differences -.* N; correct it"),
        (scaled(1.0, -1.0), r"its derivative at a slip of 0.01 is .* N, but by differences -.* N"),
        (scaled(0.95, 0.95), r"its slope at zero slip is 133000 N, not the stiffness; scale its slip"),
    ],
)
def test_one_with_a_wrong_number_is_refused(secant: Secant, says: str) -> None:
    with pytest.raises(InvalidExtensionError, match=f"^one: {says}"):
        tyre._checked("one", secant)


def test_the_differences_that_a_message_names_are_the_derivative() -> None:
    with pytest.raises(InvalidExtensionError) as error:
        tyre._checked("one", scaled(1.0, 2.0))
    _, named = str(error.value).split("by differences ")
    assert float(named.split()[0]) == pytest.approx(smooth(0.01, STIFFNESS, PEAK)[1], rel=1e-3)


def test_the_force_acts_against_the_slip_across_and_with_it_along() -> None:
    """Of the brush tyre in full slide: the peak, in the direction of the slip, whose derivative turns it alone."""
    sigma_x, sigma_y = 0.6, 0.8
    force = tyre_force(sigma_x, sigma_y, STIFFNESS, PEAK, 0.0)
    assert force == pytest.approx((0.6 * PEAK, -0.8 * PEAK))
    f_x, f_y, xx, xy, yx, yy = tyre_gradient(sigma_x, sigma_y, STIFFNESS, PEAK, 0.0)
    assert (f_x, f_y) == force
    # F = peak s / |s|, so that dF/ds = peak (1 - s s' / |s|^2) / |s|, and the sign across.
    assert (xx, xy, yx, yy) == pytest.approx((0.64 * PEAK, -0.48 * PEAK, 0.48 * PEAK, -0.36 * PEAK))
