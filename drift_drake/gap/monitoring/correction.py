"""What follows from a gap: a named cause is corrected in model and readings, or the car drives its lane slowly.

The policy. From the moment that a change is reported the most probable cause is put in, with its magnitude, where it
acts: on the motion, in the controller's model; on a sensor, in the readings. It need not be named for that: what
explains the last rows best is nearer to the car than a simulator that does not explain them. It is followed until the
simulator is believed again. A cause that neither can take (a transport delay, a latency, a road's grade) and an unknown
one change nothing.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

from drift_drake.car.effects.magnitudes import COUNT, Effects, combined
from drift_drake.car.internal_states import BEYOND, on_the_motion
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.sensor_errors import SENSORS, corrected_reading
from drift_drake.car.sensors import MEASURED_STATE
from drift_drake.common.updates import declare_update
from drift_drake.drive.mpc.plan import plan_size
from drift_drake.drive.mpc.stopping import stopping_command, stopping_plan
from drift_drake.drive.reference.trajectory import Reference
from drift_drake.drive.screening.screen import ReadingKind
from drift_drake.gap.monitoring.events import Watcher
from drift_drake.gap.monitoring.evidence import ALARM, TRUSTED

GRIP_SHARE = 0.3  # of the tyres' friction that the tightest bend asks for at the safe pace
PROBABLE = 0.5
REFUSED = (ReadingKind.JUMPED, ReadingKind.DISAGREEING)
DOUBTED = 10  # verdicts after readings were refused; a sensor's error is reported within them
HARDER = 0.4  # [s] in a row that are driven harder than calibrated: two windows
UNWINDING = 0.5  # [1/s] of the sideslip: on a slippery road it is the slide that sheds speed


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


class GapCorrection(LeafSystem):
    """The policy as a system, between `GapMonitor` and the controller.

    Input ports: posterior, magnitude [3] of `GapMonitor`; measured_state [7].
    Output ports: correction [COUNT], in the order of `Effects`; effects [COUNT], what of it acts on the motion;
    corrected_state [7].
    State in the Context, each period of the monitor: the correction.

    Args:
        own: what the controller's model has while nothing is corrected, as of a calibrated car.
    """

    def __init__(self, monitor: Watcher, own: Effects = Effects()) -> None:
        LeafSystem.__init__(self)
        self._own = own
        self._labels = monitor.labels
        self._posterior = self.DeclareVectorInputPort("posterior", len(self._labels))
        self._magnitude = self.DeclareVectorInputPort("magnitude", 3)
        self._measured = self.DeclareVectorInputPort("measured_state", len(MEASURED_STATE))
        self._held = self.DeclareDiscreteState(np.zeros(COUNT))
        declare_update(self, monitor.period, self._update)
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
        held = Effects(*context.get_discrete_state(self._held).value())
        output.SetFromVector(np.array(on_the_motion(combined(self._own, held)), dtype=float))

    def _calc_reading(self, context: Context, output: Any) -> None:
        held = context.get_discrete_state(self._held).value()
        output.SetFromVector(corrected_reading(self._measured.Eval(context), Effects(*held)))


def safe_pace(reference: Reference, parameters: VehicleParameters) -> float:
    """The pace [m/s] at which a reference's tightest bend asks for `GRIP_SHARE` of the friction; none above its own."""
    tightest = max(float(np.abs(reference.curvature).max()), 1e-6)
    return min(
        float(np.sqrt(GRIP_SHARE * parameters.friction * parameters.gravity / tightest)), float(reference.v.min())
    )


def slowed(slow: bool, none: float, sensor: bool, corrected: bool, harder: bool = False) -> bool:
    """Whether the car is to be slow after a verdict.

    Args:
        slow: whether it was; none: probability that the simulator lacks nothing;
        sensor: whether it is probably a sensor's error; corrected: whether the controller knows what it lacks;
        harder: whether the car is driven harder than calibrated.
    """
    return not corrected and not sensor and (harder or none < ALARM or (slow and none < TRUSTED))


class SlowDown(LeafSystem):
    """Hands plans on while the simulator is believed; else it drives the lane at a safe pace, by the safe stop's law.

    So it does while the car is driven harder than calibrated: on a course that the calibration had, it is the car that
    has changed, and is out of known driving before a verdict can follow. Plans are followed, too, where a correction
    stands for what has changed, and where a sensor's error is the probable cause, since the law follows the readings
    more closely than plans do; so it is where readings were refused right before a change is reported. Without a
    reading it hands the plan on, which is then old: the safe stop's to answer.

    Input ports: plan [1 + 2 (N + 1)]; command [2], in force; state [7]: (r, v, beta, omega_r, e, dphi, s), NaN where
    there is no reading; posterior, of `GapMonitor`; correction [COUNT] (optional), of `GapCorrection`: while it is not
    zero, plans are followed; reading [1] (optional), a `ReadingKind`, of `Screen`; not_judged [2] (optional), of
    `GapMonitor`.
    Output ports: plan; slow [1], 1 while the car is driven slowly.
    State in the Context, each `period`: whether it is, and the time [s] until which readings are doubted.

    Args:
        labels: of the posterior; steps: N; verdict: time between two of the monitor's [s].
    """

    def __init__(
        self,
        parameters: VehicleParameters,
        reference: Reference,
        labels: Sequence[str],
        steps: int,
        period: float = 0.01,
        verdict: float = 0.1,
    ) -> None:
        LeafSystem.__init__(self)
        self._doubts = DOUBTED * verdict
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
        self._not_judged = self.DeclareVectorInputPort("not_judged", 2)
        self._slow, self._doubted = self.DeclareDiscreteState(1), self.DeclareDiscreteState(1)
        declare_update(self, period, self._update)
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
        harder = self._not_judged.HasValue(context) and float(self._not_judged.Eval(context)[0]) >= HARDER
        doubted = self._doubted_until(context, believed=bool(p[0] >= TRUSTED) and not harder)
        sensor = context.get_time() < doubted or float(p[self._sensors].sum()) >= PROBABLE
        slow = slowed(self._is_slow(context), float(p[0]), sensor, corrected, harder)
        discrete.get_mutable_vector(self._slow)[0] = float(slow)
        discrete.get_mutable_vector(self._doubted)[0] = doubted

    def _doubted_until(self, context: Context, believed: bool) -> float:
        """For a while after readings were refused, and on while the simulator is not believed."""
        t, before = context.get_time(), float(context.get_discrete_state(self._doubted).value()[0])
        refused = self._reading.HasValue(context) and int(self._reading.Eval(context)[0]) in REFUSED
        return t + self._doubts if refused or (t < before and not believed) else before
