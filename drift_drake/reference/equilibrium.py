"""Drift equilibria: steady cornering at a given radius and sideslip (Goh and Gerdes 2016, section II)."""

import math
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydrake.solvers import IpoptSolver, MathematicalProgram

from drift_drake.vehicle.bicycle import motion
from drift_drake.vehicle.parameters import VehicleParameters

RESIDUAL_TOLERANCE = 1e-6  # [rad/s^2], [m/s^2]


class DriftEquilibrium(NamedTuple):
    """A steady state of the single-track car, and the input that holds it (SI, ISO 8855)."""

    v: float
    beta: float
    r: float
    omega_r: float
    delta: float
    tau: float
    curvature: float


class NoEquilibriumError(ValueError):
    """No steady drift exists at the given radius and sideslip."""


@lru_cache(maxsize=64)
def drift_equilibrium(parameters: VehicleParameters, radius: float, sideslip: float) -> DriftEquilibrium:
    """The steady drift at a radius and sideslip, found by IPOPT.

    Solves r_dot = v_dot = beta_dot = omega_r_dot = 0 of `bicycle.motion` with r = v / radius for (v, omega_r, delta,
    tau) within the vehicle's limits, starting from a counter-steered car with spinning rear wheels.

    Args:
        parameters: the car.
        radius: [m] of the circle, positive for a left turn, negative for a right one.
        sideslip: beta [rad]; a drift has the sign opposite to the radius (a left turn drifts with the nose inwards).

    Raises:
        NoEquilibriumError: there is none within the limits.
    """
    if not (math.isfinite(radius) and abs(radius) > 1.0):
        raise ValueError(f"radius is {radius:g} m; give a finite one of more than 1 m (negative: a right turn)")
    if not abs(sideslip) < math.pi / 2:
        raise ValueError(f"sideslip is {sideslip:g} rad; give it in radians, below pi/2 in size")
    # The car is symmetric: a right turn is the mirror image of a left one.
    side = math.copysign(1.0, radius)
    curvature, beta = 1.0 / abs(radius), side * sideslip
    constants = parameters.constants()
    grip_speed = math.sqrt(constants.friction * constants.gravity / curvature)

    program = MathematicalProgram()
    # The torque in hundreds of newton metres, so that all unknowns are of like size.
    unknowns = np.array([program.NewContinuousVariables(1, name)[0] for name in ("v", "omega_r", "delta", "tau")])

    def residual(q: NDArray[Any]) -> NDArray[Any]:
        rates = motion(q[0] * curvature, q[0], beta + 0.0 * q[0], q[1], q[2], 100.0 * q[3], constants)
        return np.array([rates.r_dot, rates.v_dot, rates.beta_dot, rates.omega_r_dot])

    lock = parameters.steering_limit
    lower = np.array([0.2 * grip_speed, 0.2 * grip_speed, -lock, parameters.torque_min / 100.0])
    upper = np.array([1.5 * grip_speed, 10.0 * grip_speed, lock, parameters.torque_max / 100.0])
    zero: NDArray[Any] = np.zeros(4)
    program.AddConstraint(residual, lb=zero, ub=zero, vars=unknowns)
    program.AddBoundingBoxConstraint(lower, upper, unknowns)
    guess = np.array([0.95 * grip_speed, 1.3 * grip_speed, np.clip(beta, -0.9 * lock, 0.9 * lock), 1.5])
    result = IpoptSolver().Solve(program, guess)
    solution = result.GetSolution(unknowns)
    if not result.is_success() or np.abs(residual(solution)).max() > RESIDUAL_TOLERANCE:
        raise NoEquilibriumError(
            f"no steady drift at a radius of {radius:g} m and a sideslip of {sideslip:g} rad within "
            f"|delta| <= {parameters.steering_limit:g} rad and tau in [{parameters.torque_min:g}, "
            f"{parameters.torque_max:g}] N m; a left turn (positive radius) drifts with negative sideslip"
        )
    speed, rim, steering, torque = (float(value) for value in solution)
    return DriftEquilibrium(
        v=speed, beta=sideslip, r=side * speed * curvature, omega_r=rim, delta=side * steering, tau=100.0 * torque,
        curvature=side * curvature)  # fmt: skip
