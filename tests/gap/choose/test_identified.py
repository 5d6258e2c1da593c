"""The car that lane drives identify, and which model is believed by them."""

import numpy as np
import pandas as pd
import pytest

from drift_drake.car.double_track.parameters import CARS, DoubleTrackParameters
from drift_drake.car.effects.magnitudes import Effects, make_effects
from drift_drake.car.equations_step import EquationsStepModel
from drift_drake.car.log.cases import runs_of
from drift_drake.car.log.table import InvalidLogError
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.sensor_errors import sensor_errors
from drift_drake.car.single_track.effects_step import EffectsStepModel
from drift_drake.drive.gathering.config import GatheringConfig, lane
from drift_drake.drive.gathering.gather import gather, learn_drive
from drift_drake.drive.gathering.plan import plan_again, plan_drive
from drift_drake.drive.learnt.checkpoint import BayesianModel
from drift_drake.drive.mpc.plan import DT
from drift_drake.gap.choose import choice as choice_module
from drift_drake.gap.choose.choice import Choice, Findings, ask, car_error, doubts, usual_error
from drift_drake.gap.choose.identified import ONE_MORE, IdentifiedCar, identified, identified_with_own_states
from drift_drake.gap.estimation.windows import forecast_error, windowed
from drift_drake.gap.identification.estimate import effect_ranges
from experiments.benchmarks.vehicles import draw_effects
from experiments.gathering.beliefs import informative_drives
from experiments.other_worlds.true_cars import OwnCar, true_plant

CONFIG = GatheringConfig(v_end=14.0, starts=1)
SLOW = make_effects({"steering_lag": 0.15, "friction_level": -0.2})


@pytest.fixture(scope="module")
def driven(model: BayesianModel) -> list[pd.DataFrame]:
    """Logs of two slaloms along the lane: 9 s."""
    t, tables = DT * np.arange(CONFIG.steps + 1), []
    for number, (size, period) in enumerate(((1.2, 1.6), (0.6, 1.1))):
        lateral = size * np.sin(2.0 * np.pi * t / period) * np.minimum(t, 1.0)
        plan = plan_drive(model, model.prior(), CONFIG, 0.0, lateral=lateral)
        tables.append(gather(plan, SLOW, VehicleParameters(), CONFIG, number)[0])
    return tables


def _scaled(table: pd.DataFrame, share: float) -> pd.DataFrame:
    return table.assign(**{name: share * table[name] for name in ("r", "beta", "delta_cmd")})


@pytest.fixture(scope="module")
def car(driven: list[pd.DataFrame]) -> IdentifiedCar:
    found = identified(runs_of(driven), VehicleParameters())
    assert found is not None
    return found


def test_a_car_beyond_those_trained_on_is_identified_along_a_lane(car: IdentifiedCar) -> None:
    assert car.effects.steering_lag == pytest.approx(0.15, abs=0.015)
    assert car.vehicle.friction == pytest.approx(0.8 * VehicleParameters().friction, rel=0.05)


def test_effects_that_it_has_not_are_left_out(car: IdentifiedCar) -> None:
    """At the least of a range above zero, an effect would rather not be there."""
    for name in ("tyre_relaxation", "longitudinal_load_transfer", "lateral_load_transfer", "sliding_friction_drop"):
        assert getattr(car.effects, name) == 0.0


def test_drives_that_are_too_short_identify_none(driven: list[pd.DataFrame]) -> None:
    assert identified(runs_of([table.iloc[:150] for table in driven]), VehicleParameters()) is None


def test_a_car_whose_likelihood_has_no_optimum_is_not_identified(
    driven: list[pd.DataFrame], monkeypatch: pytest.MonkeyPatch
) -> None:
    """As of a 1:10 car's logs, from the starter vehicle."""

    def without_optimum(*_: object, **__: object) -> None:
        VehicleParameters().replace(mass=np.nan)

    monkeypatch.setattr("drift_drake.gap.choose.identified.calibrate", without_optimum)
    assert identified(runs_of(driven), VehicleParameters()) is None


def test_logs_in_a_wrong_unit_identify_no_car_that_is_believed(driven: list[pd.DataFrame], car: IdentifiedCar) -> None:
    """A rim speed in km/h, if no check had refused it."""
    wrong = [windowed(run) for run in runs_of([table.assign(omega_r=3.6 * table["omega_r"]) for table in driven])]
    assert car_error(car, wrong) > 2.0 * usual_error().limit()
    assert car_error(car, [windowed(run) for run in runs_of(driven)]) < 2.0 * usual_error().limit()
    assert car_error(None, wrong) == np.inf


def test_a_bad_sample_changes_little_and_one_that_is_no_number_is_named(
    driven: list[pd.DataFrame], car: IdentifiedCar
) -> None:
    def forecasts(tables: list[pd.DataFrame]) -> float:
        return car_error(car, [windowed(run) for run in runs_of(tables)])

    right = forecasts(driven)
    spiked, lost = driven[0].copy(), driven[0].copy()
    spiked.loc[200, "r"] += 1.0
    assert forecasts([spiked, driven[1]]) == pytest.approx(right, rel=0.1)
    lost.loc[200, "r"] = np.nan
    with pytest.raises(InvalidLogError, match="column r is not a number in row 200"):
        forecasts([lost, driven[1]])


def test_a_forecast_error_is_the_geometric_mean_of_medians() -> None:
    errors = np.zeros((3, 5, 5))
    errors[:, -1, :4] = [[0.1, 2.0, 0.1, 1.0], [-0.2, 1.0, 0.3, -4.0], [0.9, -0.5, 0.1, 2.0]]
    errors[:, -1, 4] = 100.0  # the heading is not counted
    assert forecast_error(errors) == pytest.approx((0.2 * 1.0 * 0.1 * 2.0) ** 0.25)


def test_gentle_drives_wrong_signs_and_a_car_of_another_size_are_no_ground_to_believe(
    driven: list[pd.DataFrame],
) -> None:
    car, lively = VehicleParameters(), driven
    (gentle,) = doubts(runs_of([_scaled(table, 0.5) for table in driven]), car)
    assert "too gentle (yaw rate times speed stays below 9.8 m/s^2 in 95 % of each): drive informative ones" in gentle
    assert doubts(runs_of(lively), car) == ()
    mirrored = [table.assign(beta=-table["beta"]) for table in lively]
    (sign,) = doubts(runs_of(mirrored), car)
    assert sign.startswith("column beta looks mirrored")
    small = car.replace(front_axle_distance=0.16, rear_axle_distance=0.17)
    size = doubts(runs_of(lively), small)[-1]
    assert size.startswith("the wheelbase is 0.33 m, and the learnt model and the limit are of cars of 2.4")
    choice = Choice(Findings(None, 0.01, (gentle,)), 0.02)
    assert choice.believed == "adapting"
    assert choice.sentence() == f"no model is believed on these drives: {gentle}"


@pytest.mark.parametrize(
    ("error", "believed", "said"),
    [
        (
            0.01,
            "identified",
            "drive with the identified car: half a second ahead the identified car is off by 0.01 (as",
        ),
        (0.02, "adapting", "no model is known to hold for this car: let the learnt model adapt as it drives"),
        (float("inf"), "adapting", "no model is known to hold for this car: let the learnt model adapt as it drives"),
    ],
)
def test_a_car_is_believed_that_predicts_as_is_usual(error: float, believed: str, said: str) -> None:
    choice = Choice(Findings(None, error), 0.012)
    assert choice.believed == believed
    assert choice.sentence().startswith(said)
    assert ("no car was identified" in choice.sentence()) == np.isinf(error)


def test_a_car_that_is_near_is_driven_with_what_it_leaves_over() -> None:
    near = Findings(IdentifiedCar(VehicleParameters(), Effects()), 0.03, surprise=6.0)
    choice = Choice(near, 0.012, surprise_limit=10.0)
    assert choice.believed == "hybrid"
    assert choice.sentence().startswith("drive with the identified car and learn what it leaves over")
    assert Choice(near, 0.012, surprise_limit=5.0).believed == "adapting"
    assert Choice(near._replace(doubts=("a column is wrong",)), 0.012, surprise_limit=10.0).believed == "adapting"
    assert Choice(near, 0.04, surprise_limit=10.0).believed == "identified"


def _driven(model: BayesianModel, effects: Effects, plant: OwnCar = "single_track") -> list[pd.DataFrame]:
    """Logs of two informative drives of a car."""
    config, belief, tables = GatheringConfig(starts=1, max_iterations=40), model.prior(), list[pd.DataFrame]()
    first = plan = plan_drive(model, belief, config, config.alpha)
    for number in range(2):
        car = true_plant(plant, effects, lane(config).path)
        tables.append(gather(plan, effects, VehicleParameters(), config, number, car)[0])
        belief = learn_drive(model, belief, tables[-1], config)
        plan = plan_again(model, belief, first, config)
    return tables


def _asked(tables: list[pd.DataFrame]) -> tuple[IdentifiedCar | None, Choice]:
    """The car that informative drives identify, and whether it is believed."""
    choice = ask(runs_of(tables), VehicleParameters())
    return choice.found.car, choice


@pytest.mark.parametrize(
    ("errors", "taken", "hint"),
    [
        ({"": 0.01}, "", ""),
        ({"": 0.05, "gyro_bias": 0.01}, "gyro_bias", ""),
        ({"": 0.05, "gyro_bias": 0.03, "double": 0.01}, "double", ""),
        ({"": 0.05, "gyro_bias": 0.03, "double": 0.02, "biased": 0.009}, "biased", ""),
        (
            {"": 0.05, "gyro_bias": 0.03, "double": 0.014, "biased": 0.012},
            "",
            "; 0.014 for the identified double-track",
        ),
        ({"": 0.03, "gyro_bias": 0.025, "double": 0.02, "biased": 0.019}, "", ""),
        ({}, "", ""),
    ],
)
def test_a_car_is_asked_for_more_only_where_it_is_not_yet_known(
    driven: list[pd.DataFrame], monkeypatch: pytest.MonkeyPatch, errors: dict[str, float], taken: str, hint: str
) -> None:
    """As it is, with an additional fault, as a double-track car, and as one whose sensors are off by far."""
    asked = []

    def single(
        _runs: object, _guess: object, more: tuple[str, ...] = (), start: Effects = Effects()
    ) -> IdentifiedCar | None:
        assert start == Effects()
        asked.append(more[0] if more else "")
        known = errors.get(asked[-1])
        return known and IdentifiedCar(VehicleParameters(), Effects()._replace(aero_drag=known))

    def double(
        _runs: object, _guess: object, more: tuple[str, ...] = (), near: dict[str, float] | None = None
    ) -> tuple[IdentifiedCar, dict[str, float]] | None:
        asked.append("biased" if more else "double")
        assert near == ({"mass_error": 0.1} if more and "double" in errors else None)
        known = errors.get(asked[-1])
        return known and (IdentifiedCar(CARS["coupe"], Effects()._replace(aero_drag=known)), {"mass_error": 0.1})

    monkeypatch.setattr(choice_module, "identified", single)
    monkeypatch.setattr(choice_module, "identified_with_own_states", double)
    monkeypatch.setattr(choice_module, "car_error", lambda car, _: car.effects.aero_drag if car else np.inf)
    monkeypatch.setattr(choice_module, "doubts", lambda *_: ())
    choice = ask(runs_of(driven), VehicleParameters())
    assert choice.found.error == errors.get(taken, np.inf)
    assert choice.found.as_it_is == errors.get("", np.inf)
    assert choice.found.hint.startswith(hint)
    assert bool(choice.found.hint) == bool(hint)
    assert ("gyro_bias" in asked) == (errors.get("", 1.0) > 0.0128)
    assert ("double" in asked) == (min(errors.get(name, 1.0) for name in ("", "gyro_bias")) > 0.0128)
    assert ("biased" in asked) == (min(errors.get(name, 1.0) for name in ("", "gyro_bias", "double")) > 0.0128)


def test_a_delay_of_the_steering_is_identified_and_planned_with_as_a_lag(
    model: BayesianModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("drift_drake.gap.choose.choice.ONE_MORE", ("gyro_bias", "steering_delay"))
    car, choice = _asked(_driven(model, make_effects({"steering_delay": 0.08, "steering_lag": 0.05})))
    assert car is not None
    assert car.effects.steering_delay == pytest.approx(0.08, abs=0.005)
    assert choice.found.error < choice.limit
    assert choice.believed == "identified"
    lags = car.effects._replace(steering_delay=0.0, steering_lag=car.effects.steering_lag + car.effects.steering_delay)
    x, u = np.array([[0.5, 11.0, -0.5, 16.0, 0.1, 0.02]]), np.array([[-0.1, 150.0]])
    x = np.hstack([x, car.step_model().settled(x[0, :4], u[0])[None]])
    expected = EffectsStepModel(car.vehicle, lags).step(x, u, 1.2 * u, np.zeros(1))
    np.testing.assert_array_equal(car.step_model().step(x, u, 1.2 * u, np.zeros(1)), expected)


def test_what_no_controller_can_make_up_for_is_named() -> None:
    early = IdentifiedCar(VehicleParameters(), make_effects({"command_clock_error": 0.04, "steering_lag": 0.05}))
    choice = Choice(Findings(early, 0.01), 0.012)
    assert choice.believed == "adapting"
    assert choice.sentence().startswith("the car is identified with command_clock_error 0.04 s, which a controller")
    assert early.step_model().follows_at_once().any()  # with what acts on the motion alone
    uphill = IdentifiedCar(VehicleParameters(), make_effects({"road_grade": 0.04}))
    assert (uphill.beyond, uphill.step_model().headed) == ((), True)
    late = IdentifiedCar(VehicleParameters(), make_effects({"sensor_latency": 0.04, "steering_rate_limit": 0.6}))
    assert (late.beyond, sensor_errors(late.effects)) == ((), Effects(sensor_latency=0.04))
    assert late.step_model().effects.steering_rate_limit == pytest.approx(0.54)  # less than it may have
    off = IdentifiedCar(VehicleParameters(), make_effects({"sideslip_bias": 0.03, "steering_lag": 0.05}))
    assert (off.beyond, sensor_errors(off.effects)) == ((), Effects(sideslip_bias=0.03))
    choice = Choice(Findings(off, 0.01), 0.012)
    assert choice.sentence().startswith(
        "drive with the identified car with sideslip_bias 0.03 rad: half a second ahead"
    )
    near = Choice(Findings(None, 0.05, hint="; 0.0125 for the identified double-track car"), 0.012)
    assert "off by 0.05 (as a rule at most 0.012; 0.0125 for the identified double-track car)" in near.sentence()


def test_a_limit_that_a_check_showed_is_the_cars_where_its_drives_showed_none() -> None:
    car = IdentifiedCar(VehicleParameters(), Effects(steering_lag=0.05))
    assert car.with_limit(0.5).effects == Effects(steering_lag=0.05, steering_rate_limit=0.5)
    assert car.with_limit(np.inf) is car
    assert car.with_limit(0.5).with_limit(0.7).effects.steering_rate_limit == 0.5


@pytest.mark.slow
def test_a_limit_that_is_met_is_not_taken_for_a_lag(model: BayesianModel) -> None:
    """Where the check has shown one: a fit without that start ends at a lag of 0.3 s and no limit."""
    effects = draw_effects("held_out", 3, 291205)._replace(steering_rate_limit=0.7)
    config = GatheringConfig()
    driven = informative_drives(model, plan_drive(model, model.prior(), config, config.alpha), effects, config, 0)
    choice = ask(runs_of(driven.tables), VehicleParameters(), steering=driven.config.steering)
    assert choice.believed == "identified"
    assert choice.found.car is not None
    assert choice.found.car.effects.steering_rate_limit == pytest.approx(0.7, rel=0.03)
    assert choice.found.car.effects.steering_lag == pytest.approx(effects.steering_lag, abs=0.01)


def test_a_lag_of_the_first_guess_lies_within_its_range(driven: list[pd.DataFrame]) -> None:
    asked = ["steering_lag"], VehicleParameters(), runs_of(driven)
    assert effect_ranges(*asked, Effects(steering_lag=0.7)) == {"steering_lag": (0.0, 1.4)}
    assert effect_ranges(*asked) == {"steering_lag": (0.0, 0.5)}


@pytest.mark.slow
@pytest.mark.parametrize(("name", "size"), [("sensor_latency", 0.05), ("gyro_bias", 0.03), ("sideslip_bias", 0.03)])
def test_of_one_additional_fault_the_right_one_is_identified(model: BayesianModel, name: str, size: float) -> None:
    car, choice = _asked(_driven(model, make_effects({name: size, "steering_lag": 0.05, "torque_lag": 0.1})))
    assert car is not None
    assert getattr(car.effects, name) == pytest.approx(size, rel=0.1)
    assert [one for one in ONE_MORE if getattr(car.effects, one) != 0.0] == [name]
    assert choice.believed == "identified"


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["double_track", "roadster"])
def test_a_double_track_car_is_identified_as_one(model: BayesianModel, kind: OwnCar) -> None:
    """In informative drives, which no single-track car predicts."""
    effects = make_effects({"steering_lag": 0.05, "torque_lag": 0.1})
    car, choice = _asked(_driven(model, effects, kind))
    assert car is not None
    assert isinstance(car.vehicle, DoubleTrackParameters)
    assert choice.believed == "identified"
    assert choice.sentence().startswith("drive with the identified double-track car: half a second")
    assert choice.found.as_it_is > 3.0 * choice.found.error
    assert isinstance(car.step_model(), EquationsStepModel)


def test_drives_that_are_too_short_identify_no_double_track_car(driven: list[pd.DataFrame]) -> None:
    short = [windowed(run) for run in runs_of([table.iloc[:150] for table in driven])]
    assert identified_with_own_states(short, VehicleParameters()) is None
