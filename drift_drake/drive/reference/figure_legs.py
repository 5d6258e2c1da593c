"""The legs of a figure-8: two drifts and two transitions, with arcs as long as it takes to close."""

import math

import numpy as np
from scipy.optimize import brentq

from drift_drake.car.parameters import VehicleParameters
from drift_drake.drive.reference.chain import Leg, NoTransitionError, Transition, chain, other_side, plan_transition
from drift_drake.drive.reference.equilibrium import drift_equilibrium
from drift_drake.drive.reference.path import Path
from drift_drake.drive.reference.remedies import Asked


def figure_8_legs(parameters: VehicleParameters, asked: Asked) -> tuple[list[Leg], Path]:
    """Legs of a figure-8 and its path, the left-hand circle about the origin."""
    radius, sideslip, transition = asked
    left = drift_equilibrium(parameters, radius, -sideslip)
    right = other_side(left)
    arc = _closing_arc(left.curvature, plan_transition(parameters, left, right, transition))
    legs = [Leg(left, 0.5 * arc, transition), Leg(right, arc, transition), Leg(left, 0.5 * arc, 0.0)]
    return legs, chain(parameters, legs, (-radius, 0.0, -0.5 * math.pi), closed=True).path


def _closing_arc(curvature: float, transition: Transition) -> float:
    """Length [m] of the arcs with which a figure-8 closes.

    The second half of the figure is the first one's mirror image, so that it closes where the first half's chord is
    at right angles to half its turning.
    """

    def gap(arc: float) -> float:
        half = Path(np.concatenate([[0.0], arc + transition.s]), np.concatenate([[curvature], transition.curvature]))
        x, y, _ = half.pose(half.length)
        return float(x * math.cos(0.5 * half.turning) + y * math.sin(0.5 * half.turning))

    full_turn = 2.0 * math.pi / curvature
    arcs = np.linspace(0.4, 0.99, 60) * full_turn
    gaps = np.array([gap(arc) for arc in arcs])
    crossings = np.flatnonzero(gaps[1:] * gaps[:-1] <= 0.0)
    if len(crossings) == 0:
        raise NoTransitionError(
            f"a figure-8 of {1.0 / curvature:g} m radius cannot close with transitions of {transition.s[-1]:g} m; "
            "give shorter transitions"
        )
    return float(brentq(gap, arcs[crossings[0]], arcs[crossings[0] + 1], xtol=1e-12))
