"""Your own model in the MPC: it needs a step; Jacobians are taken by differences unless it has its own."""

from typing import Any

import numpy as np

from drift_drake import Mpc, StepModel, VehicleParameters, loops
from drift_drake.car.single_track.motion import derivatives

STEP, SUBSTEPS = 0.1, 10  # [s]


class CautiousModel(StepModel):
    """The single-track car with less friction than the file says, by the midpoint rule."""

    def __init__(self, car: VehicleParameters) -> None:
        self.car = car.replace(friction=0.9 * car.friction).constants()

    def step(self, x: Any, u: Any, u_next: Any, curvature: Any) -> Any:
        h = STEP / SUBSTEPS
        for k in range(SUBSTEPS):
            command = u + (k + 0.5) / SUBSTEPS * (u_next - u)
            middle = x + 0.5 * h * derivatives(x, command, curvature, self.car)
            x = x + h * derivatives(middle, command, curvature, self.car)
        return x


def main(horizon: int = 25, s: float = 20.0) -> Any:
    """The plan [N+1, 2] (steering [rad], torque [N m]) from a car 0.3 m left of its path."""
    car = VehicleParameters()
    mpc = Mpc(CautiousModel(car), car, loops(car), horizon)
    solution = mpc.solve(mpc.reference.state(s) + np.array([0.0, 0.0, 0.0, 0.0, 0.3, 0.0]), s, t=0.0)
    print(np.round(solution.plan.u[:5], 3))
    return solution.plan.u


if __name__ == "__main__":
    main()
