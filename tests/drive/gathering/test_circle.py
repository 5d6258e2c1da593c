"""Gathering in a circle: the lane bends, and all else is as on a straight one."""

import numpy as np
import pytest

from drift_drake.car.effects.magnitudes import make_effects
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.step_model import NominalStepModel
from drift_drake.common.errors import InvalidOptionError
from drift_drake.drive.gathering.config import GatheringConfig, bound_end, lane, problem_data
from drift_drake.drive.gathering.gather import drive_samples, gather, learn_drive, rest_of_drive
from drift_drake.drive.gathering.plan import Trajectory, information_gained, plan_drive
from drift_drake.drive.learnt.checkpoint import BayesianModel
from drift_drake.drive.mpc.ocp import OptimalControlProblem

CURVATURE = -0.025  # [1/m], to the right
CONFIG = GatheringConfig(steps=14, v_end=10.0, curvature=CURVATURE, starts=2, max_iterations=60, replan=0.5)
EFFECTS = make_effects({"friction_level": -0.1})


@pytest.fixture(scope="module")
def plans(model: BayesianModel) -> tuple[Trajectory, Trajectory]:
    """(OCP's, Info-OCP's)."""
    plain, informative = (plan_drive(model, model.prior(), CONFIG, alpha) for alpha in (0.0, CONFIG.alpha))
    return plain, informative


def test_the_reference_turns_with_the_lane() -> None:
    data, path = problem_data(CONFIG, curvature=CURVATURE), lane(CONFIG).path
    np.testing.assert_allclose(data.x_ref[:, 0], CURVATURE * data.x_ref[:, 1])
    np.testing.assert_array_equal(data.curvature, np.full(14, CURVATURE))
    assert data.x_init[0] == 0.0  # from a straight
    _, _, heading = path.pose(10.0)
    assert heading == pytest.approx(10.0 * CURVATURE)


def test_the_plain_plan_keeps_to_the_circle_and_the_informative_one_tells_more(
    plans: tuple[Trajectory, Trajectory],
) -> None:
    plain, informative = plans
    assert (plain.status, informative.status) == ("converged", "converged")
    assert np.abs(plain.x[:, 4]).max() < 0.3
    assert plain.x[-1, 0] == pytest.approx(CURVATURE * plain.x[-1, 1], abs=0.05)
    assert informative.information > 1.5 * plain.information
    # Its end is bounded about the circle's yaw rate, not about none.
    assert abs(informative.x[-1, 0] - CURVATURE * informative.x[-1, 1]) < 0.21


def test_a_car_drives_it_and_is_learnt_with_the_lanes_curvature(
    model: BayesianModel, plans: tuple[Trajectory, Trajectory]
) -> None:
    table, ending = gather(plans[1], EFFECTS, VehicleParameters(), CONFIG, 0)
    assert ending == "time"
    assert table["e"].abs().max() < CONFIG.half_width
    assert table["psi"].iloc[-1] == pytest.approx(CURVATURE * table["s"].iloc[-1], abs=0.3)
    np.testing.assert_allclose(drive_samples(table, CONFIG).curvature, CURVATURE)
    assert information_gained(model.prior(), learn_drive(model, model.prior(), table, CONFIG)) > 1.0


def test_the_rest_of_a_replanned_drive_is_in_the_same_circle(
    model: BayesianModel, plans: tuple[Trajectory, Trajectory]
) -> None:
    assert rest_of_drive(CONFIG, 5).curvature == CURVATURE
    learning = (model, model.prior())
    table, ending = gather(plans[1], EFFECTS, VehicleParameters(), CONFIG, 0, learning=learning)
    assert ending == "time"
    assert table["e"].abs().max() < CONFIG.half_width


def test_without_curvature_the_end_is_bounded_as_on_a_straight() -> None:
    vehicle = VehicleParameters()
    rows = []
    for curvature in ((), (0.0,)):
        problem = OptimalControlProblem(NominalStepModel(vehicle), vehicle, 5)
        bound_end(problem, *curvature)
        rows.append([binding.evaluator().GetDenseA() for binding in problem.linear_constraints()])
    for one, other in zip(*rows, strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"curvature": 0.05}, r"at a v_end of 20 m/s asks for 20.0 m/s\^2; give less of either, for 8 at most"),
        ({"curvature": 0.05, "v_end": 12.0, "half_width": 12.0}, "cannot have a curvature of 0.05 1/m; give 0.0416"),
        ({"curvature": float("nan")}, "asks for nan"),
    ],
)
def test_a_circle_that_cannot_be_driven_is_refused(options: dict[str, float], sentence: str) -> None:
    with pytest.raises(InvalidOptionError, match=sentence):
        GatheringConfig(**options)  # type: ignore[arg-type]
