"""A safe ending: a feedback law that takes a car out of any drift and slows it down along a path, to a stop or a pace.

The yaw rate wanted is that of the course along the path plus one that unwinds the sideslip slowly, since a car that
slides sheds speed and one that straightens at once leaves a tight bend. The front tyre is asked for the force that
gives it, about what the rear tyre does by the nominal model (computed force), and the engine for its drag, or for the
torque that keeps a pace. A car whose slide ends on its lane is not taken out of it: that stop is shorter (`sliding`).
"""

import numpy as np
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.single_track.motion import MIN_SPEED, rear_slip, static_loads
from drift_drake.car.tyre import tyre_force
from drift_drake.common.arrays import Array
from drift_drake.common.updates import declare_output, declare_update
from drift_drake.drive.mpc.plan import Plan, plan_size
from drift_drake.drive.mpc.sliding import SlidingStop
from drift_drake.drive.reference.trajectory import Reference

UNWINDING = 1.0  # [1/s] of the sideslip
YAW_DAMPING = 8.0  # [1/s]
COURSE_GAIN = 3.0  # [1/s] of the course's error
LATERAL_GAIN = 0.3  # [1/(m s)] of the lateral error, which counts up to
FARTHEST = 2.0  # [m]
PACE_GAIN = 1.0  # [1/s] of the speed that a pace lacks
MOST_FORCE = 0.95  # of the front tyre's peak: the force beyond has two slips
FASTEST = np.array([2.0, 2000.0])  # [rad/s], [N m/s] of the command


def stopping_command(
    x: Array, curvature: float, parameters: VehicleParameters, pace: float = 0.0, unwinding: float = UNWINDING
) -> Array:
    """(delta [rad], tau [N m]) that slows a car down along a path; the wheel straight where the state is not finite.

    Args:
        x: (r, v, beta, omega_r, e, dphi) [6]; curvature: of the path [1/m];
        pace: [m/s] that is kept once the car is as slow; 0 for none, which is a stop; unwinding: [1/s] of the sideslip.
    """
    p = parameters
    if not (np.isfinite(x).all() and np.isfinite(curvature)):
        return np.array([0.0, p.torque_min])
    r, v, beta, omega_r, e, dphi = x
    keeping = p.mass * p.wheel_radius / p.gear_ratio * PACE_GAIN * (pace - v)
    torque = keeping if pace > 0.0 else p.torque_min
    v = max(v, MIN_SPEED)
    constants = p.constants()
    load_front, load_rear = static_loads(constants)
    sigma_x, sigma_y = rear_slip(r, v, beta, omega_r, p.rear_axle_distance)
    _, rear_force = tyre_force(sigma_x, sigma_y, p.rear_stiffness, p.friction * load_rear, constants.tyre)
    course = curvature * v - COURSE_GAIN * dphi - LATERAL_GAIN * np.clip(e, -FARTHEST, FARTHEST)
    most = p.friction * p.gravity / v
    wanted = np.clip(course, -most, most) + unwinding * beta
    moment = p.yaw_inertia * YAW_DAMPING * (wanted - r)
    peak = p.friction * load_front
    share = np.clip((moment + p.rear_axle_distance * rear_force) / (p.front_axle_distance * peak), -1.0, 1.0)
    delta = np.arctan2(v * np.sin(beta) + p.front_axle_distance * r, v * np.cos(beta)) + np.arctan(
        _slip(MOST_FORCE * share, p.front_stiffness, peak)
    )
    return np.clip([delta, torque], *p.command_limits())


def stopping_plan(t: float, last: Array, wanted: Array, steps: int, period: float) -> Plan:
    """The plan [N+1, 2] from now on that goes from the command in force towards the one wanted, over one period."""
    change = np.clip(wanted - last, -FASTEST * period, FASTEST * period)
    return Plan(t, np.tile(last + change, (steps + 1, 1)))


def _slip(share: float, stiffness: float, peak: float) -> float:
    """Lateral slip at which a brush tyre gives a share (-1 to 1) of its peak force [N]: its inverse."""
    return float(3.0 * peak / stiffness * (1.0 - np.cbrt(1.0 - abs(share))) * np.sign(share))


class SafeStop(LeafSystem):
    """Hands plans on; once the plan in force is older than `patience`, it stops the car on its path, for good.

    An old plan in force says it all: readings that are none (from which the controller makes no plan), a solver that
    fails, plans that are lost, late, refused or of another clock. Until then the last good plan is followed.

    Input ports: plan [1 + 2 (N + 1)], NaN in its first number where there is none; plan_age [1] and command [2], the
    actuator's; state [7]: (r, v, beta, omega_r, e, dphi, s), estimated where there is no reading.
    Output ports: plan; stopping [1], 1 from the moment of giving up on.
    State in the Context, each `period`: whether the car is being stopped.

    Args:
        steps: N; patience: [s].
    """

    def __init__(
        self, parameters: VehicleParameters, reference: Reference, steps: int, patience: float = 0.5,
        period: float = 0.01,
    ) -> None:  # fmt: skip
        LeafSystem.__init__(self)
        self._parameters, self._path, self._steps = parameters, reference.path, steps
        self._sliding = SlidingStop(parameters, reference.path, reference.lane, FASTEST)
        self._patience, self._period = patience, period
        self._plan = self.DeclareVectorInputPort("plan", plan_size(steps))
        self._age = self.DeclareVectorInputPort("plan_age", 1)
        self._command = self.DeclareVectorInputPort("command", 2)
        self._state = self.DeclareVectorInputPort("state", 7)
        self._stopping = self.DeclareDiscreteState(1)
        declare_update(self, period, self._update)
        declare_output(self, "supervised_plan", plan_size(steps), self._supervised)
        self.DeclareStateOutputPort("stopping", self._stopping)

    def stopping(self, context: Context) -> bool:
        """Whether the car is being stopped, from a Context of this system."""
        return bool(context.get_discrete_state(self._stopping).value()[0])

    def _supervised(self, context: Context) -> Array:
        if not self.stopping(context):
            return self._plan.Eval(context)
        x, last = self._state.Eval(context), self._command.Eval(context)
        wanted = self._sliding.command(x, last)
        if wanted is None:
            wanted = stopping_command(x[:6], self._path.curvature(float(x[6])), self._parameters)
        return stopping_plan(context.get_time(), last, wanted, self._steps, self._period).vector()

    def _update(self, context: Context, discrete: DiscreteValues) -> None:
        age = np.minimum(self._age.Eval(context)[0], context.get_time())  # without any plan yet, since the start
        if age > self._patience:
            discrete.get_mutable_vector(self._stopping)[0] = 1.0
