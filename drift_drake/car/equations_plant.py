"""A car with states of its own as a Drake system, with the ports of `car.single_track.plant.VehiclePlant`."""

from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np
from pydrake.common.containers import namedview

from drift_drake.car.compilation import compiled
from drift_drake.car.effects.magnitudes import COUNT, Effects
from drift_drake.car.equations import check_supported, kind_of
from drift_drake.car.kind import Function
from drift_drake.car.on_path import OF_EQUATIONS, PLANT_STATES, plant_rates_of
from drift_drake.car.parameters import CarParameters
from drift_drake.car.path_plant import CurvedPath, PathPlant, plant_template
from drift_drake.car.scalar import fixed_tuple
from drift_drake.common.arrays import Array


@cache
def _view(names: tuple[str, ...]) -> Any:
    return namedview("PlantStateView", names)


@cache
def _compiled_rates(rates: Function, unflattened: Function, size: int) -> Function:
    """`on_path.plant_rates_of` on floats, as an array. Constants and magnitudes come as arrays, which compiled code
    takes faster than tuples of numbers."""

    @compiled
    def of_plant(x: Any, u: Any, wrench: Any, curvature: Any, p: Any, q: Any) -> Any:
        out = np.empty(len(x) + 2)
        plant_rates_of(rates, x, u, wrench, curvature, unflattened(p, 0.0), Effects(*fixed_tuple(q, COUNT)),
                       np.empty((2, size)), out)  # fmt: skip
        return out

    return of_plant


class CarWithOwnStates(PathPlant):
    """A car with equations and states of its own (`car.equations`), on float, AutoDiffXd and Expression.

    Continuous state: those of `VehiclePlant` (r [rad/s], v [m/s], beta [rad], omega_r [m/s], e [m], dphi [rad],
    s, x, y [m], psi [rad]), at the centre of gravity, omega_r the mean rim speed of the rear wheels; behind them
    the car's own, the kind's `own`. `state_view` names them.

    Numeric parameters of the Context: 0: the car's constants (`flattened`); 1: the magnitudes of `Effects`. The
    plant acts on neither delays nor the sensors' effects, and knows no limits of the actuator.

    Input and output ports: those of `VehiclePlant`, of the same meaning.

    Args:
        parameters: the car.
        effects: magnitudes, zero for none.
        path: see `VehiclePlant`.

    Raises:
        InvalidVehicleError: an effect that this car cannot have (its kind's `lacks`).
    """

    has_internal_states = True  # effects may change during a run: see `VehiclePlant`

    parameters: CarParameters
    effects: Effects

    def declare(self: Any, parameters: CarParameters, effects: Effects, path: CurvedPath | None, T: Any) -> None:
        """Declares parameters, state and ports on numbers of the type T."""
        constants = parameters.constants()
        self._kind = kind_of(constants)
        check_supported(constants, effects)
        self.parameters, self.effects = parameters, effects
        self.state_names = (*PLANT_STATES, *self._kind.own)
        self.state_view = _view(self.state_names)
        self._compiled = _compiled_rates(self._kind.rates, self._kind.unflattened, self._kind.size)
        self.declare_numbers(T, (self._kind.flattened(constants), effects), path)

    def car(self: Any, constants: Any, magnitudes: Any) -> tuple[Any, Effects]:
        """The Context's numbers by name."""
        return self._kind.unflattened(constants), Effects(*magnitudes)

    def settled(self: Any, placed: Sequence[float], delta: float, tau: float, p: Any, q: Effects) -> Sequence[float]:
        """The car's own states once it has been as it is for long."""
        z = np.zeros(self._kind.size, dtype=float if self.scalar is float else object)
        z[:4], z[4] = placed[:4], placed[9]
        self._kind.settle(z, delta, tau, p, q)
        return list(z[OF_EQUATIONS:])

    def rates(self: Any, x: Any, u: Any, wrench: Any, curvature: Any, p: Any, q: Effects) -> Sequence[Any]:
        """Rates of the state, and behind them (a_x, a_y) [m/s^2] in the body frame."""
        scratch, out = np.zeros((2, self._kind.size), dtype=object), np.zeros(len(x) + 2, dtype=object)
        plant_rates_of(self._kind.rates, x, u, wrench, curvature, p, q, scratch, out)
        return list(out)

    def compiled_rates(self: Any, x: Array, u: Array, wrench: Array, curvature: float, p: Array, q: Array) -> Any:
        """The same on floats, from the Context's numbers."""
        return self._compiled(x, u, wrench, curvature, p, q)


EquationsPlant_ = plant_template("EquationsPlant_", CarWithOwnStates)
EquationsPlant = EquationsPlant_[None]
"""The car on floats; `ToAutoDiffXd()` and `ToSymbolic()` convert it, parameters, effects and path included."""
