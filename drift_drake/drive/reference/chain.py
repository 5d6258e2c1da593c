"""Manoeuvres put together from steady legs and the transitions between them.

A blend of two equilibria is not a motion: with the path prescribed, e.g. as a clothoid, swinging a drift from one side
to the other in 20 m takes more steering than the car has. So a transition's path is left free, and the inputs, the
states and the curvature of the path that the car then describes come from one equality-constrained least-squares
problem.
"""

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import scipy.sparse as sparse
from numpy.typing import NDArray
from scipy.sparse.linalg import splu

from drift_drake.car.parameters import Constants, VehicleParameters
from drift_drake.car.single_track.motion import linearize
from drift_drake.common.arrays import Array
from drift_drake.common.errors import DriftDrakeError
from drift_drake.drive.reference.equilibrium import DriftEquilibrium
from drift_drake.drive.reference.path import Path
from drift_drake.drive.reference.similarity import Similarity, similarity

# Of a car of the default one's size (`similarity`); those of others go with their wheelbase.
SPACING = 0.2  # [m] between nodes
SMOOTHING_LENGTH = 3.0  # [m] that weighs the inputs' curvature against their slope
SCALE = np.array([1.0, 10.0, 0.5, 15.0, 0.4, 150.0])  # sizes of (r, v, beta, omega_r, delta, tau)
ITERATIONS = 100
STEP_TOLERANCE = 1e-6  # largest step of a scaled unknown at the end
DEFECT_TOLERANCE = 1e-9  # of the scaled dynamics, over one interval
MIN_SPEED = 2.0  # [m/s] kept by every iterate
MIN_LINE_STEP = 1e-4
GRID_SPACING = 0.2  # [m]
COLUMNS = ("r", "v", "beta", "omega_r", "delta", "tau")


class Transition(NamedTuple):
    """A motion on a grid of M path positions, from one steady state to another."""

    s: Array
    """Distance from the start [M] [m], uniform."""
    state: Array
    """(r, v, beta, omega_r) [M, 4]."""
    input: Array
    """(delta, tau) [M, 2]."""
    curvature: Array
    """Of the path described [M] [1/m]: course rate over speed."""


class NoTransitionError(DriftDrakeError, ValueError):
    """The car cannot go from the one steady state to the other over the distance."""


@lru_cache(maxsize=64)
def plan_transition(parameters: VehicleParameters, start: DriftEquilibrium, end: DriftEquilibrium,
                    length: float) -> Transition:  # fmt: skip
    """The motion from `start` to `end` over `length` [m] with the smoothest inputs.

    Minimises the integral over s of |u'|^2 + (3 m)^2 |u''|^2 (u = (delta, tau), scaled) subject to the nominal car's
    dynamics by trapezoidal collocation over s every 0.2 m, with states and inputs fixed at both ends; both lengths are
    the default car's, and go with the wheelbase. Solved by sequential quadratic programming on the sparse KKT system,
    with the Hessian of the cost and an l1 merit function (Nocedal and Wright 2006, chapter 18). Yaw rate, course and
    curvature agree by construction: r = v kappa - beta_dot.

    Args:
        parameters: the car; start, end: steady states (a straight one: v = omega_r, all else zero).
        length: [m] of path in between.

    Raises:
        NoTransitionError: none was found, or it takes more than the steering and torque limits.
    """
    units = similarity(parameters)
    if not length >= 5.0 * SPACING * units.length:
        raise ValueError(f"length is {length:g} m; a transition needs {5.0 * SPACING * units.length:.3g} m or more")
    s = np.linspace(0.0, length / units.length, round(length / units.length / SPACING) + 1)
    constants = units.usual(parameters).constants()
    z, defect = _solve(_blend(_in_units(start, units), _in_units(end, units), s), s[1], constants)
    if defect > DEFECT_TOLERANCE:
        raise NoTransitionError(f"{_described(start, end, length)}: no motion was found; give more distance")
    steering, torque = np.abs(z[:, 4]).max(), units.torque * np.array([z[:, 5].min(), z[:, 5].max()])
    if steering > parameters.steering_limit or torque[0] < parameters.torque_min or torque[1] > parameters.torque_max:
        raise NoTransitionError(
            f"{_described(start, end, length)} takes a steering angle of {steering:.2f} rad and torques from "
            f"{torque[0]:.3g} to {torque[1]:.3g} N m, beyond the vehicle's limits of {parameters.steering_limit:g} rad "
            f"and [{parameters.torque_min:g}, {parameters.torque_max:g}] N m; give more distance"
        )
    rates, _, _ = linearize(_states(z), z[:, 4:], np.zeros(len(z)), constants)
    curvature = (rates[:, 2] + z[:, 0]) / z[:, 1] / units.length
    # Exactly the steady states' own curvature at the ends, for paths to join on.
    curvature[0], curvature[-1] = start.curvature, end.curvature
    z *= np.array([1.0 / units.time, units.speed, 1.0, units.speed, 1.0, units.torque])
    transition = Transition(s * units.length, z[:, :4].copy(), z[:, 4:].copy(), curvature)
    for values in transition:
        values.flags.writeable = False  # it is shared by all who ask for the same transition
    return transition


def _in_units(state: DriftEquilibrium, units: Similarity) -> DriftEquilibrium:
    """A steady state in the units of a car of the default one's size."""
    return DriftEquilibrium(
        v=state.v / units.speed, beta=state.beta, r=state.r * units.time, omega_r=state.omega_r / units.speed,
        delta=state.delta, tau=state.tau / units.torque, curvature=state.curvature * units.length,
    )  # fmt: skip


def _described(start: DriftEquilibrium, end: DriftEquilibrium, length: float) -> str:
    return (
        f"from a sideslip of {start.beta:g} rad at {start.v:.1f} m/s to one of {end.beta:g} rad at {end.v:.1f} m/s "
        f"within {length:g} m"
    )


def _blend(start: DriftEquilibrium, end: DriftEquilibrium, s: Array) -> Array:
    """First guess [M, 6]: all quantities blended smoothly, the yaw rate consistent with them."""
    u = s / s[-1]
    share = u**3 * (10.0 - 15.0 * u + 6.0 * u * u)
    share_slope = 30.0 * (u * (1.0 - u)) ** 2 / s[-1]
    a, b = (np.array([q.r, q.v, q.beta, q.omega_r, q.delta, q.tau]) for q in (start, end))
    z = a + share[:, None] * (b - a)
    z[:, 0] = z[:, 1] * (start.curvature + share * (end.curvature - start.curvature) - share_slope * (b[2] - a[2]))
    return z


def _states(z: Array) -> Array:
    return np.concatenate([z[:, :4], np.zeros((len(z), 2))], axis=1)


def _dynamics(z: Array, h: float, constants: Constants) -> tuple[Array, sparse.csc_matrix]:
    """Scaled collocation defects [4 (M - 1)] and their Jacobian with respect to the scaled unknowns."""
    count = len(z)
    rates, a, b = linearize(_states(z), z[:, 4:], np.zeros(len(z)), constants)
    v = z[:, 1]
    slope = rates[:, :4] / v[:, None]  # d/ds = (d/dt) / v, the car being on its own path
    jacobian = np.concatenate([a[:, :4, :4], b[:, :4]], axis=2) / v[:, None, None]
    jacobian[:, :, 1] -= slope / v[:, None]
    defects = (z[1:, :4] - z[:-1, :4] - 0.5 * h * (slope[1:] + slope[:-1])) / SCALE[:4]
    unit = np.eye(4, 6)
    scaling = SCALE / SCALE[:4, None]
    blocks = np.concatenate([-unit - 0.5 * h * jacobian[:-1], unit - 0.5 * h * jacobian[1:]], axis=2)
    blocks *= np.concatenate([scaling, scaling], axis=1)
    rows = np.broadcast_to(np.arange(4 * (count - 1)).reshape(-1, 4, 1), blocks.shape)
    columns = np.broadcast_to(6 * np.arange(count - 1)[:, None, None] + np.arange(12), blocks.shape)
    shape = (4 * (count - 1), 6 * count)
    return defects.ravel(), sparse.csc_matrix((blocks.ravel(), (rows.ravel(), columns.ravel())), shape=shape)


def _roughness(count: int, h: float) -> sparse.csc_matrix:
    """Hessian of the cost with respect to the scaled unknowns [6 M, 6 M]: slope and curvature of the inputs."""
    inputs = sparse.diags([0.0, 0.0, 0.0, 0.0, 1.0, 1.0])
    first = sparse.diags([-1.0, 1.0], [0, 1], shape=(count - 1, count)) / h
    second = sparse.diags([1.0, -2.0, 1.0], [0, 1, 2], shape=(count - 2, count)) * (SMOOTHING_LENGTH / h**2)
    return sparse.csc_matrix(sparse.kron(h * (first.T @ first + second.T @ second), inputs))


def _solve(z: Array, h: float, constants: Constants) -> tuple[Array, float]:
    """(unknowns [M, 6], largest scaled defect left) from a first guess whose ends stay as they are."""
    hessian = _roughness(len(z), h)
    free = np.arange(6, z.size - 6)
    free_hessian = hessian[free][:, free]

    def cost(z: Array) -> float:
        q = (z / SCALE).ravel()
        return 0.5 * float(q @ (hessian @ q))

    penalty = 1.0
    defects, jacobian = _dynamics(z, h, constants)
    for _ in range(ITERATIONS):
        gradient = (hessian @ (z / SCALE).ravel())[free]
        kkt = sparse.bmat([[free_hessian, jacobian[:, free].T], [jacobian[:, free], None]], format="csc")
        solution = splu(kkt).solve(-np.concatenate([gradient, defects]))
        step = np.zeros(z.size)
        step[free], multipliers = solution[: len(free)], solution[len(free) :]
        penalty = max(penalty, 1.5 * float(np.abs(multipliers).max()))
        infeasibility = float(np.abs(defects).sum())
        merit = cost(z) + penalty * infeasibility
        decrease = float(gradient @ step[free]) - penalty * infeasibility
        fraction = 1.0
        while True:
            trial = z + fraction * step.reshape(z.shape) * SCALE
            if trial[:, [1, 3]].min() > MIN_SPEED:
                defects, jacobian = _dynamics(trial, h, constants)
                if cost(trial) + penalty * float(np.abs(defects).sum()) <= merit + 1e-4 * fraction * decrease:
                    break
            if fraction < MIN_LINE_STEP:
                break
            fraction *= 0.5
        z = trial
        if np.abs(step).max() < STEP_TOLERANCE:
            break
    return z, float(np.abs(defects).max())


class Leg(NamedTuple):
    """A steady stretch of a manoeuvre, and the transition that leads to the next one."""

    state: DriftEquilibrium
    length: float
    """[m], may be 0."""
    transition: float
    """[m] from this leg's end to the next one's start; 0 with the same state there."""


class Chain(NamedTuple):
    """A path and the motion along it, on a uniform grid of M path positions."""

    path: Path
    s: Array
    columns: dict[str, Array]
    """The states and inputs of COLUMNS and the path's curvature, each [M]."""
    in_transition: NDArray[np.bool_]
    """Where the curvature changes [M]."""


def steady_straight(v: float) -> DriftEquilibrium:
    """Straight ahead at a speed [m/s]; the nominal car rolls without resistance."""
    return DriftEquilibrium(v=v, beta=0.0, r=0.0, omega_r=v, delta=0.0, tau=0.0, curvature=0.0)


def other_side(state: DriftEquilibrium) -> DriftEquilibrium:
    """The same steady state to the other side."""
    return state._replace(
        beta=-state.beta, r=-state.r, delta=-state.delta, curvature=-state.curvature
    )  # fmt: skip


def chain(parameters: VehicleParameters, legs: list[Leg], start: tuple[float, float, float],
          closed: bool = False) -> Chain:  # fmt: skip
    """Joins legs into one path and motion.

    Args:
        parameters: the car; legs: in the order driven, the last one's transition unused.
        start: world pose (x, y, heading) at s = 0; closed: whether the last leg ends where the first one starts.

    Raises:
        NoTransitionError: the car cannot go from one leg to the next over the distance given.
    """
    pieces, turning = [], []
    for index, leg in enumerate(legs):
        if leg.length > 0.0:
            pieces.append(_steady(leg))
            turning.append(False)
        if index + 1 < len(legs) and leg.transition > 0.0:
            following = legs[index + 1].state
            pieces.append(plan_transition(parameters, leg.state, following, leg.transition))
            turning.append(leg.state.curvature != following.curvature)
    offsets = np.concatenate([[0.0], np.cumsum([piece.s[-1] for piece in pieces])])
    # Where pieces meet they agree, so that a piece's last node is the next one's first.
    keep = [slice(None, -1)] * (len(pieces) - 1) + [slice(None)]
    nodes = np.concatenate([piece.s[k] + offset for piece, k, offset in zip(pieces, keep, offsets, strict=False)])
    curvature = np.concatenate([piece.curvature[k] for piece, k in zip(pieces, keep, strict=True)])
    motion = np.concatenate([np.hstack([piece.state, piece.input])[k] for piece, k in zip(pieces, keep, strict=True)])
    path = Path(nodes, curvature, start, closed)
    spacing = GRID_SPACING * similarity(parameters).length
    s = np.linspace(0.0, path.length, math.ceil(path.length / spacing) + 1)
    columns = {name: np.interp(s, nodes, motion[:, index]) for index, name in enumerate(COLUMNS)}
    columns["curvature"] = np.interp(s, nodes, curvature)
    in_transition = np.array(turning)[np.searchsorted(offsets[1:-1], s, side="right")]
    return Chain(path, s, columns, in_transition)


def _steady(leg: Leg) -> Transition:
    q = leg.state
    return Transition(
        s=np.array([0.0, leg.length]), state=np.tile([q.r, q.v, q.beta, q.omega_r], (2, 1)),
        input=np.tile([q.delta, q.tau], (2, 1)), curvature=np.full(2, q.curvature))  # fmt: skip
