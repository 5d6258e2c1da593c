"""Effects in part of the driving: functions of the driving, and columns against a simulated fault."""

import dataclasses

import numpy as np
import pytest

from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.gap.estimation.partial import (
    DRIVING,
    FREE,
    LARGEST,
    PARTIAL,
    Partial,
    driving,
    partial_columns,
    partial_effects,
    standards,
)
from drift_drake.gap.estimation.scores import make_day
from drift_drake.gap.estimation.windows import HORIZONS, windowed


@pytest.fixture(scope="module")
def runs(other_car):
    return [windowed(run) for run in other_car.runs]


def test_partial_effects_are_of_the_catalogue_and_of_known_functions():
    assert all(p.effect in CATALOGUE and p.driving in DRIVING for p in PARTIAL if p.driving)
    assert [p.effect for p in PARTIAL if not p.driving] == [*FREE]
    assert len(set(PARTIAL)) == len(PARTIAL)
    assert partial_effects(("gyro_bias",)) == [p for p in PARTIAL if p.effect == "gyro_bias" or not p.driving]
    assert str(partial_effects(("gyro_bias",))[0]) == "gyro_bias by direction of the turn"


def test_functions_of_the_driving_are_read_in_the_middle_of_a_window(runs):
    found = driving(runs[:1])
    run = runs[0]
    middle = run.starts + HORIZONS * run.stride_rows // 2
    np.testing.assert_allclose(found[:, DRIVING.index("speed")], run.start_y[middle, 1])
    np.testing.assert_allclose(found[:, DRIVING.index("time in the run")], middle * run.period)
    np.testing.assert_allclose(found[:, DRIVING.index("lateral acceleration")],
                               np.abs(run.start_y[middle, 0] * run.start_y[middle, 1]))  # fmt: skip
    assert np.all(np.abs(found[:, DRIVING.index("direction of steering")]) <= 1.0)
    mean, deviation = standards(runs)
    assert mean.shape == deviation.shape == (len(DRIVING),)
    assert np.all(deviation > 0.0)


def test_a_column_is_the_effects_times_the_function_in_its_standard_deviations(other_car, runs):
    n, car = other_car.normal, other_car.found
    day = make_day(runs, car.vehicle.constants(), car.effects, n.names, n.units, n)
    free = {name: np.full(day.jacobian.shape[:2], 7.0) for name in FREE}
    there, columns = partial_columns(day.jacobian[:, :, : len(n.names)], n.names, runs, n.standard, free)
    assert np.all(columns[:, :, there.index(Partial("clock rate"))] == 7.0)
    assert len(there) == columns.shape[-1] == day.jacobian.shape[-1] - len(n.names)
    at = there.index(("sideslip_bias", "sideslip"))
    share = (driving(runs)[:, DRIVING.index("sideslip")] - n.standard[0, -1]) / n.standard[1, -1]
    own = day.jacobian[:, :, n.names.index("sideslip_bias")]
    np.testing.assert_allclose(columns[:, :, at], own * np.clip(share, -LARGEST, LARGEST)[:, None])


def test_a_sideslip_sensor_whose_gain_is_off_acts_like_its_partial_effect(other_car, runs):
    """Errors that a gain of 1.02 adds are in the direction of `sideslip_bias by sideslip`."""
    n, car = other_car.normal, other_car.found
    day = make_day(runs, car.vehicle.constants(), car.effects, n.names, n.units, n)
    off = [windowed(dataclasses.replace(run, beta=1.02 * run.beta)) for run in other_car.runs]
    moved = make_day(off, car.vehicle.constants(), car.effects, n.names, n.units, n).errors - day.errors
    change = (moved / n.scales).reshape(len(moved), -1)
    there = partial_effects(n.names)
    columns = day.jacobian[:, :, len(n.names) :]

    def alike(name):
        column = columns[:, :, there.index(("sideslip_bias", name))]
        return abs(np.sum(change * column)) / (np.linalg.norm(change) * np.linalg.norm(column))

    assert alike("sideslip") > 0.8
    assert alike("sideslip") > alike("time in the run")
