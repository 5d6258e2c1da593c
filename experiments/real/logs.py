"""Real vehicles end to end: identified on some logs, diagnosed on others.

    python -m experiments.real.logs --data ../shared/data --out runs/real_logs

The small car (TU Delft's DART) is identified on one floor and diagnosed on another and in free driving; the Ferrari
250 LM is identified on its first 150 s and diagnosed on the rest, with its measured speed fed. A stage that is done is
kept: start again to go on.
"""

import dataclasses
import json
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from diagrams.command import run_command
from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.log.table import IMPORT_REPORT, Run, read_case, stated_noise
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.vehicle_file import read_vehicle, write_vehicle
from drift_drake.common.run_folder import is_done, write_json
from drift_drake.common.safe_files import write_text
from drift_drake.gap.diagnosis.likelihood.diagnose import diagnose
from drift_drake.gap.diagnosis.reports import report as diagnosis_report
from drift_drake.gap.estimation.problem import make_problem
from drift_drake.gap.estimation.reduction import HORIZONS, STATES, errors_of
from drift_drake.gap.estimation.usable import usable
from drift_drake.gap.identification import report as identification_report
from drift_drake.gap.identification.calibration import trust_of
from drift_drake.gap.identification.held_out import judged_states
from drift_drake.gap.identification.identify import identify
from drift_drake.gap.logs.importing.import_logs import write_case
from drift_drake.gap.logs.importing.importer import import_recordings
from drift_drake.gap.logs.importing.mapping import read_mapping
from experiments.made import begun
from experiments.real.steering_steps import steering_of_steps

VEHICLES = Path(__file__).parent / "vehicles"
SMALL_CAR = VehicleParameters.from_yaml(VEHICLES / "small_car.yaml")
RACER = VehicleParameters.from_yaml(VEHICLES / "racer.yaml")
HELD = ("mass", "wheel_radius", "rear_axle_inertia")
# Effects whose practical range is a full-size car's: in metres, newtons or joules.
FULL_SIZE = ("aero_drag", "cg_shift", "differential_yaw_moment", "drivetrain_friction", "longitudinal_load_transfer",
             "tyre_relaxation", "tyre_thermal_fade")  # fmt: skip
SMALL_CATALOGUE = tuple(name for name in CATALOGUE if name not in FULL_SIZE)
SMALL_EFFECTS = ("steering_lag", "torque_lag", "rolling_resistance", "front_rear_friction_split")
# The encoder's readings come at 10 Hz, interpolated in between: no measurement of every row, so their noise is stated
# that much larger; without them nothing would tell spinning wheels from gripping ones.
RIM_SPEED = {"omega_r": "wheel"}
RIM_NOISE = {"omega_r": 0.2}  # [m/s]
# What the small car's x, y and psi say is in r, v and beta already, which are their derivatives.
POSE = ("x", "y", "psi")


@dataclasses.dataclass(frozen=True)
class Config:
    """Identification and diagnosis on real logs."""

    data: Path
    """Folder with `dart/` and `revs_250lm/`."""
    out: Path | None = None
    """Run folder; one that exists is gone on with."""
    every: int = 2
    """Rows of the logs that make one here: 2 is 50 Hz."""


def thinned(run: Run, every: int) -> Run:
    """Every so many rows of a run."""
    columns = {f.name: getattr(run, f.name) for f in dataclasses.fields(run) if f.name != "name"}
    kept: dict[str, Any] = {name: None if a is None else a[::every] for name, a in columns.items()}
    return Run(name=run.name, **kept)


def imported(config: Config, folder: Path, name: str, preset: str, source: str, **part: Any) -> Path:
    """Imports recordings once; the case folder."""
    out = folder / "logs" / name
    if not is_done(out / IMPORT_REPORT):
        mapping = read_mapping(preset)
        if preset == "dart":
            mapping = dataclasses.replace(mapping, formulas={**mapping.formulas, **RIM_SPEED})
        recordings = sorted((config.data / source).glob("*.csv"))
        runs, report = import_recordings(recordings, mapping, **part)
        write_case(out, runs, report, mapping)
    return out


def runs_of(case: Path, config: Config, without: Sequence[str] = ()) -> list[Run]:
    """The runs of an imported case, thinned."""
    return [thinned(run.without(*without), config.every) for run in read_case(case)]


def once(path: Path, work: Callable[..., Any], *arguments: Any) -> Any:
    """What `work` found, from the file if it has been done."""
    if not is_done(path):
        began = time.process_time()
        found = work(*arguments)
        write_json(path, {"seconds_of_cpu": time.process_time() - began, "found": found})
        print(f"{path.name}: {time.process_time() - began:.0f} s of CPU", flush=True)
    return json.loads(path.read_text())["found"]


def calibrate(folder: Path, name: str, case: Path, runs: list[Run], first: VehicleParameters,
              effects: tuple[str, ...]) -> Any:  # fmt: skip
    """Identifies a car; its vehicle file, report and numbers lie in the folder."""
    found = identify(runs, first, case=name, known=HELD, effects=effects, stated=RIM_NOISE | stated_noise(case),
                     watching=False)  # fmt: skip
    write_vehicle(folder / f"{name}.yaml", found.vehicle, found.effects)
    write_text(folder / f"{name}.html", identification_report.report_html(found))
    return found.calibration


def rms(runs: list[Run], car: VehicleParameters, own: Effects, stated: dict[str, float]) -> list[list[float]]:
    """Root mean square prediction errors [horizons][states] of a car in the states' units."""
    problem = make_problem(usable(runs, car)[0], car, stated=stated, own=own)
    squares = np.concatenate(errors_of(problem, np.zeros(problem.nuisances), ()))
    shown = judged_states(problem)
    return [[float(q) for q in row] for row in np.sqrt(np.nanmean(squares[..., shown], axis=0)) * problem.noise[shown]]


def ask(folder: Path, name: str, case: Path, runs: list[Run], calibrated: str, first: VehicleParameters,
        catalogue: tuple[str, ...]) -> dict[str, Any]:  # fmt: skip
    """Errors of the first guess and the calibrated car on logs that are new to it, and a diagnosis of what is left."""
    car, own = read_vehicle(folder / f"{calibrated}.yaml")
    trust = trust_of(json.loads((folder / f"{calibrated}.json").read_text())["found"])
    stated = RIM_NOISE | stated_noise(case)
    began = time.process_time()
    found = diagnose(runs, car, case=name, workers=1, catalogue=catalogue, stated=stated, own=own, **trust.options())
    seconds = time.process_time() - began
    write_text(folder / f"{name}.html", diagnosis_report.report_html(found))
    answer = found.answer
    return {
        "sentence": answer.sentence(),
        "diagnosis_seconds_of_cpu": seconds,
        "answer": dataclasses.asdict(answer),
        "horizons": HORIZONS,
        "states": [s for i, s in enumerate(STATES) if i in judged_states(found.problem)],
        "first_guess": rms(runs, first, Effects(), stated),
        "calibrated": rms(runs, car, own, stated),
    }


def main(config: Config) -> None:
    """All stages."""
    folder = begun("real_logs", config)
    small = {
        name: imported(config, folder, name, "dart", f"dart/{name}") for name in ("floor_a", "floor_b", "free_driving")
    }

    def identify_small(case: str) -> None:
        name, runs = f"small_car_{case}", runs_of(small[case], config, POSE)
        once(folder / f"{name}.json", calibrate, folder, name, small[case], runs, SMALL_CAR, SMALL_EFFECTS)

    def ask_small(case: str) -> None:
        name, runs = f"small_car_on_{case}", runs_of(small[case], config, POSE)
        car = "small_car_floor_a"
        once(folder / f"{name}.json", ask, folder, name, small[case], runs, car, SMALL_CAR, SMALL_CATALOGUE)

    identify_small("floor_a")
    steps = imported(config, folder, "steering_steps", "dart_sensors", "dart/steering_steps")
    wheelbase = SMALL_CAR.front_axle_distance + SMALL_CAR.rear_axle_distance
    once(folder / "steering_steps.json", steering_of_steps, read_case(steps), wheelbase)
    ask_small("floor_b")
    first = imported(config, folder, "racer_first", "revs_250lm", "revs_250lm", end=150.0)
    rest = imported(config, folder, "racer_rest", "revs_250lm", "revs_250lm", start=150.0)
    shown = ("front_rear_friction_split", "sideslip_bias")  # without a torque and a command, the others are not
    once(folder / "racer.json", calibrate, folder, "racer", first, runs_of(first, config), RACER, shown)
    name, runs = "racer_on_rest", runs_of(rest, config)
    once(folder / f"{name}.json", ask, folder, name, rest, runs, "racer", RACER, tuple(CATALOGUE))
    ask_small("free_driving")
    identify_small("free_driving")


if __name__ == "__main__":
    run_command(main, Config, __doc__)
