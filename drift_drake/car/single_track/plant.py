"""The car as a Drake system: the single-track car, with or without effects, on a path and in the world."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from pydrake.common.containers import namedview

from drift_drake.car.compilation import compiled
from drift_drake.car.effects.catalogue import OFF_THE_MOTION
from drift_drake.car.effects.magnitudes import COUNT, INTERNAL_COUNT, Effects, InternalStates
from drift_drake.car.on_path import PLANT_STATES, kinematic_rates
from drift_drake.car.parameters import Constants, VehicleParameters
from drift_drake.car.path_plant import CurvedPath, PathPlant, plant_template
from drift_drake.car.scalar import fixed_tuple, jitable
from drift_drake.car.single_track.motion import motion
from drift_drake.car.single_track.motion_with_effects import motion_with_effects, settled_internal_states
from drift_drake.common.arrays import Array

PLANT_STATES_WITH_INTERNAL = (*PLANT_STATES, *InternalStates._fields)

CONSTANTS = len(Constants._fields)

PlantStateView = namedview("PlantStateView", PLANT_STATES)
PlantStateWithInternalView = namedview("PlantStateWithInternalView", PLANT_STATES_WITH_INTERNAL)


def acts_on_motion(effects: Effects) -> bool:
    """Whether any effect changes the equations of motion, so that the plant needs the states of `InternalStates`."""
    return any(value != 0.0 for name, value in effects._asdict().items() if name not in OFF_THE_MOTION)


@jitable
def nominal_rates(x: Any, u: Any, wrench: Any, curvature: Any, p: Constants) -> tuple[Any, ...]:
    """Rates of `PLANT_STATES` at the plant's state x, input u and disturbance `wrench` (force_x, force_y, moment).

    Behind them (a_x, a_y) [m/s^2].
    """
    m = motion(x[0], x[1], x[2], x[3], u[0], u[1], p, wrench[0], wrench[1], wrench[2])
    return (m.r_dot, m.v_dot, m.beta_dot, m.omega_r_dot, *kinematic_rates(x, m.beta_dot, curvature), m.a_x, m.a_y)


@jitable
def changed_rates(x: Any, u: Any, wrench: Any, curvature: Any, p: Constants, q: Effects) -> tuple[Any, ...]:
    """The same of `PLANT_STATES_WITH_INTERNAL` with effects."""
    internal = InternalStates(*fixed_tuple(x[10:], INTERNAL_COUNT))
    m, own = motion_with_effects(
        x[0], x[1], x[2], x[3], x[9], internal, u[0], u[1], p, q, wrench[0], wrench[1], wrench[2]
    )
    rates = (m.r_dot, m.v_dot, m.beta_dot, m.omega_r_dot, *kinematic_rates(x, m.beta_dot, curvature))
    return (*rates, *own[:], m.a_x, m.a_y)  # a slice is a plain tuple, which numba can add


# The same functions compiled for floats. Constants and magnitudes come as arrays, which compiled code takes faster than
# tuples of numbers.
@compiled
def _nominal_rates(x: Array, u: Array, wrench: Array, curvature: float, p: Array) -> Array:
    return np.array(nominal_rates(x, u, wrench, curvature, Constants(*fixed_tuple(p, CONSTANTS))))


@compiled
def _changed_rates(x: Array, u: Array, wrench: Array, curvature: float, p: Array, q: Array) -> Array:
    constants, effects = Constants(*fixed_tuple(p, CONSTANTS)), Effects(*fixed_tuple(q, COUNT))
    return np.array(changed_rates(x, u, wrench, curvature, constants, effects))


class SingleTrackPlant(PathPlant):
    """The single-track car (the paper's appendix) with effects, as a system on float, AutoDiffXd and Expression.

    Continuous state: r [rad/s], v [m/s], beta [rad], omega_r [m/s], e [m], dphi [rad] (the paper's six, measured
    from the path), s [m] along the path, x, y [m], psi [rad] in the fixed frame; behind them, only when an effect
    acts on the motion, the states of `effects.InternalStates` (the effects' own). `state_view` names them.

    Numeric parameters of the Context, so that one plant serves many cars and AutoDiffXd differentiates by them:
    0: `Constants`; 1: the magnitudes of `Effects`. Their defaults are the constructor's. The plant acts on
    neither delays nor the sensors' effects, and knows no limits of the actuator.

    Input ports:
        actuation: (delta [rad], tau [N m]) as it reaches the car.
        disturbance (optional): (force_x, force_y [N], moment [N m]) in the body frame.
        curvature (optional): curvature of the path [1/m]; else the path's at s, else 0 (a straight path).

    Output ports:
        state: the paper's six; path_position: s; pose: (x, y, psi); full_state: all of the state.
        acceleration: (a_x, a_y) [m/s^2] in the body frame, force over mass (gravity on a slope is a force). It is
            the only output with direct feedthrough, from actuation and disturbance.

    Args:
        parameters: the car.
        effects: magnitudes, zero for none.
        path: anything with `curvature(s)` (and `pose` and `to_world` for `set_initial`). AutoDiffXd takes the
            curvature's slope along the path by a central difference of 1 mm. An Expression cannot pass through a
            path: connect the curvature port there.
    """

    parameters: VehicleParameters
    effects: Effects
    has_internal_states: bool  # whether an effect acts on the motion

    def declare(self: Any, parameters: VehicleParameters, effects: Effects, path: CurvedPath | None, T: Any) -> None:
        """Declares parameters, effects, the path's curvature, state and ports on numbers of the type T."""
        self.parameters, self.effects = parameters, effects
        self.has_internal_states = acts_on_motion(effects)
        self.state_names = PLANT_STATES_WITH_INTERNAL if self.has_internal_states else PLANT_STATES
        self.state_view = PlantStateWithInternalView if self.has_internal_states else PlantStateView
        self.declare_numbers(T, (parameters.constants(), effects), path)

    def car(self, constants: Any, magnitudes: Any) -> tuple[Constants, Effects]:
        """The Context's numbers by name."""
        return Constants(*constants), Effects(*magnitudes)

    def settled(self, placed: Sequence[float], delta: float, tau: float, p: Constants, q: Effects) -> Sequence[float]:
        """The effects' own states of a car that has been at `placed`, under delta [rad] and tau [N m], for long."""
        return settled_internal_states(*placed[:4], delta, tau, p, q, psi=placed[9]) if self.has_internal_states else ()

    def rates(self, x: Any, u: Any, wrench: Any, curvature: Any, p: Constants, q: Effects) -> Sequence[Any]:
        """Rates of the state x, and behind them (a_x, a_y) [m/s^2] in the body frame, at what the ports give."""
        if self.has_internal_states:
            return changed_rates(x, u, wrench, curvature, p, q)
        return nominal_rates(x, u, wrench, curvature, p)

    def compiled_rates(self, x: Array, u: Array, wrench: Array, curvature: float, p: Array, q: Array) -> Array:
        """`rates` on floats: x [10 or more], u [2], wrench [3], curvature [1/m], p and q [numbers of the Context]."""
        if self.has_internal_states:
            return _changed_rates(x, u, wrench, curvature, p, q)
        return _nominal_rates(x, u, wrench, curvature, p)


VehiclePlant_ = plant_template("VehiclePlant_", SingleTrackPlant)
VehiclePlant = VehiclePlant_[None]
"""The car on floats; `ToAutoDiffXd()` and `ToSymbolic()` convert it, parameters, effects and path included.

The single-track car of the paper's appendix. Made from (parameters, effects, path). In: actuation (delta [rad], tau
[N m]), and where connected disturbance (two forces [N], moment [N m]), curvature [1/m]. Out: state (r [rad/s], v [m/s],
beta [rad], omega_r [m/s], e [m], dphi [rad]), path_position [m], pose (x, y [m], psi [rad]), full_state, acceleration
(a_x, a_y [m/s^2]). `help(VehiclePlant)` has more. InvalidVehicleError where no car has a number.

Examples:
    >>> VehiclePlant(car).ToAutoDiffXd().GetOutputPort("state").size()
    6
"""
