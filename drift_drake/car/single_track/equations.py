"""The single-track car's equations for `car.equations`: internal states are `InternalStates` without the commands'."""

from typing import Any

from drift_drake.car.effects import changed
from drift_drake.car.effects.magnitudes import COUNT, INSTALLED_STATES, INTERNAL_COUNT, Effects, InternalStates
from drift_drake.car.kind import CarKind
from drift_drake.car.lanes import LANES, load_lanes_tuple
from drift_drake.car.parameters import Constants
from drift_drake.car.scalar import absolute, jitable, loaded, loaded_tuple, maximum, select, stored
from drift_drake.car.single_track.motion import MIN_SLIP_SPEED
from drift_drake.car.single_track.motion_with_effects import (
    changed_constants,
    motion_with_effects,
    settled_internal_states,
)

HELD = INTERNAL_COUNT - 2  # of `InternalStates`: all but the commands', which are known
REMEMBERING = ("tyre_relaxation", "tyre_thermal_fade", "longitudinal_load_transfer", "lateral_load_transfer",
               *INSTALLED_STATES)  # fmt: skip
"""Effects without which no internal state acts on the motion."""
NUMBERS = len(Constants._fields) - 1  # of a car in `lanes`; the last of its constants, its tyre, is one for all
SHORTEST = 1e-9  # [m] that a tyre may relax over


@jitable
def cars_in_lanes(numbers: Any, effects: Any) -> Any:
    """`Constants` and `Effects` of `lanes` of cars, from flat arrays; the tyre is the first car's."""
    constants = Constants(*(load_lanes_tuple(numbers, 0, NUMBERS) + (numbers[NUMBERS * LANES],)))  # noqa: RUF005
    return constants, Effects(*load_lanes_tuple(effects, 0, COUNT))


@jitable
def settle(z: Any, delta: Any, torque: Any, constants: Any, effects: Any) -> None:
    """Writes the internal states of a car that has long driven so; where commands are `lanes`, of that many cars."""
    r, v, beta, omega_r, psi = loaded_tuple(z, 0, 5, delta)
    settled = settled_internal_states(r, v, beta, omega_r, delta, torque, constants, effects, psi)
    for i, state in enumerate(settled[2:]):
        stored(z, 5 + i, state)


@jitable
def rates(z: Any, command: Any, car: Any, out: Any) -> None:
    """Writes the states' rates; where commands are `lanes`, those of that many cars."""
    constants, effects, wrench = car
    r, v, beta, omega_r, psi = loaded_tuple(z, 0, 5, command[0])
    zero = 0.0 * r
    internal = InternalStates(*((zero, zero) + loaded_tuple(z, 5, HELD, command[0])))  # noqa: RUF005 (for numba)
    motion, further = motion_with_effects(r, v, beta, omega_r, psi, internal, command[0] + zero, command[1] + zero,
                                          constants, effects, wrench[0], wrench[1], wrench[2])  # fmt: skip
    moving = motion.r_dot, motion.v_dot, motion.beta_dot, motion.omega_r_dot, r
    for i, rate in enumerate(moving + further[2:]):
        stored(out, i, rate)


@jitable
def wheel_rate(omega_r: Any, constants: Any, effects: Any) -> Any:
    """Rate [1/s] at which the driven rim settles in grip."""
    p = changed_constants(constants, effects)
    stiffness = changed.longitudinal_stiffness(p.rear_stiffness + p.front_coupling * p.front_stiffness, effects)
    return stiffness * p.wheel_radius**2 / (p.rear_axle_inertia * maximum(absolute(omega_r), MIN_SLIP_SPEED))


@jitable
def fastest(z: Any, constants: Any, effects: Any) -> Any:
    """Rate [1/s] of the driven rim, or of slips that lag."""
    return maximum(wheel_rate(z[3], constants, effects), _relaxation(z[1], effects))


@jitable
def decays(z: Any, constants: Any, effects: Any, out: Any) -> None:  # noqa: ARG001
    """Writes the rates [1/s] of the slips that lag."""
    rate = _relaxation(loaded(z, 1, effects[0]), effects)
    stored(out, 5, rate)
    stored(out, 6, rate)


@jitable
def _relaxation(v: Any, effects: Any) -> Any:
    rate = maximum(absolute(v), 1.0) / maximum(effects.tyre_relaxation, SHORTEST)
    return select(0.0, effects.tyre_relaxation, rate, 0.0)


KIND = CarKind(
    label="single-track car",
    constants=Constants,
    own=InternalStates._fields[2:],
    own_scale=(),
    rates=rates,
    settle=settle,
    fastest=fastest,
    changed_constants=changed_constants,
    stepped=False,  # internal states are slow, or few
    decays=decays,
    lacks=(),
    cars_in_lanes=cars_in_lanes,
)
