"""Cars of other sizes and kinds on brush tyres, driven as `drivers` drives, and what sensors read.

Plausible figures, no measured vehicles. From day to day a car is not quite the same (`VARIES_BY_DAY`), and its sensors'
noise is half of it coloured.
"""

import dataclasses
from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
from scipy.signal import lfilter

from drift_drake.car.brush.parameters import BrushParameters
from drift_drake.car.effects.catalogue import CATALOGUE, REFERENCE
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.log.table import Run
from drift_drake.car.parameters import VehicleParameters
from experiments.benchmarks.compiled_cases import NOISE, sensed
from experiments.benchmarks.rows import PERIOD, advance, by_rows, logged, row_states
from experiments.other_worlds.drivers import SLOWEST, SPIN, ScaledDriver

BRUSH_CARS = {
    # 1:10 class, a limited-slip differential, plastic suspension that gives way.
    "small": BrushParameters(
        mass=1.9, yaw_inertia=0.023, front_axle_distance=0.125, rear_axle_distance=0.135, track=0.17, cg_height=0.035,
        front_roll_share=0.55, roll_frequency=40.0, roll_damping=0.5, pitch_time=0.03, wheel_radius=0.032,
        rear_axle_inertia=2.2e-4, gear_ratio=8.0, friction=0.85, sliding_friction=0.75, sliding_speed=1.2,
        load_sensitivity=0.08, nominal_load=0.25 * 1.9 * 9.81,
        front_cornering=10.0, rear_cornering=12.0, relaxation=0.02, rolling_resistance=0.025,
        aero_drag=0.01, front_compliance=0.02, rear_compliance=-0.006, roll_steer=0.0, rear_steer=0.0, lock=0.02,
        lock_share=0.35, lock_least=0.006, vectoring=0.0, steering_limit=0.5, torque_min=-0.03, torque_max=0.08,
    ),
    # A two-axle lorry of 12 t with a high centre of gravity, loaded at the rear.
    "truck": BrushParameters(
        mass=12000.0, yaw_inertia=58e3, front_axle_distance=2.7, rear_axle_distance=1.6, track=2.0, cg_height=1.1,
        front_roll_share=0.35, roll_frequency=6.0, roll_damping=0.35, pitch_time=0.12, wheel_radius=0.5,
        rear_axle_inertia=380.0, gear_ratio=19.0, friction=0.8, sliding_friction=0.85, sliding_speed=6.0,
        load_sensitivity=0.12, nominal_load=3000.0 * 9.81,
        front_cornering=6.5, rear_cornering=8.5, relaxation=0.55, rolling_resistance=0.007,
        aero_drag=3.2, front_compliance=0.012, rear_compliance=0.004, roll_steer=-0.0015, rear_steer=0.0, lock=0.0,
        lock_share=0.0, lock_least=0.0, vectoring=0.0, steering_limit=0.65, torque_min=-250.0, torque_max=900.0,
    ),
    # A rear motor for each wheel that turns the car too, and rear wheels that steer.
    "electric": BrushParameters(
        mass=2150.0, yaw_inertia=3900.0, front_axle_distance=1.52, rear_axle_distance=1.38, track=1.64, cg_height=0.46,
        front_roll_share=0.58, roll_frequency=11.0, roll_damping=0.5, pitch_time=0.08, wheel_radius=0.35,
        rear_axle_inertia=13.0, gear_ratio=9.3, friction=1.05, sliding_friction=0.88, sliding_speed=5.0,
        load_sensitivity=0.15, nominal_load=0.25 * 2150.0 * 9.81,
        front_cornering=15.0, rear_cornering=19.0, relaxation=0.4, rolling_resistance=0.01,
        aero_drag=0.35, front_compliance=0.015, rear_compliance=0.003, roll_steer=-0.001, rear_steer=-0.08, lock=0.0,
        lock_share=0.0, lock_least=0.0, vectoring=3500.0, steering_limit=0.6, torque_min=-150.0, torque_max=600.0,
    ),
}  # fmt: skip
NOISE_SHARES = {"truck": 0.7}  # of the sensors, over a full-size car's

VARIES_BY_DAY = {"rolling_resistance": 0.03, "friction_level": 0.05, "mass_error": 0.05, "gyro_bias": 0.03,
            "sideslip_bias": 0.03, "wheel_radius_error": 0.03, "road_grade": 0.03}  # fmt: skip
"""By which a car and its sensors differ from one day to the next, as shares of the practical ranges (one standard
deviation, of a normal distribution): a battery, tyres that are warm or not, a floor that is not quite level."""
COLOURED, CORRELATED = 0.5, 0.2  # share of the noise's variance, and its time [s]


def scaled(name: str, magnitude: float, car: VehicleParameters) -> float:
    """A full-size car's magnitude of an effect as this car's size has it."""
    sizes = [max(abs(q) for q in CATALOGUE[name].range_for(vehicle)) for vehicle in (car, REFERENCE)]
    return magnitude * sizes[0] / sizes[1]


def of_the_day(car: BrushParameters, effects: Effects, rng: np.random.Generator) -> Effects:
    """The effects with what this car differs by on any day."""
    vehicle = car.single_track()
    for name, share in VARIES_BY_DAY.items():
        size = max(abs(q) for q in CATALOGUE[name].range_for(vehicle))
        effects = effects._replace(**{name: getattr(effects, name) + share * size * float(rng.standard_normal())})
    return effects


def noisy(run: Run, rng: np.random.Generator, share: float = 1.0) -> Run:
    """The run with sensors' noise, white and coloured, a share of a full-size car's."""
    keeps = float(np.exp(-PERIOD / CORRELATED))
    columns: dict[str, Any] = {}
    for name, size in NOISE.items():
        white, driven = rng.standard_normal((2, len(run)))
        coloured = lfilter([np.sqrt(1.0 - keeps**2)], [1.0, -keeps], driven)
        columns[name] = run.column(name) + share * size * (
            np.sqrt(1.0 - COLOURED) * white + np.sqrt(COLOURED) * coloured
        )
    return dataclasses.replace(run, **columns)


def day_runs(
    car: BrushParameters, effects: Effects, kinds: Sequence[str], effort: float, rng: np.random.Generator,
    duration: float, noise: float = 1.0,
) -> list[Run]:  # fmt: skip
    """Runs of one day, a manoeuvre each; noise: of the sensors, over a full-size car's."""
    today = of_the_day(car, effects, rng)
    runs = [simulate(car, today, kind, effort, rng, f"run_{i}", duration) for i, kind in enumerate(kinds)]
    return [noisy(run, rng, noise) for run in runs]


def simulate(
    car: BrushParameters, effects: Effects, kind: str, effort: float, rng: np.random.Generator, name: str,
    duration: float,
) -> Run:  # fmt: skip
    """One run of a manoeuvre, without noise; one that spins or stops ends early."""
    p, driver = car.constants(), ScaledDriver(kind, rng, car.single_track(), effort)
    begin = np.zeros(len(row_states(p)))
    begin[[1, 3]] = driver.start_speed
    motion = by_rows(
        (begin, np.zeros(2)), (0.0, 0.0), duration, lambda t, z, last: driver.command(t, z[1], z[2], last),
        partial(advance, p=p, q=effects), lambda _, z: abs(z[2]) > SPIN or z[1] < SLOWEST * driver.time,
    )  # fmt: skip
    return sensed(*logged(motion), effects, rng, name, noise=0.0)
