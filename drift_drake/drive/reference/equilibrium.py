"""Drift equilibria: steady cornering at a given radius and sideslip (Goh and Gerdes 2016, section II)."""

import math
from collections.abc import Iterator
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydrake.solvers import IpoptSolver, MathematicalProgram

from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.single_track.motion import motion
from drift_drake.common.errors import DriftDrakeError
from drift_drake.drive.reference.similarity import similarity

RESIDUAL_TOLERANCE = 1e-6  # [rad/s^2], [m/s^2] of a car of the default one's size
TIGHTEST = 1.0  # [m] of a radius, for such a car


class DriftEquilibrium(NamedTuple):
    """A steady state of the single-track car, and the input that holds it (SI, ISO 8855)."""

    v: float
    beta: float
    r: float
    omega_r: float
    delta: float
    tau: float
    curvature: float


class NoEquilibriumError(DriftDrakeError, ValueError):
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
    units = similarity(parameters)
    least = TIGHTEST * units.length
    if not (math.isfinite(radius) and abs(radius) > least):
        raise ValueError(f"radius is {radius:g} m; give a finite one of more than {least:.3g} m (negative: right turn)")
    if not abs(sideslip) < math.pi / 2:
        raise ValueError(f"sideslip is {sideslip:g} rad; give it in radians, below pi/2 in size")
    # The car is symmetric: a right turn is the mirror image of a left one.
    side = math.copysign(1.0, radius)
    found = _left_drift(units.usual(parameters), units.length / abs(radius), side * sideslip)
    if found is None:
        raise NoEquilibriumError(
            f"no steady drift at a radius of {radius:g} m and a sideslip of {sideslip:g} rad within "
            f"|delta| <= {parameters.steering_limit:g} rad and tau in [{parameters.torque_min:g}, "
            f"{parameters.torque_max:g}] N m; a left turn (positive radius) drifts with negative sideslip"
        )
    speed, rim_speed, steering, torque = found
    speed, rim_speed = speed * units.speed, rim_speed * units.speed
    return DriftEquilibrium(
        v=speed, beta=sideslip, r=side * speed / abs(radius), omega_r=rim_speed, delta=side * steering,
        tau=torque * units.torque, curvature=side / abs(radius))  # fmt: skip


def _left_drift(
    parameters: VehicleParameters, curvature: float, beta: float
) -> tuple[float, float, float, float] | None:
    """(v, omega_r, delta, tau) of a steady left turn of a car of the default one's size; None where there is none."""
    constants = parameters.constants()
    grip_speed = math.sqrt(constants.friction * constants.gravity / curvature)

    program = MathematicalProgram()
    # All unknowns are of like size: speed over the grip limit's, rim speed over speed, steering, torque in 100 N m.
    unknowns = np.array([program.NewContinuousVariables(1, name)[0] for name in ("v", "spin", "delta", "tau")])

    def residual(q: NDArray[Any]) -> NDArray[Any]:
        speed = grip_speed * q[0]
        rates = motion(speed * curvature, speed, beta + 0.0 * speed, speed * q[1], q[2], 100.0 * q[3], constants)
        return np.array([rates.r_dot, rates.v_dot, rates.beta_dot, rates.omega_r_dot])

    lock = parameters.steering_limit
    lower = np.array([0.2, 0.5, -lock, parameters.torque_min / 100.0])
    upper = np.array([1.5, 6.0, lock, parameters.torque_max / 100.0])
    zero: NDArray[Any] = np.zeros(4)
    program.AddConstraint(residual, lb=zero, ub=zero, vars=unknowns)
    program.AddBoundingBoxConstraint(lower, upper, unknowns)
    solver = IpoptSolver()
    # The residuals bend sharply where the tyres begin to slide, and IPOPT can be caught there: several starts.
    for guess in _guesses(beta, constants.front_axle_distance * curvature, lower, upper):
        result = solver.Solve(program, guess)
        solution = result.GetSolution(unknowns)
        if result.is_success() and np.abs(residual(solution)).max() < RESIDUAL_TOLERANCE:
            break
    else:
        return None
    speed, spin, steering, torque = (float(value) for value in solution)
    speed *= grip_speed
    return speed, speed * spin, steering, 100.0 * torque


def _guesses(beta: float, front_turn: float, lower: NDArray[Any], upper: NDArray[Any]) -> Iterator[NDArray[Any]]:
    """Starts (v, spin, delta, tau) for a left turn: a front axle slipping a little and spinning rear wheels, varied."""
    size = abs(beta)
    likely = np.array([0.96, 1.02 + 0.25 * size + 0.6 * size**2, beta + front_turn + 0.1, 0.6 + 1.8 * size])
    for spin, steering in (
        (1.0, 0.0),
        (1.1, 0.0),
        (0.95, 0.0),
        (1.0, 0.1),
        (1.0, -0.1),
        (1.1, 0.1),
        (1.1, -0.1),
        (1.25, 0.0),
    ):
        guess = likely * [1.0, spin, 1.0, 1.0] + [0.0, 0.0, steering, 0.0]
        yield np.clip(guess, lower + 1e-3, upper - 1e-3)
