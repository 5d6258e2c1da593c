"""`Mpc` as a plain object: plans from a state, one after the other."""

import numpy as np
import pytest

from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.single_track.effects_step import EffectsStepModel
from drift_drake.car.step_model import INPUT_SCALE, NominalStepModel
from drift_drake.common.arrays import Array
from drift_drake.drive.mpc.mpc import FOLLOWED, LOOK, Mpc, MpcSolution, NoPlanError, SolveStatistics
from drift_drake.drive.mpc.plan import Plan, no_plan
from drift_drake.drive.reference.trajectory import Reference
from experiments.benchmarks.vehicles import draw_effects

CAR = VehicleParameters()
START = 20.0  # [m] along the figure-8


@pytest.fixture(scope="module")
def mpc(references: dict[str, Reference]) -> Mpc:
    delta, tau = references["figure_8"].input(START)
    return Mpc(NominalStepModel(CAR), CAR, references["figure_8"], 10, initial_command=(float(delta), float(tau)))


def test_plans_go_on_from_one_another(mpc: Mpc) -> None:
    x = mpc.reference.state(START) + np.array([0.0, 0.0, 0.0, 0.0, 0.3, 0.0])
    first = mpc.solve(x, START, 1.0)
    assert first.plan.start == pytest.approx(1.0 + mpc.delay)
    assert first.plan.u.shape == (11, 2)
    np.testing.assert_allclose(first.x[0, :6], x, atol=0.02)
    second = mpc.solve(x, START + 0.127, 1.01, first)
    np.testing.assert_allclose(
        second.plan.u[0] / INPUT_SCALE, first.plan.command(second.plan.start) / INPUT_SCALE, atol=1e-3
    )
    again = mpc.solve(x, START + 0.127, 1.01, first)
    np.testing.assert_array_equal(again.primal, second.primal)  # nothing is kept between solves


def plan_with(mpc: Mpc, s: float, x: Array, steering: Array | float) -> MpcSolution:
    """A solution from a state whose steering is this one [26] instead, as if it had slipped there."""
    solution = mpc.solve(x, s, 0.0)
    states, inputs, slack = mpc.problem.unstack(solution.primal)
    inputs[:, 0] = steering
    return solution._replace(primal=mpc.problem.stack(states, inputs, slack), dual=np.zeros(mpc.multiplier_count))


def planned_in_place(
    mpc: Mpc, s: float, x: Array, steering: Array, command: tuple[float, float]
) -> list[SolveStatistics]:
    """What 60 plans say, all at one place with one command in force, that start from a plan with this steering [26]."""
    held, solution, found = np.tile(command, (26, 1)), plan_with(mpc, s, x, steering), []
    for k in range(60):
        solution = mpc.solve(x, s, 0.01 * k, solution._replace(plan=Plan(0.01 * k, held)))
        found.append(solution.statistics)
    return found


def test_another_local_optimum_is_found_while_the_worse_one_is_followed(references: dict[str, Reference]) -> None:
    """Before a drift to the other side: a front tyre that slides at full lock costs ten times as much as counter-steer.

    Every iteration from that plan converges well, so that only a plan from a fresh guess shows the other.
    """
    reference, command = references["figure_8"], (-0.26, 62.0)
    mpc = Mpc(NominalStepModel(CAR), CAR, reference, initial_command=command)
    s, x = 281.8, np.array([-1.40, 13.4, -0.066, 13.5, 0.0, 0.01])
    found = planned_in_place(mpc, s, x, np.maximum(command[0] - 0.2 * np.arange(26), -CAR.steering_limit), command)
    before = [one.cost for one in found if one.restart != FOLLOWED]
    followed = [k for k, one in enumerate(found) if one.restart == FOLLOWED]
    assert max(before) > 100.0
    assert len(followed) == 1
    assert followed[0] * 0.01 < LOOK + 0.2  # the other guess does not keep the reference's waiting
    assert found[followed[0]].cost < 12.0
    assert found[-1].cost < 12.0


def test_a_front_tyre_that_slides_at_its_lock_grips_again(references: dict[str, Reference]) -> None:
    """Before a drift to the other side, on the vehicle out of distribution that spun there.

    From the reference's steering the SQP ends at the lock again; from the other lock it does not.
    """
    model, command = EffectsStepModel(CAR, draw_effects("wide", 17, 240811)), np.array([-CAR.steering_limit, 263.0])
    mpc = Mpc(model, CAR, references["figure_8"], initial_command=(command[0], command[1]))
    s, state = 142.0, np.array([-0.525, 10.73, 0.43, 17.7, -0.526, 0.0])
    x = np.append(state, model.settled(state[:4], command))
    solution, found = plan_with(mpc, s, x, command[0]), []
    for k in range(1, 91):
        ahead = model.step(x[None], command[None], command[None], mpc.reference.path.curvature(np.array([s])))[0]
        x, s, t = x + 0.1 * (ahead - x), s + 0.01 * x[1], 0.01 * k
        solution = mpc.solve(x, s, t, solution)
        command = solution.plan.command(t + 0.01)
        found.append(solution.statistics)
    assert max(one.cost for one in found[10:]) > 250.0
    assert [one.restart for one in found].count(FOLLOWED) == 1
    assert found[-1].cost < 100.0


def test_a_car_that_counter_steers_is_asked_for_no_other_lock(mpc: Mpc) -> None:
    solution, turned = None, []
    for k in range(90):
        s = START + 0.12 * k
        solution = mpc.solve(mpc.reference.state(s), s, 0.01 * k, solution)
        turned += [solution.alternative.turned] if solution.alternative else []
    assert turned
    assert max(turned) == 0.0


def test_a_state_that_is_not_finite_has_no_plan(mpc: Mpc) -> None:
    with pytest.raises(NoPlanError, match="not finite"):
        mpc.solve(np.full(6, np.nan), START, 0.0)


def test_a_plan_is_its_vector() -> None:
    plan = Plan(2.0, np.array([[0.1, 10.0], [0.2, 30.0]]))
    again = Plan.of(plan.vector())
    assert again is not None
    assert again.start == plan.start
    np.testing.assert_array_equal(again.u, plan.u)
    np.testing.assert_allclose(plan.command(2.05), [0.15, 20.0])
    assert Plan.of(no_plan(1)) is None
