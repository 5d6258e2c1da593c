"""Predictions of the double-track car over windows: the plant's, its own states carried along what is measured."""

import dataclasses

import numpy as np
import pytest

from drift_drake.car.double_track.parameters import CARS, DoubleTrackParameters
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.log.table import Run
from drift_drake.gap.estimation.windows import HORIZONS, LARGEST_ERROR, WindowedRun, errors, windowed
from experiments.benchmarks.rows import PERIOD, advance, start

EFFECTS = Effects(steering_lag=0.06, torque_lag=0.1)
LIVELY = CARS["coupe"].replace(differential_preload=40.0, differential_share=0.2)


def rolled(car: DoubleTrackParameters, effects: Effects = EFFECTS, duration: float = 3.0) -> Run:
    """A slalom under power with nothing but what is true in its readings, by the plant's integrator."""
    rows = round(duration / PERIOD) + 1
    t = PERIOD * np.arange(rows)
    delta, tau = 0.25 * np.sin(4.0 * t), 150.0 + 120.0 * np.sin(2.5 * t)
    p = car.constants()
    z, _ = start(np.array([0.0, 10.0, 0.0, 10.0]), (delta[0], tau[0]), p, effects)
    states = [z]
    for row in range(rows - 1):
        z, _ = advance(z, row, delta, tau, p, effects)
        states.append(z)
    found = {name: np.array(states)[:, i] for i, name in enumerate(("r", "v", "beta", "omega_r", "psi"))}
    return Run(name="slalom", t=t, delta_cmd=delta, tau_cmd=tau, **found)


@pytest.fixture(scope="module")
def run() -> Run:
    return rolled(LIVELY)


@pytest.fixture(scope="module")
def seen(run: Run) -> WindowedRun:
    """Its windows, from the states themselves: no sensor's noise to smooth."""
    found = windowed(run)
    return dataclasses.replace(found, start_y=found.y)


def test_the_true_car_is_predicted_from_what_is_measured_alone(seen: WindowedRun) -> None:
    """By another integrator, and with wheels, roll and slips that nobody measured: they settle into the true ones."""
    found = errors([seen], LIVELY.constants(), EFFECTS)
    assert found.shape == (len(seen.starts), HORIZONS, 5)
    assert np.abs(found).max(axis=(0, 1)) == pytest.approx([0.0] * 5, abs=2e-4)
    assert np.ptp(seen.y[:, 3] - seen.y[:, 1]) > 2.0  # the rear wheels do spin


def test_another_car_is_not(seen: WindowedRun) -> None:
    """An open differential, and the height of the centre of gravity, each show."""
    for change in ({"differential_share": 0.0, "differential_preload": 0.0}, {"cg_height": 0.35}):
        found = errors([seen], LIVELY.replace(**change).constants(), EFFECTS)
        assert np.abs(found[:, -1]).max(axis=0).max() > 0.05


def test_sensors_errors_that_are_known_are_taken_off(seen: WindowedRun) -> None:
    biased = seen.y + np.array([0.02, 0.0, -0.03, 0.0, 0.0])
    off = dataclasses.replace(seen, y=biased, start_y=biased)
    right = errors([seen], LIVELY.constants(), EFFECTS)
    known = errors([off], LIVELY.constants(), EFFECTS._replace(gyro_bias=0.02, sideslip_bias=-0.03))
    np.testing.assert_allclose(known, right, atol=1e-9)
    assert np.abs(errors([off], LIVELY.constants(), EFFECTS)).max() > 0.02


def test_what_is_not_measured_counts_for_nothing(run: Run) -> None:
    found = windowed(dataclasses.replace(run, psi=None))
    predicted = errors([found], LIVELY.constants(), EFFECTS)
    assert not predicted[..., 4].any()
    assert predicted[..., 0].any()


def test_without_torque_the_measured_speeds_are_fed() -> None:
    """Yaw rate and sideslip are still predicted, where no torque locks the differential."""
    found = windowed(dataclasses.replace(rolled(CARS["coupe"]), tau_cmd=None))
    predicted = errors([found], CARS["coupe"].constants(), EFFECTS)
    assert not predicted[..., [1, 3]].any()
    assert np.abs(predicted[..., [0, 2]]).max() < 0.05


def test_commands_may_be_late_and_the_road_banked(run: Run) -> None:
    """Delays, latency, grade and bank act on this car as on a single-track one."""
    late = dataclasses.replace(run, delta_cmd=np.roll(run.delta_cmd, -3))  # commands are logged 0.03 s early
    seen = dataclasses.replace(windowed(late), start_y=windowed(late).y)
    plain, known = (errors([seen], LIVELY.constants(), EFFECTS._replace(steering_delay=q)) for q in (0.0, 0.03))
    assert np.abs(known[:-2]).max() < 0.2 * np.abs(plain[:-2]).max()
    flat = errors([seen], LIVELY.constants(), EFFECTS)
    for tilted in (EFFECTS._replace(road_bank=0.1), EFFECTS._replace(road_grade=0.1)):
        assert np.abs(errors([seen], LIVELY.constants(), tilted) - flat).max() > 0.1


def test_a_prediction_that_diverges_is_bounded(seen: WindowedRun) -> None:
    light = LIVELY.constants()._replace(wheel_inertia=1e-4)
    found = errors([seen], light, EFFECTS)
    assert np.isfinite(found).all()
    assert np.abs(found).max() <= LARGEST_ERROR
