"""Days of double-track cars: what is written, and that it is what was asked for."""

import dataclasses
import json

import numpy as np
import pytest

from drift_drake.car.double_track.parameters import CARS
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.log.table import read_case
from drift_drake.car.vehicle_file import read_vehicle
from experiments.other_worlds.days import RANGE, Days, drawn_effects, first_guess, main, make_day, smoothed
from experiments.other_worlds.double_track import simulate
from experiments.other_worlds.drivers import DAY_ONE, OTHER, DayDriver
from experiments.other_worlds.strange_faults import STRANGE


def short(tmp_path, **changes):
    return dataclasses.replace(Days(tmp_path, duration=1.0), **changes)


def test_writes_day_one_the_other_days_a_first_guess_and_labels(tmp_path):
    main(short(tmp_path, car="roadster", none=1, count=1, other_drives=True))
    labels = json.loads((tmp_path / "labels.json").read_text())
    assert [label["drives"] for label in labels.values()] == ["other", "other"]
    assert [list(label["effects"]) for label in labels.values()] == [[], ["friction_level"]]
    for name in ("day_one", *labels):
        runs = read_case(tmp_path / name)
        assert len(runs) == 4
        assert all(len(run) == 101 for run in runs)
        assert all(run.psi is not None and run.ax is not None and run.tau_cmd is not None for run in runs)
    parameters, effects = read_vehicle(tmp_path / "start.yaml")
    assert effects == Effects()
    assert parameters.mass == CARS["roadster"].mass
    assert json.loads((tmp_path / "truth.json").read_text())["gear_ratio"] == CARS["roadster"].gear_ratio


def test_days_have_one_effect_of_the_range_each(tmp_path):
    days = drawn_effects(Days(tmp_path, none=3, count=2 * len(RANGE)))
    assert days[:3] == [{}, {}, {}]
    names = [next(iter(day)) for day in days[3:]]
    assert names == list(RANGE) * 2
    for day in days[3:]:
        ((name, value),) = day.items()
        low, high = RANGE[name]
        assert min(abs(low), abs(high)) <= abs(value) <= max(abs(low), abs(high))
    assert days[3] != days[3 + len(RANGE)]


def test_a_day_is_made_again_from_its_seed_and_smoothing_alone_sets_a_smoothed_one_apart(tmp_path):
    plain = short(tmp_path, seed=2)
    first, again, other = (make_day(c, {}, ("slalom",), 0)[0] for c in (plain, plain, short(tmp_path, seed=3)))
    np.testing.assert_array_equal(first.r, again.r)
    assert not np.any(first.r == other.r)
    (low_passed,) = make_day(short(tmp_path, seed=2, smooth=8.0), {}, ("slalom",), 0)
    np.testing.assert_array_equal(low_passed.delta_cmd, first.delta_cmd)
    np.testing.assert_array_equal(low_passed.r, smoothed(first, 8.0).r)
    assert np.std(np.diff(low_passed.r, 3)) < 0.5 * np.std(np.diff(first.r, 3))  # of noise nearly all


@pytest.mark.parametrize("car", CARS)
@pytest.mark.parametrize("kind", DAY_ONE + OTHER)
def test_every_driver_keeps_every_car_on_its_wheels(car, kind):
    rng = np.random.default_rng(0)
    run = simulate(CARS[car], Effects(), DayDriver(kind, rng, CARS[car]), rng, "run_0", 12.0)
    assert run.t[-1] == pytest.approx(12.0)


def test_sensors_effects_change_the_log_and_not_the_motion(tmp_path):
    config = short(tmp_path)
    plain, biased = (make_day(config, e, ("power",), 0)[0] for e in ({}, {"gyro_bias": 0.03}))
    np.testing.assert_allclose(biased.r - plain.r, 0.03)
    np.testing.assert_array_equal(biased.v, plain.v)


def test_the_first_guess_knows_all_but_the_tyres():
    guess, car = first_guess("saloon"), CARS["saloon"].single_track()
    assert guess.replace(
        friction=car.friction,
        front_stiffness=car.front_stiffness,
        rear_stiffness=car.rear_stiffness,
        tolerance=car.tolerance,
    ) == car  # fmt: skip
    assert abs(guess.rear_stiffness / car.rear_stiffness - 1.0) > 0.05


def test_a_driver_catches_a_car_that_slides():
    driver = DayDriver("slalom", np.random.default_rng(0), CARS["coupe"])
    delta, tau = driver.command(1.0, np.array([0.5, 12.0, -0.4, 12.0]), (-0.3, 60.0))
    assert delta < -0.3
    assert tau < 60.0


@pytest.mark.parametrize("smooth", [-1.0, 50.0])
def test_a_smoothing_beyond_the_log_is_refused(tmp_path, smooth):
    with pytest.raises(ValueError, match=r"smooth is .* Hz; give 0 for none, or less than 50 Hz"):
        Days(tmp_path, smooth=smooth)


def test_an_unknown_manoeuvre_is_refused():
    with pytest.raises(ValueError, match="unknown manoeuvre figure_8; there are slalom, "):
        DayDriver("figure_8", np.random.default_rng(0), CARS["coupe"])


def test_a_gentle_first_day_is_steered_by_its_share(tmp_path):
    (hard,) = make_day(short(tmp_path), {}, ("slalom",), 0)
    (gentle,) = make_day(short(tmp_path), {}, ("slalom",), 0, 0.3)
    assert np.max(np.abs(gentle.delta_cmd)) == pytest.approx(0.3 * np.max(np.abs(hard.delta_cmd)), rel=0.05)
    assert len(gentle) == len(hard)


@pytest.mark.parametrize("effort", [0.0, 1.5])
def test_an_effort_that_is_no_share_is_refused(tmp_path, effort):
    with pytest.raises(ValueError, match=r"first-effort is .* give more than 0 and at most 1"):
        Days(tmp_path, first_effort=effort)


def test_strange_days_come_behind_the_others_each_of_another_kind(tmp_path):
    main(short(tmp_path, none=1, count=0, strange=2, first_runs=6))
    labels = json.loads((tmp_path / "labels.json").read_text())
    assert [label["strange"] for label in labels.values()] == [None, *list(STRANGE)[:2]]
    assert not any(label["effects"] for label in labels.values())
    assert len(read_case(tmp_path / "day_one")) == 6
    code = list(labels)[1]
    (healthy, *_), (strange, *_) = make_day(short(tmp_path), {}, DAY_ONE, 2), read_case(tmp_path / code)
    np.testing.assert_allclose(strange.beta, (1.0 - labels[code]["strange_magnitude"]) * healthy.beta, atol=1e-8)
    np.testing.assert_allclose(strange.r, healthy.r, atol=1e-8)


def test_more_first_runs_begin_with_the_usual_ones(tmp_path):
    usual, more = (make_day(short(tmp_path), {}, kinds, 0) for kinds in (DAY_ONE, (*DAY_ONE, "slalom")))
    np.testing.assert_array_equal(more[3].r, usual[3].r)
    with pytest.raises(ValueError, match=r"first-runs is 0; give 1 or more"):
        short(tmp_path, first_runs=0)
