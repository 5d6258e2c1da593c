"""The two-way estimate of magnitudes over cars and days: Gaussian conditioning, coverage, and what it must not say."""

import numpy as np
import pytest

from drift_drake.gap.monitoring import fleet_parts
from drift_drake.gap.monitoring.fleet_parts import parts_of


def names(prefix: str, count: int) -> list[str]:
    return [f"{prefix}{i}" for i in range(count)]


def test_at_known_widths_the_parts_are_those_of_gaussian_conditioning(monkeypatch: pytest.MonkeyPatch) -> None:
    """With one width each the estimate is the mean of a normal distribution given the table."""
    monkeypatch.setattr(fleet_parts, "WIDTHS", (0.3,))
    rng = np.random.default_rng(1)
    y = rng.normal(size=(3, 4))
    y[0, 1] = y[2, 3] = np.nan
    at, day = np.nonzero(np.isfinite(y))
    t = day / 3.0 - 0.5
    same_car, same_day = at[:, None] == at, day[:, None] == day
    shared = 1.0 + np.outer(t, t)
    covariance = shared + 0.09 * (same_car * (1.0 + np.outer(t, t)) + same_day) + (0.04 + 0.09) * np.eye(len(t))
    mean = 0.09 * (at == 2) @ np.linalg.solve(covariance, y[at, day])
    variance = 0.09 - 0.09**2 * (at == 2) @ np.linalg.solve(covariance, 1.0 * (at == 2))
    found = parts_of(y, np.full(y.shape, 0.04), names("car", 3), names("day", 4), 1.0).cars["car2"]
    assert found.estimate == pytest.approx(mean)
    assert found.high - found.estimate == pytest.approx(1.96 * np.sqrt(variance), rel=1e-3)


def test_intervals_hold_the_truth_as_often_as_they_say() -> None:
    """Fleets of all kinds, a fifth of the days missing: the share that is held is 0.95 or more, within its scatter."""
    rng, held = np.random.default_rng(2), []
    t = np.arange(4) / 3.0 - 0.5
    for _ in range(25):
        widths, (common, drift) = 10.0 ** rng.uniform(-2.5, -0.5, 4), 0.3 * rng.normal(size=2)
        own, own_drift = (width * rng.normal(size=5) for width in widths[:2])
        daily = widths[2] * rng.normal(size=4)
        y = common + drift * t + own[:, None] + own_drift[:, None] * t + daily
        y += np.hypot(widths[3], 0.05) * rng.normal(size=y.shape)
        y[rng.random(y.shape) < 0.2] = np.nan
        found = parts_of(y, np.full(y.shape, 0.05**2), names("car", 5), names("day", 4), 1.0)
        assert found.common is not None
        assert found.drift is not None
        truth = [common, drift, *own, *own_drift, *daily]
        intervals = [found.common, found.drift, *found.cars.values(), *found.drifts.values(), *found.days.values()]
        held += [q.low < x < q.high for q, x in zip(intervals, truth, strict=True)]
    assert np.mean(held) + 3.0 * np.sqrt(0.95 * 0.05 / len(held)) > 0.95


def test_cars_that_share_no_day_do_not_show_whether_it_was_the_car_or_the_season() -> None:
    y = np.full((2, 4), np.nan)
    y[0, :2], y[1, 2:] = 0.0, 0.8
    found = parts_of(y, np.full(y.shape, 1e-4), names("car", 2), names("day", 4), 1.0)
    assert found.drift is not None
    assert found.drift.low < 0.0 < found.drift.high
    assert all(q.low < 0.0 < q.high for q in found.cars.values())
