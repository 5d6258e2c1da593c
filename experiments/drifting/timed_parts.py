"""Parts of a plan that count the CPU time spent in them, and the bare products of the network's matrices."""

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from drift_drake.car.step_model import StepModel
from drift_drake.common.arrays import Array
from drift_drake.drive.learnt.features import HIDDEN_COUNT, STATE_COUNT, Network
from drift_drake.drive.qp.qp import QpSolution, QpWorkspace


class TimedQp(QpWorkspace):
    """A QP workspace that counts the CPU time spent in it."""

    def __init__(self, workspace: QpWorkspace) -> None:
        self._workspace, self.seconds = workspace, 0.0

    def solve(self, *arguments: Any) -> QpSolution:
        start = time.thread_time()
        result = self._workspace.solve(*arguments)
        self.seconds += time.thread_time() - start
        return result


class TimedModel(StepModel):
    """A step model that counts the CPU time spent in it: in `linearize` and, by the line search, in `step`."""

    def __init__(self, model: StepModel) -> None:
        self._model = model
        self.internal_scale = model.internal_scale
        self.linearise = self.step_time = 0.0

    def step(self, x: Array, u: Array, u_next: Array, curvature: Array) -> Array:
        start = time.thread_time()
        result = self._model.step(x, u, u_next, curvature)
        self.step_time += time.thread_time() - start
        return result

    def linearize(self, x: Array, u: Array, u_next: Array, curvature: Array) -> tuple[Array, Array, Array, Array]:
        start = time.thread_time()
        result = self._model.linearize(x, u, u_next, curvature)
        self.linearise += time.thread_time() - start
        return result


def network_products(network: Network, horizon: int) -> tuple[Callable[[], None], Callable[[], None]]:
    """What computes the matrix products of one call of the model's `step`, and of its `linearize`, and nothing else."""
    w1, w2 = np.ascontiguousarray(network.w1), np.ascontiguousarray(network.w2)
    rows, reverse = np.ones((horizon, w1.shape[0])), np.ones((STATE_COUNT * horizon, HIDDEN_COUNT))
    h1, h2 = np.empty((horizon, HIDDEN_COUNT)), np.empty((horizon, HIDDEN_COUNT))
    w_out, w1_t, w2_t = np.ones((HIDDEN_COUNT, STATE_COUNT)), np.ascontiguousarray(w1.T), np.ascontiguousarray(w2.T)
    g1, g0 = np.empty_like(reverse), np.empty((STATE_COUNT * horizon, w1.shape[0]))

    def forward() -> None:
        np.matmul(rows, w1, out=h1)
        np.matmul(h1, w2, out=h2)
        np.matmul(h2, w_out)

    def both() -> None:
        forward()
        np.matmul(reverse, w2_t, out=g1)
        np.matmul(g1, w1_t, out=g0)

    return forward, both


def cpu(call: Callable[[], Any]) -> tuple[float, Any]:
    """(CPU time [s], result) of a call."""
    start = time.thread_time()
    result = call()
    return time.thread_time() - start, result
