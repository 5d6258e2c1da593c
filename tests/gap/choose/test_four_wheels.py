"""A car of four wheels from nine seconds of lively driving: what is found, and what is never no car."""

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np
import pytest

from drift_drake.car.brush.parameters import BrushParameters
from drift_drake.car.double_track.nearest import nearest_double_track
from drift_drake.car.double_track.parameters import CARS, DoubleTrackParameters
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.equations_step import EquationsStepModel
from drift_drake.car.log.table import Run
from drift_drake.car.parameters import CarParameters, VehicleParameters
from drift_drake.gap.choose.choice import ask
from drift_drake.gap.choose.identified import IdentifiedCar, identified_with_own_states
from drift_drake.gap.estimation.windows import WindowedRun, errors, forecast_error, windowed
from drift_drake.gap.identification.identify import identify
from experiments.benchmarks.compiled_cases import NOISE
from experiments.benchmarks.rows import PERIOD, advance, start
from experiments.other_worlds.brush_drifters import draw_drifter

TRUE = Effects(steering_lag=0.05, torque_lag=0.12)
CAR = CARS["coupe"].replace(cg_height=0.56, differential_preload=80.0, differential_share=0.25)


def driven(car: CarParameters, seed: int, duration: float = 4.5) -> Run:
    """A lively drive along a lane, with sensors' noise: the driver turns the wheel against the course."""
    rng, rows = np.random.default_rng(seed), round(duration / PERIOD) + 1
    t = PERIOD * np.arange(rows)
    phase, rate = rng.uniform(0.0, 6.0), rng.uniform(3.6, 4.6)
    delta, tau = np.zeros(rows), np.zeros(rows)
    p = car.constants()
    z, _ = start(np.array([0.0, 9.0, 0.0, 9.0]), (0.0, 100.0), p, TRUE)
    states = [z]
    for row in range(rows - 1):
        swing = 0.3 * np.sin(rate * t[row] + phase) * min(2.0 * t[row], 1.0)
        delta[row + 1] = np.clip(swing - 0.8 * (z[4] + z[2]) - 0.25 * z[0], -0.6, 0.6)
        tau[row + 1] = 180.0 + 150.0 * np.sin(2.7 * t[row] + phase)
        z, _ = advance(z, row, delta, tau, p, TRUE)
        states.append(z)
    columns = {name: np.array(states)[:, i] for i, name in enumerate(("r", "v", "beta", "omega_r", "psi"))}
    read = {name: values + NOISE[name] * rng.standard_normal(rows) for name, values in columns.items()}
    return Run(name=f"drive_{seed}", t=t, delta_cmd=delta, tau_cmd=tau, **read)


@pytest.fixture(scope="module")
def drives() -> list[Run]:
    return [driven(CAR, seed) for seed in (1, 2)]


@pytest.fixture(scope="module")
def seen(drives: list[Run]) -> list[WindowedRun]:
    return [windowed(run) for run in drives]


@pytest.fixture(scope="module")
def found(seen: list[WindowedRun]) -> IdentifiedCar:
    return identified_again(seen)[0]


def identified_again(
    seen: list[WindowedRun], more: Sequence[str] = (), near: Mapping[str, float] | None = None
) -> tuple[IdentifiedCar, dict[str, float]]:
    """The car, and the magnitudes of all that was unknown of it."""
    car = identified_with_own_states(seen, VehicleParameters(), more, near)
    assert car is not None
    return car


def test_drives_are_lively(drives: list[Run]) -> None:
    for run in drives:
        assert run.beta is not None
        assert np.abs(run.beta).max() > 0.1
        assert np.percentile(np.abs(run.v * run.r), 95) > 8.0


def test_it_predicts_drives_that_it_was_not_fitted_to_as_the_true_car_does(
    found: IdentifiedCar,
) -> None:
    fresh = [windowed(driven(CAR, seed)) for seed in (3, 4)]
    car, effects = found
    true = forecast_error(errors(fresh, CAR.constants(), TRUE))
    assert forecast_error(errors(fresh, car.constants(), effects)) < 1.3 * true
    guess = nearest_double_track(VehicleParameters())
    assert forecast_error(errors(fresh, guess.constants(), Effects())) > 5.0 * true


def test_no_single_track_car_predicts_them_so(drives: list[Run], seen: list[WindowedRun], found: IdentifiedCar) -> None:
    single = identify(drives, VehicleParameters(), known=(), criterion="likelihood", watching=False)
    single_error = forecast_error(errors(seen, single.vehicle.constants(), single.effects))
    assert forecast_error(errors(seen, found.vehicle.constants(), found.effects)) < 0.5 * single_error


def test_a_first_guess_on_brush_tyres_is_identified_as_that_and_chosen() -> None:
    car = draw_drifter(1, 7)
    drives, fresh = [driven(car, seed) for seed in (1, 2)], [windowed(driven(car, seed)) for seed in (3, 4)]
    found = ask(drives, BrushParameters()).found.car
    assert found is not None
    assert found.name == "the identified brush car"
    assert isinstance(found.vehicle, BrushParameters)
    true = forecast_error(errors(fresh, car.constants(), TRUE))
    assert forecast_error(errors(fresh, found.vehicle.constants(), found.effects)) < 1.5 * true
    assert isinstance(found.step_model(), EquationsStepModel)


def test_lags_and_the_locking_differential_are_found(found: IdentifiedCar) -> None:
    car, effects = found
    assert effects.steering_lag == pytest.approx(TRUE.steering_lag, abs=0.01)
    assert effects.torque_lag == pytest.approx(TRUE.torque_lag, abs=0.02)
    assert isinstance(car, DoubleTrackParameters)
    locking = car.differential_preload + car.differential_share * 2000.0
    assert locking == pytest.approx(CAR.differential_preload + CAR.differential_share * 2000.0, rel=0.3)


@pytest.mark.slow
def test_sensors_that_are_off_are_found_with_it(drives: list[Run]) -> None:
    off = [windowed(dataclasses.replace(run, r=run.r + 0.02, beta=run.beta - 0.03)) for run in drives]
    (plain, none), near = identified_again(off)
    (car, effects), _ = identified_again(off, ("gyro_bias", "sideslip_bias"), near)
    assert effects.gyro_bias == pytest.approx(0.02, abs=0.004)
    assert effects.sideslip_bias == pytest.approx(-0.03, abs=0.004)
    errors_of = [forecast_error(errors(off, one.constants(), q)) for one, q in ((car, effects), (plain, none))]
    assert errors_of[0] < 0.5 * errors_of[1]
