"""A controller with states of its own: a LeafSystem, whose states live in the Context, so that runs replay."""

from typing import Any

from pydrake.systems.framework import LeafSystem

from drift_drake import ClosedLoop, RunLimits, VehicleParameters, straight_line


class HoldSpeed(LeafSystem):
    """Steers to the path and holds 15 m/s, with an integral."""

    def __init__(self) -> None:
        super().__init__()
        self.measured = self.DeclareVectorInputPort("measured_state", 7)
        self.integral = self.DeclareDiscreteState(1)
        self.DeclarePeriodicDiscreteUpdateEvent(0.01, 0.0, self.update)
        self.DeclareVectorOutputPort("command", 2, self.command)

    def update(self, context: Any, discrete: Any) -> None:
        lacking = 15.0 - self.measured.Eval(context)[1]
        discrete.set_value(self.integral, context.get_discrete_state(self.integral).value() + 0.01 * lacking)

    def command(self, context: Any, output: Any) -> None:
        r, v, _, _, e, dphi, _ = self.measured.Eval(context)
        (more,) = context.get_discrete_state(self.integral).value()
        output.SetFromVector([-0.1 * e - 0.5 * dphi - 0.1 * r, 60.0 * (15.0 - v) + 20.0 * more])


def main(duration: float = 2.0) -> str:
    """How a drive along a straight lane ended; the true car has more drag."""
    lane = straight_line(v_start=12.0, v_end=15.0, duration=duration)
    loop = ClosedLoop(VehicleParameters(), lane, controller=HoldSpeed(), effects={"aero_drag": 1.0})
    return loop.run(loop.initial_context(seed=0), RunLimits(time_factor=1.5)).outcome


if __name__ == "__main__":
    print(main())
