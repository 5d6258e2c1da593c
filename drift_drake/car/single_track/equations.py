"""The single-track car's equations for `car.equations`: internal states are `InternalStates` without the commands'."""

from collections.abc import Mapping
from typing import Any

from drift_drake.car.deviation import Deviation
from drift_drake.car.effects import changed
from drift_drake.car.effects.catalogue import CATALOGUE, PARAMETRIC
from drift_drake.car.effects.magnitudes import INTERNAL_COUNT, Effects, InternalStates
from drift_drake.car.parameters import Constants
from drift_drake.car.scalar import absolute, fixed_tuple, jitable, maximum
from drift_drake.car.single_track.motion import MIN_SLIP_SPEED
from drift_drake.car.single_track.motion_with_effects import (
    changed_constants,
    motion_with_effects,
    settled_internal_states,
)

HELD = INTERNAL_COUNT - 2  # of `InternalStates`: all but the commands', which are known
SIZE = 5 + HELD
STEPPED = False  # internal states are slow, or few: half an implicit step a row follows them (`decays`)
LACKS: tuple[str, ...] = ()  # effects that mean nothing on this car
DEVIATIONS: dict[str, Deviation] = {}  # of what a vehicle file says nothing of
FOLDED = tuple(name for name in CATALOGUE if name in PARAMETRIC)  # that `changed_constants` puts into its numbers


def deviated(constants: Constants, by: Mapping[str, float], effects: Effects) -> Constants:  # noqa: ARG001
    """The car itself."""
    return constants


@jitable
def settle(z: Any, delta: Any, torque: Any, constants: Any, effects: Any) -> None:
    """Writes the internal states of a car that has long driven so."""
    settled = settled_internal_states(z[0], z[1], z[2], z[3], delta, torque, constants, effects, z[4])
    for i, state in enumerate(settled[2:]):
        z[5 + i] = state


@jitable
def rates(z: Any, command: Any, car: Any, out: Any) -> None:
    """Writes the states' rates."""
    constants, effects, wrench = car
    zero = 0.0 * z[0]
    internal = InternalStates(*((zero, zero) + fixed_tuple(z[5:], HELD)))  # noqa: RUF005 (for numba)
    motion, further = motion_with_effects(z[0], z[1], z[2], z[3], z[4], internal, command[0] + zero, command[1] + zero,
                                          constants, effects, wrench[0], wrench[1], wrench[2])  # fmt: skip
    out[0], out[1], out[2], out[3], out[4] = motion.r_dot, motion.v_dot, motion.beta_dot, motion.omega_r_dot, z[0]
    for i, rate in enumerate(further[2:]):
        out[5 + i] = rate


@jitable
def wheel_rate(omega_r: Any, constants: Any, effects: Any) -> Any:
    """Rate [1/s] at which the driven rim settles in grip."""
    p = changed_constants(constants, effects)
    stiffness = changed.longitudinal_stiffness(p.rear_stiffness + p.front_coupling * p.front_stiffness, effects)
    return stiffness * p.wheel_radius**2 / (p.rear_axle_inertia * maximum(absolute(omega_r), MIN_SLIP_SPEED))


@jitable
def fastest(z: Any, constants: Any, effects: Any) -> Any:
    """Rate [1/s] of the driven rim, or of slips that lag."""
    return max(wheel_rate(z[3], constants, effects), _relaxation(z[1], effects))


@jitable
def decays(z: Any, constants: Any, effects: Any, out: Any) -> None:  # noqa: ARG001
    """Writes the rates [1/s] of the slips that lag."""
    out[5] = out[6] = _relaxation(z[1], effects)


@jitable
def _relaxation(v: Any, effects: Any) -> Any:
    return max(abs(v), 1.0) / effects.tyre_relaxation if effects.tyre_relaxation > 0.0 else 0.0
