"""What one window of predictions says of each effect: its scores, their information, and what each node does to them.

The same as `gap.estimation.scores` of a whole day, for the newest window alone. A window counts as its driving was
predicted in the calibration, less outside of what it had, and not at all far outside.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.equations import CarConstants
from drift_drake.gap.estimation.baseline import slipping_in
from drift_drake.gap.estimation.normal import Normal
from drift_drake.gap.estimation.scores import LARGEST, huber_weights, moved_by
from drift_drake.gap.estimation.unknowns import added
from drift_drake.gap.estimation.windows import WindowedRun, regimes
from drift_drake.gap.monitoring.bank import Node

FEATURES = ("speed", "lateral acceleration", "sideslip", "slip of the driven wheels", "least torque", "most torque")
LOST = 100.0  # robust scales, from which on a prediction is lost
SLIP = 3
SLIGHT_SLIP = 0.03  # [-] of slip along the wheels, below which more of it is no other driving
MOST = 400  # points, evenly chosen
KNOWN = 0.97  # quantile of the distance of a calibration's own windows from its other recordings'
APART = 15  # windows of the only recording that are not near each other, either side
NEAREST = 12  # points that say how well such driving is predicted
FAR = 6.0
"""Times the distance that is usual of a calibration, beyond which a window is not judged; set on the coupe and the
roadster of this repository."""


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
    normal: Normal  # its baseline, on whose effects errors are projected
    nodes: Sequence[Node]

    def car(self) -> tuple[CarConstants, Effects]:
        """The calibrated car."""
        return self.constants, self.own

    def effects(self) -> list[tuple[str, float]]:
        """The effect of each node, then a unit of each effect that has several nodes."""
        each = zip(self.normal.names, self.normal.units, self.nodes_of(), strict=True)
        more = [(name, float(unit)) for name, unit, at in each if len(at) != 1]
        return [(node.name, node.magnitude) for node in self.nodes] + more

    def cars(self) -> list[tuple[CarConstants, Effects]]:
        """It with each of `effects`."""
        return [(self.constants, added(self.own, {name: q})) for name, q in self.effects()]

    def nodes_of(self) -> list[list[int]]:
        """Indices of each effect's nodes."""
        return [[i for i, node in enumerate(self.nodes) if node.name == name] for name in self.normal.names]


def no_windows(n: int, nodes: int) -> WindowSums:
    """Zeros, of n effects."""
    return WindowSums(np.zeros(()), np.zeros(()), np.zeros(n), np.zeros((n, n)), np.zeros((n, nodes)))


def sums_of(projection: Projection, window: WindowedRun, e: np.ndarray, with_effects: np.ndarray) -> WindowSums:
    """The sums of one window with errors e [1, HORIZONS, channels] under the calibrated car.

    Args:
        with_effects: the same [cars, HORIZONS, channels] of each of `Projection.cars`.

    Errors that are clipped count less, and as much less in what a node does to them: however large an effect is, its
    node's shift is in proportion to it. An effect with one node is linear enough for that to give its derivative.
    """
    p, normal = projection, projection.normal
    precision, scales = normal.precision, normal.scales

    single = [at[0] if len(at) == 1 else None for at in p.nodes_of()]
    moved = [moved_by(one, e[0], *effect) for one, effect in zip(with_effects, p.effects(), strict=True)]
    found = np.clip(np.array(moved) / scales, -LOST, LOST)
    nodes = len(p.nodes)
    there, further = found[:nodes].reshape(nodes, -1), iter(found[nodes:])
    jacobian = np.stack([
        np.clip(unit / p.nodes[at].magnitude * there[at] if at is not None else next(further).reshape(-1),
                -LARGEST, LARGEST)
        for unit, at in zip(normal.units, single, strict=True)
    ], axis=-1)  # fmt: skip
    weights = np.broadcast_to(huber_weights(e, scales), e.shape).reshape(-1)
    projected, half = (jacobian.T @ precision) * weights, np.sqrt(weights)[:, None] * jacobian
    slipping = float(slipping_in([window])[0]) - normal.slipping
    return WindowSums(np.ones(()), np.asarray(slipping), projected @ (e / scales).reshape(-1),
                      half.T @ precision @ half, projected @ np.stack(there, axis=-1))  # fmt: skip


def weighted(sums: WindowSums, weight: float) -> WindowSums:
    """A window that counts less."""
    return WindowSums(sums.windows, sums.slipping, *(weight * part for part in sums[2:]))


def features(window: WindowedRun) -> np.ndarray:
    """How a window is driven [FEATURES]; what is hard in one way may be known from elsewhere, not together."""
    found = regimes(window)[0]
    found[SLIP] = np.log(SLIGHT_SLIP + found[SLIP])
    tau = window.tau[window.starts[0] :]
    return np.concatenate([found, [tau.min(), tau.max()]])


class KnownDriving(NamedTuple):
    """The driving of a calibration's windows, and how well it was predicted."""

    points: np.ndarray  # [k, FEATURES]
    size: np.ndarray  # [FEATURES] standard deviations
    limit: float  # distance of a window from the other recordings' that is usual of the calibration
    errors: np.ndarray  # [k] squared distance of each point's window from normal, over the median

    def distances(self, driving: np.ndarray) -> np.ndarray:
        """Of driving [FEATURES] from each point [k], over the one that is usual."""
        return np.asarray(np.linalg.norm((self.points - driving) / self.size, axis=1) / self.limit)


def familiar_of(driving: Sequence[np.ndarray], errors: Sequence[np.ndarray]) -> KnownDriving:
    """The driving of recordings, each [windows, FEATURES], and `KnownDriving.errors` of each [windows]."""
    whole = np.concatenate(driving)
    size = np.maximum(whole.std(axis=0), 1e-9 + 1e-3 * np.abs(whole).max(axis=0))
    at = np.repeat(np.arange(len(driving)), [len(part) for part in driving])
    order = np.arange(len(whole))
    found = []
    for i in order:
        other = at != at[i] if len(driving) > 1 else np.abs(order - i) > APART
        if np.any(other):
            found.append(np.min(np.linalg.norm((whole[other] - whole[i]) / size, axis=1)))
    limit = max(float(np.quantile(found, KNOWN)) if found else 1.0, 1e-3)
    every = max(int(np.ceil(len(whole) / MOST)), 1)
    return KnownDriving(whole[::every], size, limit, np.concatenate(errors)[::every])


def weight_of(familiar: KnownDriving, driving: np.ndarray) -> float:
    """How much a window counts that is driven so [FEATURES]: one over what its squared errors are taken to grow by.

    They are those of the windows that are driven most like it, and larger outside of known driving: errors are taken to
    grow in proportion to the distance from it.
    """
    distances = familiar.distances(driving)
    usual = float(np.mean(familiar.errors[np.argsort(distances)[:NEAREST]]))
    return 1.0 / (max(usual, 1.0) * max(float(distances.min()), 1.0) ** 2)


def weights_left_out(
    familiar: KnownDriving, driving: Sequence[np.ndarray], errors: Sequence[np.ndarray]
) -> list[np.ndarray]:
    """Of each recording's windows [windows], as if it had not been among those that are known."""
    out = []
    for i, part in enumerate(driving):
        others = [j for j in range(len(driving)) if j != i] or [i]
        known = familiar._replace(
            points=np.concatenate([driving[j] for j in others]), errors=np.concatenate([errors[j] for j in others])
        )
        out.append(np.array([weight_of(known, one) for one in part]))
    return out


def unlike(familiar: KnownDriving, driving: np.ndarray) -> int | None:
    """Index of the feature by which a window's driving [FEATURES] is far off all that is known; None where it is not.

    A sensor's fault moves the features as well, less far.
    """
    distances = familiar.distances(driving)
    nearest = int(np.argmin(distances))
    off = np.abs((familiar.points[nearest] - driving) / familiar.size)
    return int(np.argmax(off)) if distances[nearest] > FAR else None


def harder(index: int) -> str:
    """The feature in words."""
    return FEATURES[index]
