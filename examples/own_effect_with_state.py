"""Effects with a state, and of a delay: a turbocharged engine, and a torque command on a slow bus."""

from typing import Any

from drift_drake import Effect
from drift_drake.car.scalar import maximum, minimum, select


def boosted(delta: Any, tau: Any, v: Any, magnitude: Any, state: Any) -> Any:
    """Torque rises with a lag, and falls at once; tau itself where there is no lag."""
    return delta, select(0.0, magnitude, minimum(tau, state), tau)


def rise(r: Any, v: Any, beta: Any, omega_r: Any, delta: Any, tau: Any, car: Any, magnitude: Any, state: Any) -> Any:
    """Time derivative of the state; every hypothesis integrates it: finite and stable at zero, too."""
    return (tau - state) / maximum(magnitude, 0.02)


def boost(r: Any, v: Any, beta: Any, omega_r: Any, delta: Any, tau: Any, car: Any, magnitude: Any) -> Any:
    """The state of a car that has been driven so for long."""
    return tau


WITH_STATE: Any = boosted  # the state is its last argument, since there is a rate
TURBO_LAG = Effect(
    "s", 0.05, 0.5, "torque rises with a lag of q, and falls at once",
    stage="actuator", needs=("tau_cmd",), actuation=WITH_STATE, rate=rise, start=boost,
)  # fmt: skip
ENGINE_BUS = Effect(
    "s", 0.02, 0.2, "the torque command is late by q", stage="command", needs=("tau_cmd",), delays="tau_cmd",
    spread=True, shown_by="throttle steps",  # magnitudes are searched evenly by their logarithm
)  # fmt: skip


def main() -> float:
    return float(boosted(0.0, 100.0, 20.0, 0.25, 0.0)[1])  # [N m], as the state begins to rise


if __name__ == "__main__":
    print(main())
