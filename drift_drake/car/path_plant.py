"""What every plant of a car shares: its first ten states, its ports, and its place on a path and in the world."""

import math
import sys
from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from pydrake.autodiffutils import AutoDiffXd
from pydrake.common.value import AbstractValue
from pydrake.systems.framework import BasicVector_, LeafSystem_, ValueProducer
from pydrake.systems.scalar_conversion import TemplateSystem

from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.on_path import PLANT_STATES
from drift_drake.car.single_track.motion import INPUTS, STATES
from drift_drake.common.errors import DriftDrakeError
from drift_drake.common.updates import declare_output, declare_parts

POSE_AT = PLANT_STATES.index("x")
PORTS = {"state": slice(0, len(STATES)), "path_position": slice(len(STATES), POSE_AT),
         "pose": slice(POSE_AT, len(PLANT_STATES))}  # fmt: skip
"""Output ports, and places of their numbers in the state."""

CURVATURE_STEP = 1e-3  # [m] of the difference that gives a path's curvature its slope for AutoDiffXd

_NO_WRENCH = np.zeros(3)


class MotionError(DriftDrakeError, ArithmeticError):
    """A car's state that is not finite: none to begin with, or one that a run came to."""


class CurvedPath(Protocol):
    """What a plant asks of a path; see `drift_drake.drive.reference.path.Path`."""

    def curvature(self, s: Any) -> Any:
        """Curvature [1/m] at the path position s [m]."""

    def pose(self, s: Any) -> tuple[Any, Any, Any]:
        """(x [m], y [m], heading [rad]) of the path at s [m]."""

    def to_world(self, s: Any, e: Any) -> tuple[Any, Any]:
        """(x, y) [m] of the point at s [m], e [m] to the left of the path."""


class PathPlant:
    """Ports of a plant and its place on the path; a second base class that declares no numbers of the car.

    A plant has `declare`, in which it names its continuous state (of which the first ten are `PLANT_STATES`) and calls
    `declare_numbers` with its constants and its effects' magnitudes; `car`, which gives these their names; `settled`,
    the states behind the ten of a car that has been as it is for long; `rates` of the state, with the body's
    acceleration (a_x, a_y) behind them, and `compiled_rates`. `plant_template` makes the system of it.
    """

    path: CurvedPath | None
    state_names: tuple[str, ...]
    scalar: Any

    def declare_numbers(self: Any, T: Any, parameters: Sequence[Sequence[float]], path: CurvedPath | None) -> None:
        """Declares numeric parameters, the continuous state `state_names` and ports on numbers of the type T.

        Input ports actuation, disturbance, curvature; output ports state, path_position, pose, acceleration,
        full_state.
        """
        self.scalar, self.path = T, path
        for values in parameters:
            self.DeclareNumericParameter(BasicVector_[T]([T(value) for value in values]))
        state_index = self.DeclareContinuousState(len(self.state_names))
        self._actuation = self.DeclareVectorInputPort("actuation", len(INPUTS))
        self._disturbance = self.DeclareVectorInputPort("disturbance", 3)
        self._curvature = self.DeclareVectorInputPort("curvature", 1)
        state = {self.xc_ticket()}
        declare_parts(self, PORTS, _state, state)
        given = {self.all_parameters_ticket(), self._disturbance.ticket()}
        acceleration = {*state, *given, self._actuation.ticket()}
        # The path does not enter.
        declare_output(self, "acceleration", 2, lambda context: self._rates(context, _state(context), 0.0)[-2:],
                       acceleration)  # fmt: skip
        self.DeclareStateOutputPort("full_state", state_index)
        # What hardly ever changes is read once for all derivatives.
        producer = ValueProducer(allocate=lambda: AbstractValue.Make(()), calc=self._copy_given)
        self._given = self.DeclareCacheEntry("given", producer, given)

    def numbers(self: Any, context: Any) -> tuple[Any, Any]:
        """(constants, magnitudes) in a Context."""
        p, q = (context.get_numeric_parameter(i).CopyToVector() for i in (0, 1))
        return p, q

    def _copy_given(self: Any, context: Any, value: Any) -> None:
        """(disturbance, none where its port is left open; constants; magnitudes)."""
        wrench = self._disturbance.Eval(context) if self._disturbance.HasValue(context) else _NO_WRENCH
        value.set_value((wrench, *self.numbers(context)))

    def set_initial(
        self: Any, context: Any, state: Sequence[float], s: float = 0.0, pose: Sequence[float] | None = None,
        actuation: Sequence[float] = (0.0, 0.0),
    ) -> None:  # fmt: skip
        """Puts the car into a state, at its place in the world, with the states behind the ten settled.

        Args:
            context: the plant's own Context; state, s, pose: see `placed`.
            actuation: (delta [rad], tau [N m]) that the car has had for long.

        Raises:
            ValueError: a pose where there is a path.
            MotionError: a number that is not finite.
        """
        placed = self.placed(state, s, pose)
        delta, tau = (float(value) for value in actuation)
        own = self.settled(placed, delta, tau, *self.car(*self.numbers(context)))
        context.SetContinuousState([self.scalar(value) for value in (*placed, *own)])

    def DoCalcTimeDerivatives(self: Any, context: Any, derivatives: Any) -> None:  # noqa: N802
        x = _state(context)
        curvature = self.path_curvature(context, x[6])
        if self.scalar is float:
            self.check_finite(x, context)
        derivatives.SetFromVector(self._rates(context, x, curvature)[:-2])

    def _rates(self: Any, context: Any, x: Any, curvature: Any) -> Any:
        u, (wrench, p, q) = self._actuation.Eval(context), self._given.Eval(context)
        if self.scalar is float:
            return self.compiled_rates(x, u, wrench, curvature, p, q)
        return self.rates(x, u, wrench, curvature, *self.car(p, q))

    def placed(self, state: Sequence[float], s: float = 0.0, pose: Sequence[float] | None = None) -> tuple[float, ...]:
        """Values of `PLANT_STATES` at one of the paper's six states, `s` [m] along the path.

        Args:
            pose: (x, y [m], psi [rad]); only where the plant has no path, whose geometry gives it otherwise. By
                default the path is then the x axis and the car passes its origin.

        Raises:
            ValueError: a pose where there is a path.
            MotionError: a number that is not finite.
        """
        r, v, beta, omega_r, e, dphi = (float(value) for value in state)
        for name, value in zip((*STATES, "s"), (*state, s), strict=True):
            if not math.isfinite(value):
                raise MotionError(f"the car's state has {name} = {float(value):g}; give finite numbers")
        if self.path is not None:
            if pose is not None:
                raise ValueError("the pose follows from the plant's path, s, e and dphi; leave it out")
            x, y = self.path.to_world(s, e)
            pose = (float(x), float(y), float(self.path.pose(s)[2]) + dphi - beta)
        elif pose is None:
            pose = (0.0, e, dphi - beta)
        return (r, v, beta, omega_r, e, dphi, s, *pose)

    def check_finite(self, x: Any, context: Any) -> None:
        """Ends a simulation that has lost its numbers, which an integrator would try to go on with for ever.

        Speed and path position say it for all: the others' rates enter theirs.
        """
        if not math.isfinite(x[1] + x[6]):
            raise MotionError(f"the car's state is no longer finite at {context.get_time():g} s")

    def path_curvature(self: Any, context: Any, s: Any) -> Any:
        """Curvature [1/m] of the path at s: the port's, else the path's, else zero."""
        if self._curvature.HasValue(context):
            return self._curvature.Eval(context)[0]
        if self.path is None:
            return 0.0
        if self.scalar is float:
            return float(self.path.curvature(float(s)))
        if self.scalar is AutoDiffXd:
            at, step = s.value(), CURVATURE_STEP
            slope = (self.path.curvature(at + step) - self.path.curvature(at - step)) / (2.0 * step)
            return AutoDiffXd(float(self.path.curvature(at)), float(slope) * s.derivatives())
        raise ValueError("a path's curvature has no Expression; connect the port 'curvature' of the plant")


def _state(context: Any) -> Any:
    return context.get_continuous_state_vector().CopyToVector()


def plant_template(name: str, base: type[PathPlant]) -> Any:
    """The systems of a plant on float, AutoDiffXd and Expression: `base`'s equations on each.

    Their constructor takes the car's parameters, the magnitudes of its effects, and its path.
    """

    # Given its module, Drake does not look for it through all callers' sources.
    @TemplateSystem.define(name, scope=sys.modules[__name__])
    def template(T: Any) -> Any:
        class Impl(base, LeafSystem_[T]):  # type: ignore[misc, valid-type]
            def _construct(
                self,
                parameters: Any,
                effects: Effects = Effects(),
                path: CurvedPath | None = None,
                converter: Any = None,
            ) -> None:
                LeafSystem_[T].__init__(self, converter)
                self.declare(parameters, effects, path, T)

            def _construct_copy(self, other: Any, converter: Any = None) -> None:
                Impl._construct(self, other.parameters, other.effects, other.path, converter)

        Impl.__doc__ = base.__doc__
        return Impl

    return template
