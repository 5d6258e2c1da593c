"""The double-track car as a Drake system, with the ports of `car.single_track.plant.VehiclePlant`."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from pydrake.common.containers import namedview

from drift_drake.car.compilation import compiled
from drift_drake.car.double_track.constants import DoubleTrackConstants, flattened, unflattened
from drift_drake.car.double_track.motion import OwnStates, check_supported, double_track_motion, settled_states
from drift_drake.car.double_track.parameters import DoubleTrackParameters
from drift_drake.car.effects.magnitudes import COUNT, Effects
from drift_drake.car.scalar import fixed_tuple, jitable
from drift_drake.car.single_track.path_plant import PLANT_STATES, CurvedPath, PathPlant, kinematic_rates, plant_template
from drift_drake.common.arrays import Array

DOUBLE_TRACK_STATES = (*PLANT_STATES, *OwnStates._fields)
DoubleTrackStateView = namedview("DoubleTrackStateView", DOUBLE_TRACK_STATES)


@jitable
def double_track_rates(
    x: Any, u: Any, wrench: Any, curvature: Any, p: DoubleTrackConstants, q: Effects
) -> tuple[tuple[Any, ...], OwnStates, tuple[Any, Any]]:
    """Rates of `PLANT_STATES` and of the car's own states, and (a_x, a_y) [m/s^2].

    At the plant's state x, input u and disturbance `wrench` (force_x, force_y, moment).
    """
    own = OwnStates(x[10], x[11], x[12], x[13], x[14], x[15], x[16], x[17], x[18], x[19], x[20], x[21], x[22])
    m, own_rates = double_track_motion(
        x[0], x[1], x[2], x[3], x[9], own, u[0], u[1], p, q, wrench[0], wrench[1], wrench[2]
    )
    rates = (m.r_dot, m.v_dot, m.beta_dot, m.omega_r_dot, *kinematic_rates(x, m.beta_dot, curvature))
    return rates, own_rates, (m.a_x, m.a_y)


# Compiled for floats, which comes with constants and magnitudes as arrays.
@compiled
def _rates(x: Array, u: Array, wrench: Array, curvature: float, p: Array, q: Array) -> Array:
    first, own, acceleration = double_track_rates(
        x, u, wrench, curvature, unflattened(p), Effects(*fixed_tuple(q, COUNT))
    )
    return np.array(first + own[:] + acceleration)


class DoubleTrackCarPlant(PathPlant):
    """The car of `double_track.motion` as a system on float, AutoDiffXd and Expression.

    Continuous state: those of `VehiclePlant` (r [rad/s], v [m/s], beta [rad], omega_r [m/s], e [m], dphi [rad],
    s, x, y [m], psi [rad]), at the centre of gravity, omega_r the mean rim speed of the rear wheels; behind them
    the car's own, `motion.OwnStates`. `state_view` names them.

    Numeric parameters of the Context: 0: the car's constants (`flattened`); 1: the magnitudes of `Effects`. The
    plant acts on neither delays nor the sensors' effects, and knows no limits of the actuator.

    Input and output ports: those of `VehiclePlant`, of the same meaning.

    Args:
        parameters: the car.
        effects: magnitudes, zero for none.
        path: see `VehiclePlant`.

    Raises:
        InvalidVehicleError: an effect that this car cannot have (`motion.NOT_OF_THIS_CAR`).
    """

    has_internal_states = True  # effects may change during a run: see `VehiclePlant`

    parameters: DoubleTrackParameters
    effects: Effects

    def declare(
        self: Any, parameters: DoubleTrackParameters, effects: Effects, path: CurvedPath | None, T: Any
    ) -> None:
        """Declares parameters, state and ports on numbers of the type T."""
        check_supported(effects)
        self.parameters, self.effects = parameters, effects
        self.state_names, self.state_view = DOUBLE_TRACK_STATES, DoubleTrackStateView
        self.declare_numbers(T, (flattened(parameters.constants()), effects), path)

    def car(self, constants: Any, magnitudes: Any) -> tuple[DoubleTrackConstants, Effects]:
        """The Context's numbers by name."""
        return unflattened(constants), Effects(*magnitudes)

    def settled(
        self, placed: Sequence[float], delta: float, tau: float, p: DoubleTrackConstants, q: Effects
    ) -> Sequence[float]:
        """The car's own states once it has been as it is for long."""
        return settled_states(*placed[:4], delta, tau, p, q)

    def rates(self, x: Any, u: Any, wrench: Any, curvature: Any, p: DoubleTrackConstants, q: Effects) -> Sequence[Any]:
        """Rates of the state, and behind them (a_x, a_y) [m/s^2] in the body frame."""
        first, own, acceleration = double_track_rates(x, u, wrench, curvature, p, q)
        return (*first, *own, *acceleration)

    def compiled_rates(self, x: Array, u: Array, wrench: Array, curvature: float, p: Array, q: Array) -> Array:
        """The same on floats, from the Context's numbers."""
        return _rates(x, u, wrench, curvature, p, q)


DoubleTrackPlant_ = plant_template("DoubleTrackPlant_", DoubleTrackCarPlant)
DoubleTrackPlant = DoubleTrackPlant_[None]
"""The car on floats; `ToAutoDiffXd()` and `ToSymbolic()` convert it, parameters, effects and path included."""
