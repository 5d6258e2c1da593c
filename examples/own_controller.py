"""Your own controller in the closed loop: it needs `evaluate`. Here an LQR about the reference."""

from typing import Any

import numpy as np
from scipy.linalg import solve_continuous_are

from drift_drake import ClosedLoop, Reference, RunLimits, VehicleParameters, figure_8
from drift_drake.car.single_track.motion import linearize

Q, R = np.diag([1.0, 0.1, 10.0, 0.01, 1.0, 10.0]), np.diag([1.0, 1e-5])  # weights of state and input


class Regulator:
    """The reference's input, and feedback of (r, v, beta, omega_r, e, dphi) with the gain at each place."""

    def __init__(self, car: VehicleParameters, reference: Reference) -> None:
        self.car, self.reference = car.constants(), reference

    def evaluate(self, x: Any, s: float, t: float) -> Any:  # noqa: ARG002 (a function of time may ask for it)
        x_ref, u_ref = self.reference.state(s), self.reference.input(s)
        _, a, b = linearize(x_ref, u_ref, self.reference.path.curvature(s), self.car)
        cost = solve_continuous_are(a, b, Q, R)
        return u_ref - np.linalg.solve(R, b.T @ cost) @ (x - x_ref)


def main(time_factor: float = 1.5) -> str:
    """Drives for at most `time_factor` of the reference's own duration; returns how the run ended."""
    car = VehicleParameters()
    reference = figure_8(car)
    loop = ClosedLoop(car, reference, controller=Regulator(car, reference))
    run = loop.run(loop.initial_context(seed=1), RunLimits(time_factor=time_factor))
    metrics = run.metrics()
    print(f"{run.outcome}: RMS e {metrics.rms_e:.3f} m, {metrics.solver_failures} periods without a command")
    return run.outcome


if __name__ == "__main__":
    main()
