"""Cars on brush tyres for the drifting experiments: of the coupe's size, drawn one by one; none is a measured one.

What the package's equations lack is drawn anew for each: how friction falls with sliding speed and load, how the
differential locks, how far the wheels yield to forces and roll, how loads follow the body.
"""

import numpy as np

from drift_drake.car.brush.parameters import BrushParameters

COUPE = BrushParameters(nominal_load=0.25 * 1650.0 * 9.81)
DRAWN: dict[str, tuple[float, float]] = {
    "cg_height": (0.42, 0.58), "front_roll_share": (0.45, 0.65), "roll_frequency": (8.0, 13.0),
    "roll_damping": (0.3, 0.6), "pitch_time": (0.05, 0.12), "sliding_friction": (0.82, 1.0),
    "sliding_speed": (3.0, 10.0), "load_sensitivity": (0.05, 0.2), "relaxation": (0.1, 0.3),
    "front_compliance": (0.0, 0.02), "rear_compliance": (-0.003, 0.006), "roll_steer": (-0.001, 0.001),
    "lock_share": (0.0, 0.6), "lock_least": (0.0, 150.0),
}  # fmt: skip
"""Uniformly between these."""


STRETCHED = 1.5  # of each range about its middle, for cars that models are trained on
LEAST = dict.fromkeys(("lock_share", "lock_least", "load_sensitivity", "front_compliance"), 0.0)


def draw_drifter(index: int, seed: int) -> BrushParameters:
    """Car `index` of a draw: the same for the same arguments. Every third has an open differential."""
    generator = np.random.default_rng([seed, 77, index])
    drawn = {name: float(generator.uniform(low, high)) for name, (low, high) in DRAWN.items()}
    locked = {} if index % 3 else {"lock": 0.0, "lock_share": 0.0, "lock_least": 0.0}
    return COUPE.replace(**(drawn | locked))


def draw_wide_drifter(index: int, seed: int) -> BrushParameters:
    """The same, all that is drawn half as far again about its middle, within what a car can have.

    Every third has a motor for each rear wheel in place of a differential, every fourth steers at the rear too.
    """
    generator, car = np.random.default_rng([seed, 78, index]), draw_drifter(index, seed)
    drawn = {}
    for name, (low, high) in DRAWN.items():
        middle = 0.5 * (low + high)
        least, most = (
            LEAST.get(name, 0.3 * low if low > 0.0 else -np.inf),
            1.0 if name == "sliding_friction" else np.inf,
        )
        drawn[name] = float(np.clip(middle + STRETCHED * (getattr(car, name) - middle), least, most))
    if index % 3 == 0:
        drawn |= {"lock": 0.0, "lock_share": 0.0, "lock_least": 0.0, "vectoring": float(generator.uniform(0.0, 4000.0))}
    else:
        drawn["lock"] = float(generator.uniform(50.0, 600.0))
    if index % 4 == 1:
        drawn["rear_steer"] = float(generator.uniform(-0.1, 0.1))
    return car.replace(**drawn)
