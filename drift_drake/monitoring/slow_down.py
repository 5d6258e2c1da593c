"""What else may follow from a gap: the car drives its lane slowly, in grip, until the simulator is believed again.

The policy. Once a change is reported, plans made by a model that is wrong are not followed; the law of the safe stop
takes the car out of its drift and on along its lane, at a pace at which the bends ask little of the tyres. When the
simulator is believed again, or a correction stands for what has changed, plans are followed again; and where a sensor's
error is the probable cause, since the law follows the readings more closely than plans do. So it is where readings were
refused right before a change is reported: a change of the car's forces bends the readings' course, a sensor's error
breaks it.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

from drift_drake.control.plan import plan_size
from drift_drake.control.stopping import stopping_command, stopping_plan
from drift_drake.monitoring.correction import SENSORS, cause_to_take
from drift_drake.monitoring.evidence import ALARM, TRUSTED
from drift_drake.reference.trajectory import Reference
from drift_drake.sensing.screening import ReadingKind
from drift_drake.vehicle.effects import COUNT
from drift_drake.vehicle.parameters import VehicleParameters

GRIP_SHARE = 0.3  # of the tyres' friction that the tightest bend asks for at the safe pace
PROBABLE = 0.5
REFUSED = (ReadingKind.JUMPED, ReadingKind.DISAGREEING)
DOUBTED = 1.0  # [s] after readings were refused; a sensor's error is reported within it
UNWINDING = 0.5  # [1/s] of the sideslip: on a slippery road it is the slide that sheds speed


def safe_pace(reference: Reference, parameters: VehicleParameters) -> float:
    """The pace [m/s] at which a reference's tightest bend asks for `GRIP_SHARE` of the friction; none above its own."""
    tightest = max(float(np.abs(reference.curvature).max()), 1e-6)
    return min(
        float(np.sqrt(GRIP_SHARE * parameters.friction * parameters.gravity / tightest)), float(reference.v.min())
    )


def slowed(slow: bool, none: float, sensor: bool, corrected: bool) -> bool:
    """Whether the car is to be slow after a verdict.

    Args:
        slow: whether it was; none: probability that the simulator lacks nothing;
        sensor: whether it is probably a sensor's error; corrected: whether the controller knows what it lacks.
    """
    return not corrected and not sensor and (none < ALARM or (slow and none < TRUSTED))


class SlowDown(LeafSystem):
    """Hands plans on while the simulator is believed; else it drives the lane at a safe pace.

    Without a reading it hands the plan on too, which is then old: that is the safe stop's to answer.

    Input ports: plan [1 + 2 (N + 1)]; command [2], in force; state [7]: (r, v, beta, omega_r, e, dphi, s), NaN where
    there is no reading; posterior, of `GapMonitor`; correction [COUNT] (optional), of `GapCorrection`: while it is not
    zero, plans are followed; reading [1] (optional), a `ReadingKind`, of `Screen`.
    Output ports: plan; slow [1], 1 while the car is driven slowly.
    State in the Context, each `period`: whether it is, and the time [s] until which readings are doubted.

    Args:
        labels: of the posterior; steps: N.
    """

    def __init__(
        self,
        parameters: VehicleParameters,
        reference: Reference,
        labels: Sequence[str],
        steps: int,
        period: float = 0.01,
    ) -> None:
        LeafSystem.__init__(self)
        self._parameters, self._path, self._steps, self._period = parameters, reference.path, steps, period
        self.pace = safe_pace(reference, parameters)
        self._plan = self.DeclareVectorInputPort("plan", plan_size(steps))
        self._command = self.DeclareVectorInputPort("command", 2)
        self._state = self.DeclareVectorInputPort("state", 7)
        self._posterior = self.DeclareVectorInputPort("posterior", len(labels))
        self._labels = tuple(labels)
        self._sensors = [i for i, name in enumerate(labels) if name in SENSORS]
        self._correction = self.DeclareVectorInputPort("correction", COUNT)
        self._reading = self.DeclareVectorInputPort("reading", 1)
        self._slow, self._doubted = self.DeclareDiscreteState(1), self.DeclareDiscreteState(1)
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)
        self.DeclareVectorOutputPort("paced_plan", plan_size(steps), self._calc)
        self.DeclareStateOutputPort("slow", self._slow)

    def _calc(self, context: Context, output: Any) -> None:
        x = self._state.Eval(context)
        if not (self._is_slow(context) and np.isfinite(x).all()):
            output.SetFromVector(self._plan.Eval(context))
            return
        wanted = stopping_command(x[:6], self._path.curvature(float(x[6])), self._parameters, self.pace, UNWINDING)
        plan = stopping_plan(context.get_time(), self._command.Eval(context), wanted, self._steps, self._period)
        output.SetFromVector(plan.vector())

    def _is_slow(self, context: Context) -> bool:
        return bool(context.get_discrete_state(self._slow).value()[0])

    def _update(self, context: Context, discrete: DiscreteValues) -> None:
        p = self._posterior.Eval(context)
        corrected = self._correction.HasValue(context) and (
            cause_to_take(self._labels, p) is not None or bool(np.any(self._correction.Eval(context)))
        )
        doubted = self._doubted_until(context, believed=bool(p[0] >= TRUSTED))
        sensor = context.get_time() < doubted or float(p[self._sensors].sum()) >= PROBABLE
        slow = slowed(self._is_slow(context), float(p[0]), sensor, corrected)
        discrete.get_mutable_vector(self._slow)[0] = float(slow)
        discrete.get_mutable_vector(self._doubted)[0] = doubted

    def _doubted_until(self, context: Context, believed: bool) -> float:
        """For a while after readings were refused, and on while the simulator is not believed."""
        t, before = context.get_time(), float(context.get_discrete_state(self._doubted).value()[0])
        refused = self._reading.HasValue(context) and int(self._reading.Eval(context)[0]) in REFUSED
        return t + DOUBTED if refused or (t < before and not believed) else before
