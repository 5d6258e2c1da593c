"""What follows from a named cause: the controller believes the corrected car, and readings lose their sensor's error.

The policy. From the moment that a change is reported the most probable cause is put in, with its magnitude, where it
acts: on the motion, in the controller's model; on a sensor, in the readings. It need not be named for that: what
explains the last rows best is nearer to the car than a simulator that does not explain them. It is followed until the
simulator is believed again. A cause that neither can take (a transport delay, a latency, a road's grade) and an unknown
one change nothing.
"""

from typing import Any

import numpy as np
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

from drift_drake.control.effects_step import BEYOND
from drift_drake.monitoring.evidence import ALARM, TRUSTED
from drift_drake.monitoring.monitor import Monitor
from drift_drake.sensing.sensors import MEASURED_STATE
from drift_drake.vehicle.effects import COUNT, Effects

SENSORS = ("gyro_bias", "sideslip_bias", "wheel_radius_error")  # errors that a reading can lose


def cause_to_take(labels: tuple[str, ...], posterior: np.ndarray) -> str | None:
    """The most probable cause once a change is reported, if the model or the readings can take it."""
    leading = 1 + int(np.argmax(posterior[1:]))
    name = labels[leading]
    takes = name in Effects._fields and (name in SENSORS or name not in BEYOND)
    return name if posterior[0] < ALARM and takes else None


def corrected(held: np.ndarray, labels: tuple[str, ...], posterior: np.ndarray, magnitude: float) -> np.ndarray:
    """The correction, magnitudes [COUNT] in the order of `Effects`, after a verdict.

    Args:
        held: the correction before it; labels: of the posterior; magnitude: of the leading effect.
    """
    if posterior[0] >= TRUSTED:
        return np.zeros(COUNT)
    name = cause_to_take(labels, posterior)
    if name is None or not np.isfinite(magnitude):
        return held
    return np.array(Effects(**{name: magnitude}), dtype=float)


def for_model(correction: np.ndarray) -> np.ndarray:
    """The part of a correction that acts on the motion."""
    return np.where([name in BEYOND for name in Effects._fields], 0.0, correction)


def corrected_reading(measured: np.ndarray, correction: np.ndarray) -> np.ndarray:
    """A measured state [7] without its sensors' errors; the course takes over the sideslip's."""
    q, y = Effects(*correction), measured.copy()
    at = {name: MEASURED_STATE.index(name) for name in ("r", "beta", "dphi", "omega_r")}
    y[at["r"]] -= q.gyro_bias
    y[at["beta"]] -= q.sideslip_bias
    y[at["dphi"]] -= q.sideslip_bias
    y[at["omega_r"]] /= 1.0 + q.wheel_radius_error
    return y


class GapCorrection(LeafSystem):
    """The policy as a system, between `GapMonitor` and the controller.

    Input ports: posterior, magnitude [3] of `GapMonitor`; measured_state [7].
    Output ports: correction [COUNT], in the order of `Effects`; effects [COUNT], what of it acts on the motion;
    corrected_state [7].
    State in the Context, each period of the monitor: the correction.
    """

    def __init__(self, monitor: Monitor) -> None:
        LeafSystem.__init__(self)
        self._labels = monitor.labels
        self._posterior = self.DeclareVectorInputPort("posterior", len(self._labels))
        self._magnitude = self.DeclareVectorInputPort("magnitude", 3)
        self._measured = self.DeclareVectorInputPort("measured_state", len(MEASURED_STATE))
        self._held = self.DeclareDiscreteState(np.zeros(COUNT))
        self.DeclarePeriodicDiscreteUpdateEvent(monitor.bank.period, 0.0, self._update)
        held = self.discrete_state_ticket(self._held)
        self.DeclareStateOutputPort("correction", self._held)
        self.DeclareVectorOutputPort("effects", COUNT, self._calc_effects, prerequisites_of_calc={held})
        self.DeclareVectorOutputPort(
            "corrected_state", len(MEASURED_STATE), self._calc_reading,
            prerequisites_of_calc={held, self.input_port_ticket(self._measured.get_index())},
        )  # fmt: skip

    def _update(self, context: Context, discrete: DiscreteValues) -> None:
        held = context.get_discrete_state(self._held).value()
        magnitude = float(self._magnitude.Eval(context)[0])
        discrete.set_value(self._held, corrected(held, self._labels, self._posterior.Eval(context), magnitude))

    def _calc_effects(self, context: Context, output: Any) -> None:
        output.SetFromVector(for_model(context.get_discrete_state(self._held).value()))

    def _calc_reading(self, context: Context, output: Any) -> None:
        held = context.get_discrete_state(self._held).value()
        output.SetFromVector(corrected_reading(self._measured.Eval(context), held))
