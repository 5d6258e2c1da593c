"""A single-track car on tanh tyres as an FMU: `python -m pythonfmu build -f fmu_car.py` writes FmuCar.fmu here."""

from math import atan2, cos, hypot, sin, tanh
from typing import Any

from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real

STEP = 0.005  # [s] at most, of its own integration
PARAMETERS = {
    "m": 1450.0,
    "J": 2200.0,
    "lf": 1.2,
    "lr": 1.3,
    "mu": 1.0,
    "cf": 1.2e5,
    "cr": 1.5e5,
    "jw": 12.0,
    "radius": 0.32,
}
STARTS = {"vx0": 12.0, "vy0": 0.0, "r0": 0.0, "w0": 37.5}


class FmuCar(Fmi2Slave):
    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        for name, value in (PARAMETERS | STARTS).items():
            setattr(self, name, value)
            self.register_variable(Real(name, causality=Fmi2Causality.parameter, variability=Fmi2Variability.tunable))
        for name in ("steer", "torque", "fx", "fy", "mz"):  # [rad], [N m] at the rear axle, on the body [N], [N m]
            setattr(self, name, 0.0)
            self.register_variable(Real(name, causality=Fmi2Causality.input))
        for name in ("vx", "vy", "r", "w", "psi"):
            setattr(self, name, 0.0)
            self.register_variable(Real(name, causality=Fmi2Causality.output))

    def exit_initialization_mode(self) -> None:
        self.vx, self.vy, self.r, self.w, self.psi = self.vx0, self.vy0, self.r0, self.w0, 0.0

    def _rates(self, vx: float, vy: float, r: float, w: float) -> tuple[float, float, float, float]:
        base, weight = self.lf + self.lr, self.m * 9.81
        front, rear = self.mu * weight * self.lr / base, self.mu * weight * self.lf / base
        roll = max(vx, 1.0)
        alpha = atan2(vy + self.lf * r, roll) - self.steer
        f_front = -front * tanh(self.cf * alpha / front)
        slip_y, slip_x = -atan2(vy - self.lr * r, roll), (w * self.radius - vx) / roll
        slip = hypot(slip_x, slip_y) + 1e-9
        force = rear * tanh(self.cr * slip / rear)
        f_x, f_y = force * slip_x / slip, force * slip_y / slip
        a_x = (f_x - f_front * sin(self.steer) + self.fx) / self.m
        a_y = (f_y + f_front * cos(self.steer) + self.fy) / self.m
        moment = self.lf * f_front * cos(self.steer) - self.lr * f_y + self.mz
        return a_x + r * vy, a_y - r * vx, moment / self.J, (self.torque - f_x * self.radius) / self.jw

    def do_step(self, current_time: float, step_size: float) -> bool:  # noqa: ARG002
        steps = max(round(step_size / STEP), 1)
        h = step_size / steps
        for _ in range(steps):
            z = (self.vx, self.vy, self.r, self.w)
            k = self._rates(*z)
            middle = self._rates(*(a + 0.5 * h * b for a, b in zip(z, k, strict=True)))
            self.psi += h * self.r
            self.vx, self.vy, self.r, self.w = (a + h * b for a, b in zip(z, middle, strict=True))
        return True
