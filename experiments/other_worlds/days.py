"""Days of logs from a car: one to calibrate on, others with one effect each or none.

    python -m experiments.other_worlds.days OUT --car roadster --seed 3 --smooth 8 --other-drives

OUT/day_one/run_*.csv: to calibrate on. OUT/CODE/run_*.csv: a later day. OUT/start.yaml: a first guess, its tyres wrong.
OUT/labels.json: {CODE: {"effects": {name: magnitude}, "strange": null, "drives": "day one's" or "other"}}, to be opened
last; of a day with a strange fault (`strange_faults`), "strange" is its kind and "strange_magnitude" its size.
OUT/truth.json: the car's own figures, for what a calibration says of them.
"""

import dataclasses
import hashlib
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import tyro
from scipy.signal import butter, filtfilt
from tqdm import tqdm

from diagrams.command import run_command
from drift_drake.car.brush.parameters import BrushParameters
from drift_drake.car.double_track.parameters import CARS, DoubleTrackParameters
from drift_drake.car.effects.magnitudes import Effects, make_effects
from drift_drake.car.equations import kind_of
from drift_drake.car.log.table import Run, write_run
from drift_drake.car.parameters import CarParameters, Tolerance, VehicleParameters
from drift_drake.car.vehicle_file import write_vehicle
from drift_drake.common.run_folder import write_json, write_versions
from drift_drake.gap.estimation.unknowns import FIELDS, deviations_of
from experiments.benchmarks.compiled_cases import NOISE
from experiments.benchmarks.rows import PERIOD
from experiments.other_worlds import brush_cars, double_track
from experiments.other_worlds.brush_cars import BRUSH_CARS, NOISE_SHARES
from experiments.other_worlds.drivers import DAY_ONE, OTHER, DayDriver
from experiments.other_worlds.strange_faults import STRANGE, strange_day

Car = DoubleTrackParameters | BrushParameters
ALL_CARS: dict[str, Car] = {**CARS, **BRUSH_CARS}

RANGE: dict[str, tuple[float, float]] = {
    "friction_level": (-0.3, -0.1),
    "mass_error": (0.08, 0.2),
    "yaw_inertia_error": (0.15, 0.4),
    "rear_stiffness_error": (-0.4, -0.15),
    "front_stiffness_error": (-0.4, -0.15),
    "cg_shift": (0.05, 0.12),
    "steering_lag": (0.05, 0.15),
    "steering_delay": (0.03, 0.1),
    "steering_rate_limit": (0.3, 0.6),
    "steering_offset": (0.01, 0.03),
    "torque_lag": (0.12, 0.35),
    "torque_gain_error": (-0.25, -0.1),
    "aero_drag": (0.7, 2.0),
    "road_grade": (0.02, 0.05),
    "gyro_bias": (0.02, 0.05),
    "sideslip_bias": (0.015, 0.035),
    "wheel_radius_error": (0.02, 0.05),
    "sensor_latency": (0.03, 0.1),
    "steering_ratio_error": (0.1, 0.25),
    "gyro_gain_error": (0.04, 0.09),
    "speed_gain_error": (0.03, 0.07),
    "road_bank": (0.06, 0.15),
    "command_clock_error": (0.03, 0.09),
}
"""Magnitudes for a full-size car; those of a car of another size are scaled as the catalogue's are."""
EITHER_SIGN = ("steering_offset", "road_grade", "gyro_bias", "sideslip_bias", "steering_ratio_error",
               "gyro_gain_error", "speed_gain_error", "road_bank")  # fmt: skip

GUESSED_STIFFNESS = {"small": 15.0, "truck": 10.0}  # [-] of the first guess: an axle's stiffness over its static load
GUESSED = ("friction_level", "front_stiffness_error", "rear_stiffness_error", "yaw_inertia_error")
OF_A_CAR = 20.0  # the same of any other
GUESS_TOLERANCE = Tolerance(yaw_inertia=0.1, front_axle_distance=0.02, wheel_radius=0.005, rear_axle_inertia=0.1,
                            torque=0.03, friction=0.1, front_stiffness=0.3, rear_stiffness=0.3,
                            steering_offset=0.003)  # fmt: skip


@dataclasses.dataclass(frozen=True)
class Days:
    """Days of a car."""

    out: Annotated[Path, tyro.conf.Positional]
    """Folder for the days."""
    car: Literal["coupe", "roadster", "rear_engined", "saloon", "small", "truck", "electric"] = "coupe"
    seed: int = 0
    smooth: float = 0.0
    """Sensors low-passed without lag at so many Hz, as motion capture or a smoothed inertial solution is; 0: not."""
    none: int = 4
    """Days without an effect."""
    count: int = len(RANGE)
    """Days with one effect, in the order of RANGE, and over again with other magnitudes."""
    other_drives: bool = False
    """Days but the first are driven at other speeds and with other manoeuvres."""
    first_effort: float = 1.0
    """Share of the usual steering and thrust on the first day: a small one calibrates on gentle drives."""
    duration: float = 12.0
    """[s] of a run; one that spins ends early."""
    strange: int = 0
    """Days with a strange fault that the catalogue lacks, in the order of `strange_faults.STRANGE`, and over again."""
    first_runs: int = len(DAY_ONE)
    """Runs of the first day: its manoeuvres in turn."""

    own_kind: bool = False
    """The first guess is of the car's own kind, all that it does not know a standard deviation or so off."""

    def __post_init__(self) -> None:
        if not 0.0 <= self.smooth < 0.5 / PERIOD:
            raise ValueError(f"smooth is {self.smooth:g} Hz; give 0 for none, or less than {0.5 / PERIOD:g} Hz")
        if not 0.0 < self.first_effort <= 1.0:
            raise ValueError(f"first-effort is {self.first_effort:g}; give more than 0 and at most 1")
        if self.first_runs < 1:
            raise ValueError(f"first-runs is {self.first_runs}; give 1 or more")


def smoothed(run: Run, bandwidth: float) -> Run:
    """The run with its sensors low-passed forwards and backwards (Butterworth, second order) at `bandwidth` [Hz]."""
    b, a = butter(2, 2.0 * bandwidth * PERIOD)
    columns: dict[str, Any] = {name: filtfilt(b, a, run.column(name)) for name in NOISE}
    return dataclasses.replace(run, **columns)


def make_day(
    config: Days, effects: dict[str, float], kinds: tuple[str, ...], index: int, effort: float = 1.0
) -> list[Run]:
    """Runs of one day; with the same seed, a day differs by its smoothing alone from the one without."""
    car, q = ALL_CARS[config.car], make_effects(effects)
    rng = np.random.default_rng([list(ALL_CARS).index(config.car), config.seed, index])
    if isinstance(car, BrushParameters):
        noise = NOISE_SHARES.get(config.car, 1.0)
        runs = brush_cars.day_runs(car, q, kinds, effort, rng, config.duration, noise)
    else:
        runs = [double_track.simulate(car, q, DayDriver(kind, rng, car, effort), rng, f"run_{i}", config.duration)
                for i, kind in enumerate(kinds)]  # fmt: skip
    return [smoothed(run, config.smooth) for run in runs] if config.smooth > 0.0 else runs


def drawn_effects(config: Days) -> list[dict[str, float]]:
    """What each day but the first hides: nothing `none` times, then one effect each."""
    car = ALL_CARS[config.car]
    rng = np.random.default_rng([list(ALL_CARS).index(config.car), config.seed])
    days: list[dict[str, float]] = [{} for _ in range(config.none)]
    for i in range(config.count):
        name = list(RANGE)[i % len(RANGE)]
        sign = -1.0 if name in EITHER_SIGN and rng.uniform() < 0.5 else 1.0
        magnitude = sign * float(rng.uniform(*RANGE[name]))
        if isinstance(car, BrushParameters):
            magnitude = brush_cars.scaled(name, magnitude, car.single_track())
        days.append({name: float(f"{magnitude:.4g}") if isinstance(car, BrushParameters) else round(magnitude, 4)})
    return days


def make_strange_day(config: Days, kinds: tuple[str, ...], index: int, number: int) -> tuple[list[Run], dict[str, Any]]:
    """Runs of a day with the strange fault of that number, and its label."""
    rng = np.random.default_rng([list(ALL_CARS).index(config.car), config.seed, index, number])
    kind = list(STRANGE)[number % len(STRANGE)]
    runs, magnitude = strange_day(make_day(config, {}, kinds, index), kind, single_track(config.car), rng)
    return runs, {"effects": {}, "strange": kind, "strange_magnitude": magnitude}


def single_track(name: str) -> VehicleParameters:
    """The nearest single-track car."""
    return ALL_CARS[name].single_track()


def first_guess(name: str) -> VehicleParameters:
    """What is known of a car before any drive: weighed and measured, its tyres not."""
    car, known = ALL_CARS[name], single_track(name)
    wheelbase = car.front_axle_distance + car.rear_axle_distance
    per_axle = GUESSED_STIFFNESS.get(name, OF_A_CAR) * car.mass * car.gravity / wheelbase
    return known.replace(
        friction=1.0,
        front_stiffness=float(f"{per_axle * car.rear_axle_distance:.5g}"),
        rear_stiffness=float(f"{per_axle * car.front_axle_distance:.5g}"),
        tolerance=GUESS_TOLERANCE,
    )


def guess_of_its_kind(config: Days) -> CarParameters:
    """The same of the car's own kind: its parameters and what a vehicle file says nothing of, as far off as drawn."""
    car = ALL_CARS[config.car].replace(tolerance=GUESS_TOLERANCE)
    rng, first = np.random.default_rng([list(ALL_CARS).index(config.car), config.seed, 4]), car.constants()
    kind, bounds = kind_of(first), {unknown.name: (unknown.low, unknown.high) for unknown in deviations_of(first)}
    by = {name: float(np.clip(rng.standard_normal(), *ends)) for name, ends in bounds.items()}
    off = {name: float(getattr(GUESS_TOLERANCE, FIELDS[name]) * rng.standard_normal()) for name in GUESSED}
    return car.with_constants(kind.changed_constants(kind.deviated(first, by, Effects()), make_effects(off)))


def write_day(folder: Path, runs: list[Run]) -> None:
    """One file a run."""
    folder.mkdir(parents=True, exist_ok=True)
    for run in runs:
        write_run(run, folder / f"{run.name}.csv")


def coded(config: Days, number: int) -> str:
    """Name of a day's folder, which tells nothing of what it hides."""
    key = f"{config.car} {config.seed} {number} {config.smooth:g} {config.other_drives}"
    return hashlib.sha256(key.encode()).hexdigest()[:8]


def main(config: Days) -> None:
    """Makes all days."""
    car, out = ALL_CARS[config.car], config.out
    manoeuvres = tuple(DAY_ONE[i % len(DAY_ONE)] for i in range(config.first_runs))
    write_day(out / "day_one", make_day(config, {}, manoeuvres, 0, config.first_effort))
    guess = guess_of_its_kind(config) if config.own_kind else first_guess(config.car)
    write_vehicle(out / "start.yaml", guess)
    write_json(out / "config.json", config)
    write_json(out / "truth.json", car)
    write_versions(out)
    labels: dict[str, dict[str, Any]] = {}
    kinds, drives = (OTHER, "other") if config.other_drives else (DAY_ONE, "day one's")
    days = drawn_effects(config)
    for i in tqdm(range(len(days) + config.strange), unit="day"):
        if i < len(days):
            runs, label = make_day(config, days[i], kinds, 1 + i), {"effects": days[i], "strange": None}
        else:
            runs, label = make_strange_day(config, kinds, 1 + i, i - len(days))
        code = coded(config, i)
        write_day(out / code, runs)
        labels[code] = label | {"drives": drives}
    write_json(out / "labels.json", labels)


if __name__ == "__main__":
    run_command(main, Days, __doc__)
