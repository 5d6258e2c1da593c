"""The limited-slip differential: it brakes the faster rear wheel for the slower one, and gives no power."""

import numpy as np
import pytest

from drift_drake.car.double_track.equations import KIND
from drift_drake.car.double_track.motion import (
    LOCKING_SPEED,
    OwnStates,
    double_track_motion,
    locking_torque,
    settled_states,
)
from drift_drake.car.double_track.parameters import CARS, DoubleTrackParameters
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.equations_step import EquationsStepModel
from drift_drake.car.parameters import InvalidVehicleError
from drift_drake.car.step_model import STATE_SCALE, StepModel, block_scale

OPEN = CARS["coupe"]
LOCKED = OPEN.replace(differential_preload=60.0, differential_share=0.3)
MOVING, COMMAND = (0.6, 12.0, -0.4, 16.0), (-0.3, 250.0)


def rates(car: DoubleTrackParameters, own: OwnStates) -> OwnStates:
    return double_track_motion(*MOVING, 0.0, own, *COMMAND, car.constants(), Effects())[1]


def test_it_takes_from_the_faster_wheel_what_it_gives_to_the_slower_one() -> None:
    p = LOCKED.constants()
    own = settled_states(*MOVING, *COMMAND, p, Effects())._replace(rim_difference=8.0, torque=COMMAND[1])
    changed = rates(LOCKED, own).rim_difference - rates(OPEN, own).rim_difference
    axle = OPEN.gear_ratio * COMMAND[1]
    most = (60.0 + 0.3 * axle) * np.tanh(8.0 / LOCKING_SPEED)
    assert changed == pytest.approx(-most * p.wheel_radius / p.wheel_inertia, rel=1e-9)
    # The mean of both wheels, and with it the whole car at this moment, goes on as with an open one.
    motions = [
        double_track_motion(*MOVING, 0.0, own, *COMMAND, car.constants(), Effects())[0] for car in (OPEN, LOCKED)
    ]
    assert motions[0] == motions[1]


@pytest.mark.parametrize("axle_torque", [-400.0, 0.0, 2500.0])
def test_it_gives_no_power(axle_torque: float) -> None:
    p = LOCKED.constants()
    for difference in (-10.0, -0.3, 0.0, 0.3, 10.0):
        assert locking_torque(axle_torque, difference, p) * difference >= 0.0
        assert locking_torque(axle_torque, -difference, p) == -locking_torque(axle_torque, difference, p)
    assert locking_torque(axle_torque, 5.0, OPEN.constants()) == 0.0


def test_the_inner_wheel_no_longer_spins_away_under_power() -> None:
    """One second of power in a bend: the rims differ by less than with an open one."""
    differences = []
    for car in (OPEN, LOCKED):
        model = EquationsStepModel(car)
        x = np.concatenate([[0.5, 12.0, -0.02, 12.5, 0.0, 0.0], model.settled(np.array(MOVING), np.zeros(2))])[None]
        x[0, 6:] = model.settled(x[0, :4], np.array([0.12, 100.0]))
        u = np.array([[0.12, 330.0]])
        for _ in range(10):
            x = model.step(x, u, u, np.zeros(1))
        differences.append(abs(x[0, 6 + OwnStates._fields.index("rim_difference")]))
    assert differences[1] < 0.5 * differences[0]


def test_the_controllers_jacobians_know_it() -> None:
    model = EquationsStepModel(LOCKED)
    model.substeps *= 4
    x = np.concatenate([[*MOVING, 0.1, 0.05], model.settled(np.array(MOVING), np.array(COMMAND))])[None]
    x[0, 6 + OwnStates._fields.index("rim_difference")] = 1.5
    u, straight = np.array([COMMAND]), np.zeros(1)
    found = np.concatenate(model.linearize(x, u, 0.9 * u, straight)[1:], axis=2)
    wanted = np.concatenate(StepModel.linearize(model, x, u, 0.9 * u, straight)[1:], axis=2)
    scale = block_scale(np.array(KIND.own_scale)) / np.concatenate([STATE_SCALE, KIND.own_scale])[:, None]
    assert np.abs(scale * (found - wanted)).max() < 5e-3


@pytest.mark.parametrize(("name", "value"), [("differential_preload", -1.0), ("differential_share", -0.1)])
def test_a_differential_that_drives_itself_is_refused(name: str, value: float) -> None:
    with pytest.raises(InvalidVehicleError, match=f"{name} is {value:g}; give zero or more"):
        OPEN.replace(**{name: value})
