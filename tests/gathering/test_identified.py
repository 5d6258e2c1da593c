"""The car that lane drives identify, and which model is believed by them."""

import numpy as np
import pandas as pd
import pytest

from drift_drake.control.double_track_step import DoubleTrackStepModel
from drift_drake.control.effects_step import EffectsStepModel
from drift_drake.control.plan import DT
from drift_drake.estimation.windows import forecast_error, windowed
from drift_drake.gathering.choice import (
    Choice,
    Findings,
    ask,
    doubts,
    findings,
    learnt_errors,
    usual_for,
)
from drift_drake.gathering.config import GatheringConfig, lane
from drift_drake.gathering.gather import gather, learn_drive
from drift_drake.gathering.identified import ONE_MORE, IdentifiedCar, identified, identified_double_track, runs_of
from drift_drake.gathering.plan import plan_again, plan_drive
from drift_drake.logs.table import InvalidLogError
from drift_drake.model.checkpoint import BayesianModel
from drift_drake.model.quality import step_model
from drift_drake.sensing.sensor_errors import sensor_errors
from drift_drake.simulation.true_plant import TruePlant, plant_of
from drift_drake.vehicle.double_track.parameters import DoubleTrackParameters
from drift_drake.vehicle.effects import Effects, make_effects
from drift_drake.vehicle.parameters import VehicleParameters

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

    monkeypatch.setattr("drift_drake.gathering.identified.identify", without_optimum)
    assert identified(runs_of(driven), VehicleParameters()) is None


def test_physics_predicts_such_a_car_better_than_what_is_learnt(
    model: BayesianModel, driven: list[pd.DataFrame], car: IdentifiedCar
) -> None:
    belief = model.prior()
    for table in driven:
        belief = learn_drive(model, belief, table, CONFIG)
    found = findings(model, belief, car, runs_of(driven), VehicleParameters())
    assert found.identified < 0.5 * found.learnt
    without = findings(model, belief, None, runs_of(driven), VehicleParameters())
    assert without == found._replace(car=None, identified=np.inf, as_it_is=np.inf)


def test_logs_in_a_wrong_unit_are_known_by_no_model(
    model: BayesianModel, driven: list[pd.DataFrame], car: IdentifiedCar
) -> None:
    wrong = [table.assign(omega_r=3.6 * table["omega_r"]) for table in driven]  # km/h
    belief, usual = model.prior(), usual_for(model)
    for table in wrong:
        belief = learn_drive(model, belief, table, CONFIG)
    assert usual is not None
    found = findings(model, belief, car, runs_of(wrong), VehicleParameters())
    assert usual.choice(found._replace(doubts=())).believed == "neither"


def test_a_bad_sample_changes_little_and_one_that_is_no_number_is_named(
    model: BayesianModel, driven: list[pd.DataFrame], car: IdentifiedCar
) -> None:
    def forecasts(tables: list[pd.DataFrame]) -> tuple[float, float]:
        found = findings(model, model.prior(), car, runs_of(tables), VehicleParameters())
        return found.learnt, found.identified

    right = forecasts(driven)
    spiked, lost = driven[0].copy(), driven[0].copy()
    spiked.loc[200, "r"] += 1.0
    assert forecasts([spiked, driven[1]]) == pytest.approx(right, rel=0.1)
    lost.loc[200, "r"] = np.nan
    with pytest.raises(InvalidLogError, match="column r is not a number in row 200"):
        forecasts([lost, driven[1]])


def test_the_learnt_models_errors_are_those_of_its_steps(model: BayesianModel, driven: list[pd.DataFrame]) -> None:
    """One window by hand: five steps from the smoothed measurement, under the commands at their ends."""
    learnt = step_model(model, model.prior())
    run = windowed(*runs_of(driven[:1]))
    start = int(run.starts[7])
    commands, lagged = np.stack([run.delta, run.tau], axis=1), np.array([run.delta[0], run.tau[0]])
    for row in range(start):  # 10 ms at a time, the exact answer of a first-order lag to a linear command
        for i, lag in enumerate((0.05, 0.10)):
            keep, slope = np.exp(-0.01 / lag), (commands[row + 1, i] - commands[row, i]) / 0.01
            straight = commands[row, i] - slope * lag  # what follows the command in steady state
            lagged[i] = straight + slope * 0.01 + keep * (lagged[i] - straight)
    x = np.concatenate([run.start_y[start, :4], [0.0, 0.0], lagged])[None]
    for h in range(5):
        at, then = start + 10 * h, start + 10 * (h + 1)
        x = learnt.step(x, commands[at : at + 1], commands[then : then + 1], np.zeros(1))
    found = learnt_errors(learnt, [run])[7, -1]
    assert found == pytest.approx(run.y[start + 50, :4] - x[0, :4], abs=1e-9)


def test_a_forecast_error_is_the_geometric_mean_of_medians() -> None:
    errors = np.zeros((3, 5, 5))
    errors[:, -1, :4] = [[0.1, 2.0, 0.1, 1.0], [-0.2, 1.0, 0.3, -4.0], [0.9, -0.5, 0.1, 2.0]]
    errors[:, -1, 4] = 100.0  # the heading is not counted
    assert forecast_error(errors) == pytest.approx((0.2 * 1.0 * 0.1 * 2.0) ** 0.25)


def test_gentle_drives_wrong_signs_and_a_car_of_another_size_are_no_ground_to_believe(
    driven: list[pd.DataFrame],
) -> None:
    car, lively = VehicleParameters(), driven
    (gentle,) = doubts(runs_of([_scaled(table, 0.5) for table in driven]), car, car)
    assert "too gentle (yaw rate times speed stays below 9.8 m/s^2 in 95 % of each): drive informative ones" in gentle
    assert doubts(runs_of(lively), car, car) == ()
    mirrored = [table.assign(beta=-table["beta"]) for table in lively]
    (sign,) = doubts(runs_of(mirrored), car, car)
    assert sign.startswith("column beta looks mirrored")
    small = car.replace(front_axle_distance=0.16, rear_axle_distance=0.17)
    size = doubts(runs_of(lively), small, car)[-1]
    assert size.startswith("the wheelbase is 0.33 m, and the model and its limits are of cars of 2.4")
    choice = Choice(Findings(None, 0.01, 0.01, (gentle,)), 0.05, 0.02)
    assert choice.believed == "neither"
    assert choice.sentence() == f"no model is believed on these drives: {gentle}"


@pytest.mark.parametrize(
    ("learnt", "identified_car", "believed", "said"),
    [
        (0.03, 0.01, "identified", "drive with the identified car"),
        (0.03, 0.02, "learnt", "drive with the learnt model"),  # its equations are not this car's
        (0.04, 0.014, "identified", "drive with the identified car"),  # a car that is known, to the other far better
        (0.06, 0.014, "neither", "no model knows this car"),
        (0.009, 0.01, "learnt", "drive with the learnt model"),
        (0.06, 0.02, "neither", "no model knows this car"),
        (0.04, float("inf"), "learnt", "drive with the learnt model"),
    ],
)
def test_a_model_is_believed_that_is_no_further_off_than_usual(
    learnt: float, identified_car: float, believed: str, said: str
) -> None:
    choice = Choice(Findings(None, learnt, identified_car), 0.05, 0.012)
    assert choice.believed == believed
    assert choice.sentence().startswith(said)


def _driven(model: BayesianModel, effects: Effects, plant: TruePlant = "single_track") -> list[pd.DataFrame]:
    """Logs of two informative drives of a car."""
    config, belief, tables = GatheringConfig(starts=1, max_iterations=40), model.prior(), list[pd.DataFrame]()
    first = plan = plan_drive(model, belief, config, config.alpha)
    for number in range(2):
        car = plant_of(plant, effects, lane(config).path)
        tables.append(gather(plan, effects, VehicleParameters(), config, number, car)[0])
        belief = learn_drive(model, belief, tables[-1], config)
        plan = plan_again(model, belief, first, config)
    return tables


def _asked(model: BayesianModel, tables: list[pd.DataFrame]) -> tuple[IdentifiedCar | None, Choice]:
    """The car that informative drives identify, and which model is believed."""
    belief, usual = model.prior(), usual_for(model)
    for table in tables:
        belief = learn_drive(model, belief, table, GatheringConfig())
    found = ask(model, belief, runs_of(tables), VehicleParameters())
    assert usual is not None
    return found.car, usual.choice(found)


def test_a_delay_of_the_steering_is_identified_and_planned_with_as_a_lag(
    model: BayesianModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("drift_drake.gathering.choice.ONE_MORE", ("gyro_bias", "steering_delay"))
    car, choice = _asked(model, _driven(model, make_effects({"steering_delay": 0.08, "steering_lag": 0.05})))
    assert car is not None
    assert car.effects.steering_delay == pytest.approx(0.08, abs=0.005)
    assert choice.found.identified < choice.identified_limit
    assert choice.believed == "identified"
    lags = car.effects._replace(steering_delay=0.0, steering_lag=car.effects.steering_lag + car.effects.steering_delay)
    x, u = np.array([[0.5, 11.0, -0.5, 16.0, 0.1, 0.02]]), np.array([[-0.1, 150.0]])
    x = np.hstack([x, car.step_model().settled(x[0, :4], u[0])[None]])
    expected = EffectsStepModel(car.vehicle, lags, exact=False).step(x, u, 1.2 * u, np.zeros(1))
    np.testing.assert_array_equal(car.step_model().step(x, u, 1.2 * u, np.zeros(1)), expected)


def test_what_no_controller_can_make_up_for_is_named() -> None:
    late = IdentifiedCar(VehicleParameters(), make_effects({"sensor_latency": 0.04, "steering_lag": 0.05}))
    choice = Choice(Findings(late, 0.03, 0.01), 0.02, 0.012)
    assert choice.believed == "neither"
    assert choice.sentence().startswith("the car is identified with sensor_latency 0.04 s, which a controller does not")
    assert late.step_model().follows_at_once().any()  # with what acts on the motion alone
    off = IdentifiedCar(VehicleParameters(), make_effects({"sideslip_bias": 0.03, "steering_lag": 0.05}))
    assert (off.beyond, sensor_errors(off.effects)) == ((), Effects(sideslip_bias=0.03))
    choice = Choice(Findings(off, 0.03, 0.01), 0.02, 0.012)
    assert choice.sentence().startswith("drive with the identified car with sideslip_bias 0.03 rad: forecast errors")
    near = Choice(Findings(None, 0.09, 0.05, hint="; 0.0125 with sensor_latency 0.05 s"), 0.04, 0.012)
    assert "0.05 for the identified car (as a rule at most 0.012; 0.0125 with sensor_latency 0.05 s)" in near.sentence()


@pytest.mark.slow
@pytest.mark.parametrize(("name", "size"), [("sensor_latency", 0.05), ("gyro_bias", 0.03), ("sideslip_bias", 0.03)])
def test_of_one_thing_more_the_right_one_is_identified(model: BayesianModel, name: str, size: float) -> None:
    car, choice = _asked(model, _driven(model, make_effects({name: size, "steering_lag": 0.05, "torque_lag": 0.1})))
    assert car is not None
    assert getattr(car.effects, name) == pytest.approx(size, rel=0.1)
    assert [one for one in ONE_MORE if getattr(car.effects, one) != 0.0] == [name]
    assert (choice.believed == "identified") == (name != "sensor_latency")


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["double_track", "roadster"])
def test_a_double_track_car_is_identified_as_one(model: BayesianModel, kind: TruePlant) -> None:
    """In informative drives, which no single-track car predicts."""
    effects = make_effects({"steering_lag": 0.05, "torque_lag": 0.1})
    car, choice = _asked(model, _driven(model, effects, kind))
    assert car is not None
    assert isinstance(car.vehicle, DoubleTrackParameters)
    assert choice.believed == "identified"
    assert choice.sentence().startswith("drive with the identified double-track car: forecast errors")
    assert choice.found.as_it_is > 3.0 * choice.found.identified
    assert isinstance(car.step_model(), DoubleTrackStepModel)


def test_drives_that_are_too_short_identify_no_double_track_car(driven: list[pd.DataFrame]) -> None:
    assert identified_double_track(runs_of([table.iloc[:150] for table in driven]), VehicleParameters()) is None
