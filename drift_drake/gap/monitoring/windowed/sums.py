"""What one window of predictions says of each effect: its scores, their information, and what each node does to them.

The same as `gap.estimation.scores` of a whole day, for the newest window alone.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.equations import CarConstants
from drift_drake.gap.estimation.normal import Normal
from drift_drake.gap.estimation.scores import LARGEST, huber_weights
from drift_drake.gap.estimation.unknowns import added
from drift_drake.gap.estimation.windows import WindowedRun, regimes, run_errors
from drift_drake.gap.monitoring.bank import Node

FEATURES = ("speed", "lateral acceleration", "sideslip", "slip of the driven wheels", "least torque", "most torque")
LOST = 100.0  # robust scales, from which on a prediction is lost
SLIP = 3
SLIGHT_SLIP = 0.03  # [-] of slip along the wheels, below which more of it is no other driving


class WindowSums(NamedTuple):
    """Sums over windows; arrays of them have a leading axis."""

    windows: np.ndarray  # [] that counted
    slipping: np.ndarray  # [] of `baseline.slipping_of` beyond the baseline's mean
    score: np.ndarray  # [n] derivatives of half the squared errors by each effect, in units
    information: np.ndarray  # [n, n]
    shift: np.ndarray  # [n, K] of the scores, by each node of the catalogue put into the car


class Projection(NamedTuple):
    """The calibrated car and what its errors are projected on."""

    constants: CarConstants
    own: Effects
    names: tuple[str, ...]  # of the effects
    units: np.ndarray  # [n]
    nodes: tuple[Node, ...]
    scales: np.ndarray  # [HORIZONS, channels]
    precision: np.ndarray  # of errors in scales
    nodes_of: tuple[tuple[int, ...], ...]  # indices of each effect's nodes

    def errors_with(self, window: WindowedRun, name: str, magnitude: float) -> np.ndarray:
        """Errors [1, HORIZONS, channels] once an effect is added to the car."""
        return run_errors(window, self.constants, added(self.own, {name: magnitude}))


def projection_of(constants: CarConstants, own: Effects, normal: Normal, nodes: Sequence[Node]) -> Projection:
    """The projection on the effects of a baseline."""
    nodes_of = tuple(tuple(i for i, node in enumerate(nodes) if node.name == name) for name in normal.names)
    return Projection(
        constants, own, normal.names, normal.units, tuple(nodes), normal.scales, normal.precision, nodes_of
    )


def no_windows(n: int, nodes: int) -> WindowSums:
    """Zeros, of n effects."""
    return WindowSums(np.zeros(()), np.zeros(()), np.zeros(n), np.zeros((n, n)), np.zeros((n, nodes)))


def sums_of(projection: Projection, window: WindowedRun, e: np.ndarray, slipping: float) -> WindowSums:
    """The sums of one window with errors e [1, HORIZONS, channels] under the calibrated car.

    Errors that are clipped count less, and as much less in what a node does to them: however large an effect is, its
    node's shift is in proportion to it. An effect with one node is linear enough for that to give its derivative.
    """
    p, precision = projection, projection.precision

    def moved(name: str, magnitude: float) -> np.ndarray:
        return np.clip((p.errors_with(window, name, magnitude) - e) / p.scales, -LOST, LOST).reshape(-1)

    there = [moved(node.name, node.magnitude) for node in p.nodes]
    jacobian = np.stack([
        np.clip(unit / p.nodes[at[0]].magnitude * there[at[0]] if len(at) == 1 else moved(name, float(unit)),
                -LARGEST, LARGEST)
        for name, unit, at in zip(p.names, p.units, p.nodes_of, strict=True)
    ], axis=-1)  # fmt: skip
    weights = np.broadcast_to(huber_weights(e, p.scales), e.shape).reshape(-1)
    projected, half = (jacobian.T @ precision) * weights, np.sqrt(weights)[:, None] * jacobian
    return WindowSums(np.ones(()), np.asarray(slipping), projected @ (e / p.scales).reshape(-1),
                      half.T @ precision @ half, projected @ np.stack(there, axis=-1))  # fmt: skip


def features(window: WindowedRun) -> np.ndarray:
    """How a window is driven [FEATURES]; what is hard in one way may be known from elsewhere, not together."""
    found = regimes(window)[0]
    found[SLIP] = np.log(SLIGHT_SLIP + found[SLIP])
    tau = window.tau[window.starts[0] :]
    return np.concatenate([found, [tau.min(), tau.max()]])
