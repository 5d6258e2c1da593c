"""How far samples are off what is stated of them, against simulated errors and the distributions that they follow."""

import numpy as np
import pytest
from scipy.stats import f

from drift_drake.drive.learnt.noise import Noise, within

COUNT = 4000


def squared_distances(scale: float, seed: int = 0, count: int = COUNT) -> np.ndarray:
    """Of samples [count, 4] whose errors are so many times the stated ones."""
    return np.asarray(np.sum((scale * np.random.default_rng(seed).standard_normal((count, 4))) ** 2, axis=1))


def after(squares: np.ndarray) -> list[Noise]:
    noise = [Noise()]
    for squared in squares:
        noise.append(noise[-1].after(float(squared)))
    return noise


@pytest.mark.parametrize("scale", [0.5, 1.0, 3.0])
def test_the_factor_is_that_of_the_samples_and_their_share_the_one_asked_for(scale: float) -> None:
    squares = squared_distances(scale)
    factors = np.array([noise.factor for noise in after(squares)[50:]])
    assert np.sqrt(np.mean(factors**2)) == pytest.approx(scale, rel=0.03)
    for share in (0.5, 0.95):
        assert np.mean(within(squares, share)[50:]) == pytest.approx(share, abs=0.02)


def test_what_is_stated_alone_holds_too_few_where_the_car_is_another() -> None:
    assert np.mean(squared_distances(3.0) <= 4.0 * f(4, 1e9).ppf(0.95)) < 0.2


def test_a_change_of_noise_is_followed_within_a_second() -> None:
    squares = np.concatenate([squared_distances(1.0, 1, 200), squared_distances(3.0, 2, 200)])
    noise = after(squares)
    assert noise[200].factor < 1.7
    assert noise[210].factor > 2.0


def test_the_region_is_students() -> None:
    """Its squared radius is four times a quantile of Fisher's distribution, by the variance (Gelman et al. 2013)."""
    noise = Noise(20.0, 45.0)
    assert noise.squared_radius(0.95) == pytest.approx(45.0 / 20.0 * 4.0 * f(4, 20.0).ppf(0.95))


def test_a_sample_is_judged_by_those_before_it_alone() -> None:
    squares = squared_distances(1.0, count=30)
    changed = squares.copy()
    changed[20:] = 1e6
    np.testing.assert_array_equal(within(squares, 0.95)[:20], within(changed, 0.95)[:20])
    assert not within(changed, 0.95)[20]
