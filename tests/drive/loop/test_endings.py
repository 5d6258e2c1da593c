"""How a run ends, state by state, and that a car which turns round has spun."""

import numpy as np
import pytest

from drift_drake.car.parameters import VehicleParameters
from drift_drake.drive.loop.closed_loop import ClosedLoop
from drift_drake.drive.loop.endings import Ending, RunLimits
from drift_drake.drive.reference.trajectory import Reference, straight_line

PARAMETERS = VehicleParameters()
BACKWARDS = 2.5  # [rad] of a course


@pytest.fixture(scope="module")
def lane() -> Reference:
    return straight_line(v_start=12.0, v_end=12.0, duration=8.0, half_width=3.0)


def state(v: float = 12.0, beta: float = 0.0, e: float = 0.0, dphi: float = 0.0, s: float = 10.0) -> np.ndarray:
    return np.array([0.0, v, beta, v, e, dphi, s, 0.0, 0.0, 0.0])


def test_each_ending_has_its_reason(lane: Reference) -> None:
    ending = Ending(lane, RunLimits(), standstill=1.0)
    assert ending(0.0, state(), False) is None
    assert ending(0.1, state(beta=-1.4), False) == "spin"
    assert ending(0.2, state(e=4.5), False) == "left the lane"
    assert ending(0.3, state(s=lane.distance), False) == "completed"
    assert ending(0.4, state(v=0.5), False) is None
    assert ending(0.5, state(v=0.5), True) == "stopped safely"


@pytest.mark.parametrize(("beta", "dphi"), [(0.0, BACKWARDS), (-1.2, 0.6), (0.0, -BACKWARDS), (0.0, 2.0 * np.pi - 2.5)])
def test_a_car_that_heads_backwards_for_a_second_has_spun(lane: Reference, beta: float, dphi: float) -> None:
    ending = Ending(lane, RunLimits(), standstill=1.0)
    turned = state(beta=beta, dphi=dphi)
    assert [ending(t, turned, False) for t in (2.0, 2.5, 2.99)] == [None] * 3
    assert ending(3.0, turned, False) == "spin"


def test_one_that_comes_round_in_time_has_not(lane: Reference) -> None:
    ending = Ending(lane, RunLimits(), standstill=1.0)
    for t, dphi in ((0.0, BACKWARDS), (0.9, BACKWARDS), (1.0, 1.5), (1.1, BACKWARDS), (2.0, BACKWARDS)):
        assert ending(t, state(dphi=dphi), False) is None
    assert ending(2.1, state(dphi=BACKWARDS), False) == "spin"


@pytest.mark.parametrize("dphi", [0.0, 2.0 * np.pi, 1.4])
def test_a_car_along_its_path_goes_on(lane: Reference, dphi: float) -> None:
    ending = Ending(lane, RunLimits(), standstill=1.0)
    assert all(ending(t, state(dphi=dphi), False) is None for t in np.arange(0.0, 5.0, 0.5))


def test_a_run_of_a_car_that_drives_back_ends_as_a_spin_within_a_second(lane: Reference) -> None:
    class Straight:
        def evaluate(self, x: np.ndarray, s: float, t: float) -> tuple[float, float]:
            del x, s, t
            return 0.0, 50.0

    loop = ClosedLoop(PARAMETERS, lane, controller=Straight())
    run = loop.run(loop.initial_context(0, np.array([0.0, 0.0, 0.0, 0.0, 0.0, np.pi])), RunLimits(lane_margin=50.0))
    assert run.outcome == "spin"
    assert run.table["t"].iloc[-1] == pytest.approx(1.0, abs=0.02)
    metrics = run.metrics()
    assert not metrics.completed
    assert metrics.completion == pytest.approx(0.0, abs=1e-3)
