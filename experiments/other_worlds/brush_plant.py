"""The brush car in a closed loop: its equations as a plant on a path."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from pydrake.systems.framework import LeafSystem

from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.on_path import PLANT_STATES, kinematic_rates
from drift_drake.car.path_plant import CurvedPath, PathPlant
from drift_drake.common.arrays import Array
from experiments.other_worlds.brush_car import STATES, BrushCar
from experiments.other_worlds.brush_step import SIZE, BrushStepModel, motion

OWN = ("rim_difference", *STATES[8:])  # behind `PLANT_STATES`


class BrushPlant(PathPlant, LeafSystem):
    """`brush_car.rates` with the states and ports of every plant, on floats.

    Continuous state: `PLANT_STATES` (omega_r the mean rim speed of the rear wheels), then `OWN`: the right rim's speed
    over the left's [m/s], steering [rad], torque [N m], the accelerations that the loads follow, and lagging slips.
    """

    has_internal_states = True

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
        v, beta, out = x[1], x[2], np.empty(SIZE)
        own = np.concatenate([x[:6], x[len(PLANT_STATES) :]])
        workspace = np.zeros((2, len(STATES)))
        a_x, a_y = motion(own, x[9], u[0], u[1], curvature, p, q, workspace[0], workspace[1], out)
        mass, inertia = p.mass * (1.0 + q.mass_error), p.yaw_inertia * (1.0 + q.yaw_inertia_error)
        r_dot = out[0] + wrench[2] / inertia
        v_dot = out[1] + (np.cos(beta) * wrench[0] + np.sin(beta) * wrench[1]) / mass
        beta_dot = out[2] + (np.cos(beta) * wrench[1] - np.sin(beta) * wrench[0]) / (mass * v)
        return (r_dot, v_dot, beta_dot, out[3], *kinematic_rates(x, beta_dot, curvature), *out[6:], a_x, a_y)

    def compiled_rates(self, x: Array, u: Array, wrench: Array, curvature: float, p: Array, q: Array) -> Array:
        """The same from the Context's numbers."""
        return np.array(self.rates(x, u, wrench, curvature, *self.car(p, q)))
