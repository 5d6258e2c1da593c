"""Days of logs from a simulator of the user's, each with one hidden change, none, or a fault that the catalogue lacks.

    python -m experiments.simulators.days OUT --simulator examples/simulators/four_wheels.yaml --seed 1 --smooth 8

It is judged against itself. Its parameters are first moved by some tolerances: that is the true car, and the simulator
file the first guess. The folders are those of `experiments.other_worlds.days`; `python -m experiments.simulators.judge`
judges them. Commands are those of a driver in the single-track car of the simulator file: open loop, the same whatever
the simulator.
"""

import dataclasses
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import tyro
from scipy.signal import butter, filtfilt
from tqdm import tqdm

from diagrams.command import run_command
from drift_drake.car.car_file import read_car, read_simulator_car
from drift_drake.car.effects.magnitudes import Effects, make_effects, measured
from drift_drake.car.equations import folded_into
from drift_drake.car.foreign.along import inputs_along
from drift_drake.car.foreign.asked import job_of, motion_of
from drift_drake.car.foreign.pool import end_workers, roll_all
from drift_drake.car.foreign.simulator_car import SimulatorCar
from drift_drake.car.log.table import Run, write_run
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.single_track.motion import motion
from drift_drake.car.vehicle_file import write_vehicle
from drift_drake.common.arrays import Array
from drift_drake.common.run_folder import write_json, write_versions
from experiments.benchmarks.compiled_cases import NOISE
from experiments.other_worlds.brush_cars import scaled
from experiments.other_worlds.days import EITHER_SIGN, RANGE
from experiments.other_worlds.drivers import DAY_ONE, OTHER, ScaledDriver
from experiments.other_worlds.strange_faults import STRANGE, strange_day

PERIOD, SUBSTEPS = 0.01, 5  # [s] of a row, and the driver's car's steps in it
HIDDEN = ("mass_error", "friction_level", "front_stiffness_error", "yaw_inertia_error", "cg_shift", "steering_lag",
          "steering_delay", "steering_offset", "torque_gain_error", "gyro_bias", "sensor_latency",
          "aero_drag")  # fmt: skip
FORCES = ("aero_drag", "rolling_resistance", "road_grade", "road_bank", "differential_yaw_moment")
ROUNDS = 4  # of a roll-out, the forces of each along the motion of the one before
TRUE = {"front_stiffness_error": 0.25, "rear_stiffness_error": 0.25, "friction_level": 0.1, "yaw_inertia_error": 0.12,
        "cg_shift": 0.03}  # fmt: skip
SHORTEST = 250  # rows of a run that is kept
SPUN, SLOWEST = 1.0, 4.0  # [rad], [m/s] at which a full-size car's run ends


@dataclasses.dataclass(frozen=True)
class SimulatorDays:
    """Days of a simulator."""

    out: Annotated[Path, tyro.conf.Positional]
    """Folder for the days."""
    simulator: Path
    """Simulator file: the first guess."""
    seed: int = 0
    smooth: float = 0.0
    """Sensors low-passed without lag at so many Hz; 0: not."""
    none: int = 4
    """Days without an effect."""
    strange: int = 0
    """Days with a strange fault that the catalogue lacks, in the order of `strange_faults.STRANGE`, and over again."""
    effort: float = 1.0
    """Share of the steering and of the torque of a full-size car's driver."""
    duration: float = 12.0
    """[s] of a run; one that spins ends early."""


def commands(
    p: VehicleParameters, kind: str, rng: np.random.Generator, effort: float, rows: int
) -> tuple[Array, float, float]:
    """Road-wheel angle [rad] and engine torque [N m] [rows, 2], and speeds [m/s] that it begins and ends at."""
    driver, constants = ScaledDriver(kind, rng, p, effort), p.constants()
    z, last, out = np.array([0.0, driver.start_speed, 0.0, driver.start_speed]), (0.0, 0.0), [(0.0, 0.0)]
    for row in range(rows - 1):
        new = driver.command(row * PERIOD, float(z[1]), float(z[2]), last)
        for step in range(SUBSTEPS):
            share = (step + 0.5) / SUBSTEPS
            m = motion(*z, *(a + share * (b - a) for a, b in zip(last, new, strict=True)), constants)
            z = z + PERIOD / SUBSTEPS * np.array([m.r_dot, m.v_dot, m.beta_dot, m.omega_r_dot])
            z[1], z[3] = max(z[1], driver.time), max(z[3], 0.0)
        last = new
        out.append(new)
    return np.array(out), driver.start_speed, SLOWEST * driver.time


def driven(car: SimulatorCar, effects: Effects, given: Array, speed: float) -> Array:
    """r, v, beta, omega_r, psi [rows, 5] of the simulator under commands [rows, 2] from a straight start."""
    simulator = dataclasses.replace(car.simulator, limit=600.0)  # twelve seconds, not half a one
    constants, rest = folded_into(car.constants()._replace(simulator=simulator), effects)
    steps = simulator.steps_in(PERIOD)
    start = np.array([[0.0, speed, 0.0, speed, 0.0]])
    found = np.repeat(start, len(given), axis=0)
    for _ in range(ROUNDS if any(getattr(rest, name) for name in FORCES) else 1):
        inputs = inputs_along((given[:, 0], given[:, 1]), found, PERIOD, constants, rest)
        (got,) = roll_all([job_of(constants, PERIOD / steps, start, {name: q[None] for name, q in inputs.items()})])
        found = np.nan_to_num(motion_of(simulator, got, PERIOD / steps)[0, ::steps])
    return found


def make_run(
    car: SimulatorCar, effects: Effects, kind: str, rng: np.random.Generator, name: str, config: SimulatorDays
) -> Run | None:
    """One run as a log has it; None where the car spins at once."""
    given, speed, slowest = commands(car.single_track(), kind, rng, config.effort, round(config.duration / PERIOD) + 1)
    true = driven(car, effects, given, speed)
    wrong = np.flatnonzero((np.abs(true[:, 2]) > SPUN) | (true[:, 1] < slowest))
    end = int(wrong[0]) if len(wrong) else len(true)
    if end < SHORTEST:
        return None
    r, v, beta, omega_r = measured(true[:, 0], true[:, 1], true[:, 2], true[:, 3], effects)
    v_x, v_y = true[:, 1] * np.cos(true[:, 2]), true[:, 1] * np.sin(true[:, 2])
    a_x, a_y = np.gradient(v_x, PERIOD) - true[:, 0] * v_y, np.gradient(v_y, PERIOD) + true[:, 0] * v_x
    columns = {"r": r, "v": v, "beta": beta, "omega_r": omega_r, "psi": true[:, 4], "ax": a_x, "ay": a_y}
    if not car.simulator.gives("omega_r"):
        del columns["omega_r"]
    logged: dict[str, Any] = {}
    for column, values in columns.items():
        noisy = values[:end] + NOISE[column] * rng.standard_normal(end)
        logged[column] = filtfilt(*butter(2, 2.0 * config.smooth * PERIOD), noisy) if config.smooth else noisy
    return Run(name, t=PERIOD * np.arange(end), delta_cmd=given[:end, 0], tau_cmd=given[:end, 1], **logged)


def true_car(guess: SimulatorCar, rng: np.random.Generator) -> SimulatorCar:
    """The first guess with its parameters off by what is usual."""
    size = guess.single_track()
    off = {name: scaled(name, float(rng.uniform(-most, most)), size) for name, most in TRUE.items()}
    off = {name: q for name, q in off.items() if name not in guess.simulator.lacking}
    changed = guess.simulator.changed_constants(guess.constants(), make_effects(off))
    by = {name: float(np.clip(rng.normal(), -1.5, 1.5)) for name in guess.simulator.unknown}
    return guess.with_constants(guess.simulator.deviated(changed, by, Effects()))


def main(config: SimulatorDays) -> None:
    """Makes all days."""
    rng, out = np.random.default_rng([config.seed, 88]), config.out
    guess = read_simulator_car(config.simulator)
    car, size = true_car(guess, rng), guess.single_track()
    out.mkdir(parents=True, exist_ok=True)
    write_vehicle(out / "start.yaml", guess, read_car(config.simulator)[1])
    write_json(out / "truth.json", {"car": car.single_track().to_dict(), "values": car.constants().by_name()})
    write_json(out / "config.json", config)
    write_versions(out)
    names = [name for name in HIDDEN if name not in guess.simulator.lacking]
    days: list[tuple[str, dict[str, float], tuple[str, ...]]] = [("day_one", {}, DAY_ONE)]
    for i in range(config.none + len(names)):
        name = names[i - config.none] if i >= config.none else ""
        sign = -1.0 if name in EITHER_SIGN and rng.uniform() < 0.5 else 1.0
        hidden = {name: float(f"{scaled(name, sign * float(rng.uniform(*RANGE[name])), size):.4g}")} if name else {}
        days.append((f"d{i:02d}", hidden, OTHER if i % 2 else DAY_ONE))
    labels: dict[str, Any] = {}
    plain = len(days)
    days += [(f"d{plain - 1 + i:02d}", {}, OTHER if i % 2 else DAY_ONE) for i in range(config.strange)]
    for number, (code, hidden, kinds) in enumerate(tqdm(days, unit="day")):
        made = [make_run(car, make_effects(hidden), kind, rng, f"run_{i}", config) for i, kind in enumerate(kinds)]
        runs = [run for run in made if run is not None]
        label: dict[str, Any] = {"effects": hidden, "strange": None}
        if number >= plain:
            strange = list(STRANGE)[(number - plain) % len(STRANGE)]
            runs, magnitude = strange_day(runs, strange, car.single_track(), rng)
            label |= {"strange": strange, "strange_magnitude": magnitude}
        (out / code).mkdir(exist_ok=True)
        for run in runs:
            write_run(run, out / code / f"{run.name}.csv")
        if code != "day_one":
            labels[code] = label | {"drives": "other" if kinds == OTHER else "day one's"}
            write_json(out / "labels.json", labels)
    end_workers()


if __name__ == "__main__":
    run_command(main, SimulatorDays, __doc__)
