"""Directions that no effect has: against logs with such a fault, and against the equation of yaw."""

import dataclasses

import numpy as np
import pytest

from drift_drake.gap.estimation.partial import (
    CLOCK,
    DRIFT,
    FREE,
    GAIN,
    TURNING,
    clock_rate,
    free_columns,
    heading_drift,
    heading_gain,
)
from drift_drake.gap.estimation.windows import PREDICTED, run_errors, windowed

PSI, R = PREDICTED.index("psi"), PREDICTED.index("r")


@pytest.fixture(scope="module")
def car(other_car):
    return other_car.found.vehicle.constants(), other_car.found.effects


@pytest.fixture(scope="module")
def logged(other_car):
    return other_car.runs[0]


def change(before, after, car):
    """What a fault of the log changes the errors by."""
    return run_errors(windowed(after), *car) - run_errors(windowed(before), *car)


def test_a_drift_of_the_heading_is_taken_off_by_its_direction(car, logged):
    off = dataclasses.replace(logged, psi=logged.psi + DRIFT * logged.period * np.arange(len(logged.psi)))
    np.testing.assert_allclose(change(logged, off, car), -heading_drift(windowed(logged)), atol=1e-9)


def test_a_gain_of_the_heading_is_taken_off_by_its_direction(car, logged):
    off = dataclasses.replace(logged, psi=(1.0 + GAIN) * logged.psi)
    moved, direction = change(logged, off, car)[..., PSI], -heading_gain(windowed(logged))[..., PSI]
    # The direction is of smoothed headings, the errors of raw ones.
    assert np.corrcoef(moved.ravel(), direction.ravel())[0, 1] > 0.99
    assert np.sum(moved * direction) / np.sum(direction**2) == pytest.approx(1.0, abs=0.02)


def test_a_clock_that_runs_fast_is_taken_off_by_its_direction(logged):
    """What is logged a time after a window's start is of a little less time after it."""
    run = windowed(logged)
    t = run.period * np.arange(len(run.y))
    run = dataclasses.replace(run, start_y=np.sin(t)[:, None] * np.arange(1.0, 6.0))
    after, start = np.array(run.horizons), t[run.starts][:, None]
    off = np.sin(start + (1.0 - CLOCK) * after) - np.sin(start + after)
    np.testing.assert_allclose(-off[..., None] * np.arange(1.0, 6.0), clock_rate(run), atol=2e-3)


def test_a_yaw_moment_turns_the_car_as_its_inertia_lets_it(car, other_car):
    runs = [windowed(other_car.runs[0])]
    at = run_errors(runs[0], *car)
    columns = free_columns(runs, *car, at)
    assert list(columns) == list(FREE)
    turned = -columns["yaw moment"][:, 0, R]  # measured less predicted, which turns faster
    first = runs[0].horizons[0]
    # Tyres hold against it.
    assert np.all((turned > 0.2 * TURNING * first) & (turned < TURNING * first))


def test_a_channel_that_is_not_measured_has_no_direction(car, other_car):
    run = windowed(dataclasses.replace(other_car.runs[0], psi=None))
    columns = free_columns([run], *car, run_errors(run, *car))
    assert not np.any(columns["heading drift"])
    assert not np.any(columns["clock rate"][..., PSI])
