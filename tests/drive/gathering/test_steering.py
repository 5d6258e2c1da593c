"""The check of a car's steering, and plans, tracking and rehearsals that know what it shows."""

import dataclasses
import math

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator

from drift_drake.car.actuated import STAGES, actuated
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.parameters import VehicleParameters
from drift_drake.drive.gathering import rehearsed_plan
from drift_drake.drive.gathering.config import RATE_SHARE, GatheringConfig
from drift_drake.drive.gathering.gather import check_steering, execution, gather, with_steering
from drift_drake.drive.gathering.plan import InfeasiblePlanError, Trajectory, plan_drive
from drift_drake.drive.gathering.rehearsed_plan import boldest, holds
from drift_drake.drive.learnt.checkpoint import BayesianModel
from drift_drake.drive.learnt.command_lag import LAGGED, lagged_commands
from drift_drake.drive.loop.drive import Drive, DriveLimits
from drift_drake.drive.manoeuvres.steering_check import ANGLE, Steering, SteeringCheck
from drift_drake.drive.mpc.plan import interpolate_knots
from experiments.benchmarks.vehicles import draw_effects

CAR, CONFIG = VehicleParameters(), GatheringConfig()


def car_with(vehicle: int, lag: float | None = None, rate: float = 0.0) -> Effects:
    drawn = draw_effects("validation", vehicle, 3)
    return drawn._replace(steering_lag=drawn.steering_lag if lag is None else lag, steering_rate_limit=rate)


@pytest.mark.parametrize("vehicle", [0, 1])
@pytest.mark.parametrize(("lag", "rate"), [(0.2, 0.0), (0.6, 0.0), (1.0, 0.0), (None, 0.2), (None, 0.35), (None, 0.7)])
def test_the_check_shows_a_lag_and_a_limit(vehicle: int, lag: float | None, rate: float) -> None:
    effects = car_with(vehicle, lag, rate)
    found = check_steering(effects, CAR, CONFIG, vehicle)
    assert not found.usual
    if rate:
        assert found.rate == pytest.approx(rate, rel=0.15)
    else:  # a front tyre that is softer than believed (by up to 0.3 here) and relaxes is late, too
        assert found.lag == pytest.approx(effects.steering_lag, rel=0.07, abs=0.04)


def test_a_typical_steering_is_as_usual() -> None:
    for vehicle in range(4):
        effects = car_with(vehicle)
        found = check_steering(effects, CAR, CONFIG, vehicle)
        assert found.usual
        assert found.lag == pytest.approx(effects.steering_lag, abs=0.04)


@pytest.mark.parametrize("effects", [
    Effects(steering_lag=1.0), Effects(steering_rate_limit=0.15), Effects(steering_offset=0.03, friction_level=-0.5),
])  # fmt: skip
def test_the_check_itself_keeps_to_the_lane(effects: Effects) -> None:
    check = SteeringCheck(CAR)
    drive = Drive(CAR, check, 1, 0.01, None, (0.0, 0.0), effects, check.lane)
    table, ending = drive.run(check.start(), 0.0, check.duration, 0, DriveLimits(min_speed=1.0))
    assert ending == "time"
    assert table["delta_cmd"].abs().max() > 0.9 * ANGLE
    assert table["e"].abs().max() < 0.5 * CONFIG.half_width


@pytest.fixture(scope="module")
def slow(model: BayesianModel) -> tuple[BayesianModel, GatheringConfig, Trajectory]:
    learnt, config = with_steering(model, CONFIG, Steering(0.15, 0.3))
    return learnt, config, plan_drive(learnt, learnt.prior(), config, config.alpha)


def test_plans_leave_the_steering_time(slow: tuple[BayesianModel, GatheringConfig, Trajectory]) -> None:
    _, config, plan = slow
    t = 0.01 * np.arange(10 * len(plan.u) - 9)
    commands = np.array([interpolate_knots(plan.u, time) for time in t])
    wheel = lagged_commands(t, commands, config.steering.lags)[:, 0]
    assert np.abs(plan.u[:, 0]).max() > 0.05
    assert np.abs(np.diff(wheel)).max() / 0.01 < 1.15 * RATE_SHARE * config.steering.rate
    np.testing.assert_allclose(wheel[::10], plan.x[:, LAGGED.start], atol=2e-3)


def test_the_tracking_follows_what_the_actuators_do(slow: tuple[BayesianModel, GatheringConfig, Trajectory]) -> None:
    """Its own account of the road wheel is the one by which logs are read."""
    _, config, plan = slow
    effects = Effects(steering_lag=0.15, torque_lag=0.1, steering_rate_limit=0.3)
    drive = execution(plan, effects, CAR, config)
    controller = drive.driver
    context = drive.diagram.CreateDefaultContext()
    plant = drive.car.plant
    plant.set_initial(plant.GetMyMutableContextFromRoot(context), plan.x[0, :6] + [0, 0, 0, 0, 0.5, 0], 0.0)
    own = controller.GetMyContextFromRoot(context)
    simulator, commands, kept = Simulator(drive.diagram, context), [], []
    for k in range(200):
        simulator.AdvanceTo(0.01 * k)
        commands.append(controller.GetOutputPort("plan").Eval(own)[1:3].copy())
        kept.append(own.get_discrete_state(0).value().copy())
    given = np.array(commands)
    wheel, torque = actuated(given[:, 0], given[:, 1], (0.0, float(plan.u[0, 1])), 0.01, effects)
    assert np.abs(np.diff(wheel[::STAGES])).max() > 0.9 * 0.3 * 0.01  # the limit is met
    for column, actual, tolerance in ((0, wheel, 2e-3), (1, torque, 1.0)):
        rows = actual[::STAGES]
        between = 0.5 * (rows[1:] + rows[:-1])  # commands are held here, linear there: half a row
        np.testing.assert_allclose(np.array(kept)[5:, column], between[4:], atol=tolerance)


def test_a_late_steering_spins_a_plan_for_a_typical_one_and_holds_its_own(model: BayesianModel) -> None:
    effects = car_with(0, 0.6)
    usual = plan_drive(model, model.prior(), CONFIG, CONFIG.alpha)
    assert gather(usual, effects, CAR, CONFIG, 0)[1] != "time"
    learnt, config = with_steering(model, CONFIG, check_steering(effects, CAR, CONFIG, 0))
    table, ending = gather(plan_drive(learnt, learnt.prior(), config, config.alpha), effects, CAR, config, 0)
    assert ending == "time"
    assert table["e"].abs().max() < CONFIG.half_width


def test_the_boldest_plan_that_holds_is_driven(model: BayesianModel) -> None:
    learnt, config = with_steering(model, CONFIG, Steering(0.05, 0.2))
    tried = list[float]()

    def plan(share: float) -> Trajectory:
        tried.append(share)
        return plan_drive(learnt, learnt.prior(), config, share * config.alpha)

    found = boldest(plan, CAR, config)
    assert tried == list(rehearsed_plan.BOLDNESS[: len(tried)])
    assert len(tried) > 1
    assert found.alpha == tried[-1] * config.alpha
    assert holds(found, CAR, config)


def test_a_car_that_no_plan_holds_is_not_driven(
    monkeypatch: pytest.MonkeyPatch, slow: tuple[BayesianModel, GatheringConfig, Trajectory]
) -> None:
    _, config, plan = slow
    monkeypatch.setattr(rehearsed_plan, "holds", lambda *_: False)
    with pytest.raises(
        InfeasiblePlanError, match=r"a steering that is 0\.15 s late, as if it turned at most 0\.3 rad/s"
    ):
        boldest(lambda _: plan, CAR, config)
    assert boldest(lambda _: plan, CAR, dataclasses.replace(config, steering=Steering())) is plan


def test_a_sentence_names_what_was_found() -> None:
    assert Steering(0.6, math.inf).sentence() == "a steering that is 0.6 s late"
