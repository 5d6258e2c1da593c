"""The brush car in a closed loop: its equations as a plant on a path."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from pydrake.systems.framework import LeafSystem

from drift_drake.arrays import Array
from drift_drake.vehicle.effects import Effects
from drift_drake.vehicle.path_plant import PLANT_STATES, CurvedPath, PathPlant, kinematic_rates
from experiments.other_worlds.brush_car import STATES, BrushCar, rates
from experiments.other_worlds.brush_step import BrushStepModel

OWN = ("rim_difference", *STATES[8:])  # behind `PLANT_STATES`


class BrushPlant(PathPlant, LeafSystem):
    """`brush_car.rates` with the states and ports of every plant, on floats.

    Continuous state: `PLANT_STATES` (omega_r the mean rim speed of the rear wheels), then `OWN`: the right rim's speed
    over the left's [m/s], steering [rad], torque [N m], the accelerations that the loads follow, and lagging slips.
    """

    has_memory = True

    def __init__(self, car: BrushCar, effects: Effects, path: CurvedPath | None) -> None:
        LeafSystem.__init__(self)
        self.effects = effects
        self.state_names = (*PLANT_STATES, *OWN)
        self.declare_numbers(float, (tuple(car), tuple(effects)), path)

    def car(self, constants: Any, magnitudes: Any) -> tuple[BrushCar, Effects]:
        """The Context's numbers by name."""
        return BrushCar(*(float(q) for q in constants)), Effects(*(float(q) for q in magnitudes))

    def settled(self, placed: Sequence[float], delta: float, tau: float, p: BrushCar, q: Effects) -> Sequence[float]:
        """The car's own states once it has been as it is for long, its rear wheels at equal slip."""
        own = BrushStepModel(p, q).settled(np.array(placed[:4]), np.array([delta, tau]))
        return [float(value) for value in own]

    def rates(self, x: Any, u: Any, wrench: Any, curvature: Any, p: BrushCar, q: Effects) -> Sequence[Any]:
        """Rates of the state, and behind them (a_x, a_y) [m/s^2]; a disturbance acts on the body."""
        r, v, beta, omega_r, psi, difference = x[0], x[1], x[2], x[3], x[9], x[10]
        along, across = v * np.cos(beta), v * np.sin(beta)
        z = np.array([along, across, r, psi, x[7], x[8], omega_r - 0.5 * difference, omega_r + 0.5 * difference,
                      *x[11:]])  # fmt: skip
        out = np.empty(len(z))
        a_x, a_y = rates(z, u[0], u[1], p, q, out)
        mass, inertia = p.mass * (1.0 + q.mass_error), p.yaw_inertia * (1.0 + q.yaw_inertia_error)
        u_dot, w_dot = out[0] + wrench[0] / mass, out[1] + wrench[1] / mass
        v_dot = (along * u_dot + across * w_dot) / v
        beta_dot = (along * w_dot - across * u_dot) / (v * v)
        return (out[2] + wrench[2] / inertia, v_dot, beta_dot, 0.5 * (out[6] + out[7]),
                *kinematic_rates(x, beta_dot, curvature), out[7] - out[6], *out[8:], a_x, a_y)  # fmt: skip

    def compiled_rates(self, x: Array, u: Array, wrench: Array, curvature: float, p: Array, q: Array) -> Array:
        """The same from the Context's numbers."""
        return np.array(self.rates(x, u, wrench, curvature, *self.car(p, q)))
