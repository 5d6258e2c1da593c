"""The car's state where some channels of a reading are of no use: an extended Kalman filter about the nominal car.

A reading whose channels are all good is the state. While some are not, the state is predicted from the last good one by
the nominal model, with what that model has lately got wrong, and corrected by the channels that are left: a sideslip
that is missing follows from how the car moves across its path, a speed from how fast it moves along it.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from drift_drake.car.sensors import MEASURED_STATE
from drift_drake.common.arrays import Array

Mask = NDArray[np.bool_]
SIZE = len(MEASURED_STATE)
FORCES = 4  # of (r, v, beta, omega_r): the states that forces act on
SIDESLIP, COURSE = (MEASURED_STATE.index(name) for name in ("beta", "dphi"))  # a force across turns both alike
CORRELATED = 0.2  # [s] over which forces that are not modelled stay the same
LEARNING = 0.3  # [s] of good readings that say what the model gets wrong
FORGETTING = 1.0  # [s] for which that holds once readings are not good
GATE = 5.0  # standard deviations within which a channel is used
FARTHEST = 2.0  # times the standard deviation of unknown forces: more is not learnt


class Fused(NamedTuple):
    """A state with its uncertainty, and what the model lately got wrong, as it lies in a vector."""

    covariance: Array  # [7, 7]
    lacking: Array  # [4] of the rates of (r, v, beta, omega_r)

    def vector(self) -> Array:
        """All of it [53]."""
        return np.concatenate([self.covariance.ravel(), self.lacking])

    @classmethod
    def of(cls, vector: Array) -> "Fused":
        """The inverse of `vector`."""
        return cls(vector[: SIZE * SIZE].reshape(SIZE, SIZE), np.array(vector[SIZE * SIZE :]))

    @classmethod
    def after_good(cls, noise: Array) -> "Fused":
        """After a good reading with noise [7], nothing being known to lack."""
        return cls(np.diag(noise**2), np.zeros(FORCES))


def learnt(before: Fused, change: Array, rates: Array, noise: Array, period: float) -> Fused:
    """After a good reading that differs by `change` [7] from what the model predicted.

    Args:
        rates: standard deviations [7] of the rates by forces that are not modelled; noise: of a reading [7];
            period: since the last good one [s].
    """
    share = min(period / LEARNING, 1.0)
    most = FARTHEST * rates[:FORCES]
    found = np.clip(change[:FORCES] / period, -most / share, most / share)
    lacking = np.clip(before.lacking + share * (found - before.lacking), -most, most)
    return Fused(np.diag(noise**2), lacking)


def predicted(x: Array, before: Fused, jacobian: Array, rates: Array, period: float) -> tuple[Array, Fused]:
    """A predicted state [7] with what the model lacks added, and its uncertainty.

    Args:
        x: as the model predicts it; jacobian: of that [7, 7]; rates: standard deviations [7] of the rates by forces
            that are not modelled.
    """
    moved = x.copy()
    moved[:FORCES] += period * before.lacking
    moved[COURSE] += period * before.lacking[SIDESLIP]
    covariance = jacobian @ before.covariance @ jacobian.T + np.diag(rates**2 * period * max(CORRELATED, period))
    return moved, Fused(covariance, before.lacking * math.exp(-period / FORGETTING))


def corrected(x: Array, state: Fused, reading: Array, used: Mask, noise: Array, length: float) -> tuple[Array, Fused]:
    """A predicted state [7] corrected by the channels of a reading that are used [7] and within their gates.

    Args:
        noise: standard deviations of the reading [7]; length: of a closed path [m], on which the path position may
            start anew; infinite on an open one.
    """
    difference = reading - x
    if math.isfinite(length):
        difference[-1] = math.remainder(difference[-1], length) if math.isfinite(difference[-1]) else math.nan
    kept = np.flatnonzero(used & within_gate(difference, state, noise))
    if kept.size == 0:
        return x, state
    p = state.covariance[:, kept]
    gain = np.linalg.solve(p[kept] + np.diag(noise[kept] ** 2), p.T).T
    covariance = state.covariance - gain @ p.T
    return x + gain @ difference[kept], state._replace(covariance=0.5 * (covariance + covariance.T))


def within_gate(difference: Array, state: Fused, noise: Array) -> Mask:
    """Which channels [7] differ from a state by no more than both are uncertain."""
    with np.errstate(invalid="ignore"):
        near = np.abs(difference) <= GATE * np.sqrt(np.diag(state.covariance) + noise**2)
    return np.asarray(near, dtype=np.bool_)
