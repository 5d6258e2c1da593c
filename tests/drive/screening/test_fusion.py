"""The state from the channels that are left: against a simulated drift of the nominal car and of another one."""

import numpy as np
import pytest

from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.sensors import MEASURED_STATE, NoiseLevels
from drift_drake.drive.reference.trajectory import straight_line
from drift_drake.drive.screening.fusion import Fused, corrected, learnt, predicted, within_gate
from drift_drake.drive.screening.screen import Innovation

CAR, PERIOD = VehicleParameters(), 0.01
LANE = straight_line(15.0, 15.0, 20.0)
START = np.array([0.3, 15.0, -0.05, 15.2, 0.2, 0.02, 3.0])
COMMAND = np.array([0.05, 60.0])


def driven(car: VehicleParameters, rows: int) -> np.ndarray:
    """States [rows, 7] of a car under one command."""
    model = Innovation(car, LANE.path, NoiseLevels(), PERIOD)
    out = [START]
    for _ in range(rows - 1):
        out.append(model.predict(out[-1], COMMAND, COMMAND))
    return np.array(out)


def followed(states: np.ndarray, missing: tuple[str, ...], good: int) -> np.ndarray:
    """Estimates [rows, 7], the nominal car being the model: `good` whole readings, then some channels missing."""
    model = Innovation(CAR, LANE.path, NoiseLevels(), PERIOD)
    used = np.array([name not in missing for name in MEASURED_STATE])
    x, fused, out = states[0], Fused.after_good(model.noise), [states[0]]
    for row, reading in enumerate(states[1:], 1):
        expected, jacobian = model.linearize(x, COMMAND, COMMAND)
        rates = model.rates(expected)
        if row < good:
            fused, x = learnt(fused, reading - expected, rates, model.noise, PERIOD), reading
        else:
            moved, fused = predicted(expected, fused, jacobian, rates, PERIOD)
            x, fused = corrected(moved, fused, reading, used, model.noise, np.inf)
        out.append(x)
    return np.array(out)


@pytest.mark.parametrize(("missing", "bound"), [("beta", 0.01), ("v", 0.03), ("r", 0.05), ("omega_r", 0.03)])
def test_a_channel_that_is_missing_follows_from_the_others(missing: str, bound: float) -> None:
    states = driven(CAR.replace(friction=0.8, mass=1800.0, front_stiffness=110e3), 200)
    i = MEASURED_STATE.index(missing)
    error, blind = (np.abs(followed(states, gone, 50) - states)[:, i].max() for gone in ((missing,), MEASURED_STATE))
    assert error < bound
    assert error < (0.2 if missing in ("v", "omega_r") else 5.0) * blind  # the model alone knows a gentle sideslip


def test_what_the_model_lacks_is_carried_on_where_nothing_is_read() -> None:
    states = driven(CAR.replace(friction=0.8, mass=1800.0), 130)
    learnt_first, blind = (followed(states, MEASURED_STATE, good) for good in (80, 1))
    error = np.linalg.norm((learnt_first - states)[-1, :4] / [0.1, 1.0, 0.1, 1.0])
    assert error < np.linalg.norm((blind - states)[-1, :4] / [0.1, 1.0, 0.1, 1.0])


def test_a_force_across_that_is_not_modelled_turns_course_and_sideslip_alike() -> None:
    lacking = np.array([0.0, 0.0, -0.2, 0.0])
    before = Fused.after_good(np.ones(7))._replace(lacking=lacking)
    moved, _ = predicted(START, before, np.eye(7), np.ones(7), PERIOD)
    change = dict(zip(MEASURED_STATE, moved - START, strict=True))
    assert change["beta"] == pytest.approx(-0.2 * PERIOD)
    assert change["dphi"] == pytest.approx(change["beta"])
    assert change["r"] == change["e"] == change["s"] == 0.0


def test_the_jacobian_is_that_of_the_prediction() -> None:
    model = Innovation(CAR, LANE.path, NoiseLevels(), PERIOD)
    _, jacobian = model.linearize(START, COMMAND, COMMAND)
    for i, size in enumerate([1e-5] * 7):
        step = size * np.eye(7)[i]
        ends = [model.predict(START + sign * step, COMMAND, COMMAND) for sign in (1.0, -1.0)]
        np.testing.assert_allclose(jacobian[:, i], (ends[0] - ends[1]) / (2.0 * size), atol=1e-5)


def test_a_channel_far_off_is_not_used_and_a_closed_path_may_start_anew() -> None:
    noise = np.full(7, 0.01)
    state = Fused.after_good(noise)
    reading = START + np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 100.0])
    x, _ = corrected(START, state, reading, np.ones(7, dtype=bool), noise, 100.0)
    np.testing.assert_allclose(x, START)
    assert within_gate(reading - START, state, noise).tolist() == [False, True, True, True, True, True, False]


def test_it_lies_in_a_vector() -> None:
    state = Fused(np.arange(49.0).reshape(7, 7), np.arange(4.0))
    again = Fused.of(state.vector())
    np.testing.assert_array_equal(again.covariance, state.covariance)
    np.testing.assert_array_equal(again.lacking, state.lacking)
