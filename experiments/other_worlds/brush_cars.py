"""Cars of other sizes and kinds on the equations of `brush_car`, driven as `drivers` drives, and what sensors read.

Plausible figures, no measured vehicles. From day to day a car is not quite the same (`VARIES_BY_DAY`), and its sensors'
noise is half of it coloured.
"""

import dataclasses
from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
from scipy.signal import lfilter

from drift_drake.car.effects.catalogue import CATALOGUE, REFERENCE
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.log.table import Run
from drift_drake.car.parameters import VehicleParameters
from experiments.benchmarks.compiled_cases import NOISE, sensed
from experiments.benchmarks.rows import PERIOD, by_rows
from experiments.other_worlds.brush_car import STATES, BrushCar, advance
from experiments.other_worlds.drivers import SLOWEST, SPIN, ScaledDriver

BRUSH_CARS = {
    # 1:10 class, a limited-slip differential, plastic suspension that gives way.
    "small": BrushCar(
        mass=1.9, yaw_inertia=0.023, front_axle_distance=0.125, rear_axle_distance=0.135, track=0.17, cg_height=0.035,
        front_roll_share=0.55, roll_frequency=40.0, roll_damping=0.5, pitch_time=0.03, wheel_radius=0.032,
        rear_axle_inertia=2.2e-4, gear_ratio=8.0, friction=0.85, sliding_friction=0.75, sliding_speed=1.2,
        load_sensitivity=0.08, front_stiffness=10.0, rear_stiffness=12.0, relaxation=0.02, rolling_resistance=0.025,
        aero_drag=0.01, front_compliance=0.02, rear_compliance=-0.006, roll_steer=0.0, rear_steer=0.0, lock=0.02,
        lock_share=0.35, lock_least=0.006, vectoring=0.0, steering_limit=0.5, torque_min=-0.03, torque_max=0.08,
        noise=1.0,
    ),
    # A two-axle lorry of 12 t with a high centre of gravity, loaded at the rear.
    "truck": BrushCar(
        mass=12000.0, yaw_inertia=58e3, front_axle_distance=2.7, rear_axle_distance=1.6, track=2.0, cg_height=1.1,
        front_roll_share=0.35, roll_frequency=6.0, roll_damping=0.35, pitch_time=0.12, wheel_radius=0.5,
        rear_axle_inertia=380.0, gear_ratio=19.0, friction=0.8, sliding_friction=0.85, sliding_speed=6.0,
        load_sensitivity=0.12, front_stiffness=6.5, rear_stiffness=8.5, relaxation=0.55, rolling_resistance=0.007,
        aero_drag=3.2, front_compliance=0.012, rear_compliance=0.004, roll_steer=-0.0015, rear_steer=0.0, lock=0.0,
        lock_share=0.0, lock_least=0.0, vectoring=0.0, steering_limit=0.65, torque_min=-250.0, torque_max=900.0,
        noise=0.7,
    ),
    # A rear motor for each wheel that turns the car too, and rear wheels that steer.
    "electric": BrushCar(
        mass=2150.0, yaw_inertia=3900.0, front_axle_distance=1.52, rear_axle_distance=1.38, track=1.64, cg_height=0.46,
        front_roll_share=0.58, roll_frequency=11.0, roll_damping=0.5, pitch_time=0.08, wheel_radius=0.35,
        rear_axle_inertia=13.0, gear_ratio=9.3, friction=1.05, sliding_friction=0.88, sliding_speed=5.0,
        load_sensitivity=0.15, front_stiffness=15.0, rear_stiffness=19.0, relaxation=0.4, rolling_resistance=0.01,
        aero_drag=0.35, front_compliance=0.015, rear_compliance=0.003, roll_steer=-0.001, rear_steer=-0.08, lock=0.0,
        lock_share=0.0, lock_least=0.0, vectoring=3500.0, steering_limit=0.6, torque_min=-150.0, torque_max=600.0,
        noise=1.0,
    ),
}  # fmt: skip

VARIES_BY_DAY = {"rolling_resistance": 0.03, "friction_level": 0.05, "mass_error": 0.05, "gyro_bias": 0.03,
            "sideslip_bias": 0.03, "wheel_radius_error": 0.03, "road_grade": 0.03}  # fmt: skip
"""By which a car and its sensors differ from one day to the next, as shares of the practical ranges (one standard
deviation, of a normal distribution): a battery, tyres that are warm or not, a floor that is not quite level."""
COLOURED, CORRELATED = 0.5, 0.2  # share of the noise's variance, and its time [s]


def single_track(car: BrushCar) -> VehicleParameters:
    """The nearest single-track car."""
    wheelbase = car.front_axle_distance + car.rear_axle_distance
    weight = car.mass * car.gravity
    shared = ("mass", "yaw_inertia", "front_axle_distance", "rear_axle_distance", "wheel_radius", "gear_ratio",
              "rear_axle_inertia", "gravity", "steering_limit", "torque_min", "torque_max", "friction")  # fmt: skip
    return VehicleParameters(
        front_stiffness=car.front_stiffness * weight * car.rear_axle_distance / wheelbase,
        rear_stiffness=car.rear_stiffness * weight * car.front_axle_distance / wheelbase,
        **{name: getattr(car, name) for name in shared},
    )


def scaled(name: str, magnitude: float, car: VehicleParameters) -> float:
    """A full-size car's magnitude of an effect as this car's size has it."""
    sizes = [max(abs(q) for q in CATALOGUE[name].range_for(vehicle)) for vehicle in (car, REFERENCE)]
    return magnitude * sizes[0] / sizes[1]


def of_the_day(car: BrushCar, effects: Effects, rng: np.random.Generator) -> Effects:
    """The effects with what this car differs by on any day."""
    vehicle = single_track(car)
    for name, share in VARIES_BY_DAY.items():
        size = max(abs(q) for q in CATALOGUE[name].range_for(vehicle))
        effects = effects._replace(**{name: getattr(effects, name) + share * size * float(rng.standard_normal())})
    return effects


def noisy(run: Run, car: BrushCar, rng: np.random.Generator) -> Run:
    """The run with sensors' noise, white and coloured."""
    keeps = float(np.exp(-PERIOD / CORRELATED))
    columns: dict[str, Any] = {}
    for name, size in NOISE.items():
        white, driven = rng.standard_normal((2, len(run)))
        coloured = lfilter([np.sqrt(1.0 - keeps**2)], [1.0, -keeps], driven)
        columns[name] = run.column(name) + car.noise * size * (
            np.sqrt(1.0 - COLOURED) * white + np.sqrt(COLOURED) * coloured
        )
    return dataclasses.replace(run, **columns)


def day_runs(
    car: BrushCar, effects: Effects, kinds: Sequence[str], effort: float, rng: np.random.Generator, duration: float
) -> list[Run]:
    """Runs of one day, a manoeuvre each."""
    today = of_the_day(car, effects, rng)
    runs = [simulate(car, today, kind, effort, rng, f"run_{i}", duration) for i, kind in enumerate(kinds)]
    return [noisy(run, car, rng) for run in runs]


def simulate(
    car: BrushCar, effects: Effects, kind: str, effort: float, rng: np.random.Generator, name: str, duration: float
) -> Run:
    """One run of a manoeuvre, without noise; one that spins or stops ends early."""
    driver = ScaledDriver(kind, rng, single_track(car), effort)

    def seen(z: np.ndarray) -> tuple[float, float]:
        return float(np.hypot(z[0], z[1])), float(np.arctan2(z[1], z[0]))

    def is_lost(z: np.ndarray, _: np.ndarray) -> bool:
        v, beta = seen(z)
        return abs(beta) > SPIN or v < SLOWEST * driver.time

    begin = np.zeros(len(STATES))
    begin[[0, 6, 7]] = driver.start_speed
    z, accelerations, delta, tau = by_rows(
        (begin, np.zeros(2)), (0.0, 0.0), duration, lambda t, z, last: driver.command(t, *seen(z), last),
        partial(advance, p=car, q=effects), is_lost,
    )  # fmt: skip
    u, w, r, psi, x, y, left, right = z[:, :8].T
    states = np.stack([r, np.hypot(u, w), np.arctan2(w, u), 0.5 * (left + right), psi, x, y], axis=1)
    return sensed(states, accelerations, delta, tau, effects, rng, name, noise=0.0)
