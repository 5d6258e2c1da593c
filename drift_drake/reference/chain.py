"""Manoeuvres put together from steady legs and the transitions between them."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from drift_drake.arrays import Array
from drift_drake.reference.equilibrium import DriftEquilibrium
from drift_drake.reference.path import Path
from drift_drake.reference.transition import Transition, plan_transition
from drift_drake.vehicle.parameters import VehicleParameters

GRID_SPACING = 0.2  # [m]
COLUMNS = ("r", "v", "beta", "omega_r", "delta", "tau")


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
    s = np.linspace(0.0, path.length, math.ceil(path.length / GRID_SPACING) + 1)
    columns = {name: np.interp(s, nodes, motion[:, index]) for index, name in enumerate(COLUMNS)}
    columns["curvature"] = np.interp(s, nodes, curvature)
    in_transition = np.array(turning)[np.searchsorted(offsets[1:-1], s, side="right")]
    return Chain(path, s, columns, in_transition)


def _steady(leg: Leg) -> Transition:
    q = leg.state
    return Transition(
        s=np.array([0.0, leg.length]), state=np.tile([q.r, q.v, q.beta, q.omega_r], (2, 1)),
        input=np.tile([q.delta, q.tau], (2, 1)), curvature=np.full(2, q.curvature))  # fmt: skip
