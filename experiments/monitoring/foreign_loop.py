"""The closed loop of cars of other programs that change on the way, with and without what follows from the monitor.

    python -m experiments.monitoring.foreign_loop --plant multi_body --vehicles 6 --out runs/foreign_loop

Each car drifts the figure-8 with the adapting model of many structures. From the drives that held their drifts a
double-track car is identified, which drives too; on both kinds of drives it is calibrated by prediction. It is then in
the controller, and in the monitor that judges by windows; the plant changes at a moment that depends on the car. A file
a car and a drive (give `--out`); what is there is not made again.
"""

import dataclasses
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np

from diagrams.command import run_command
from drift_drake.car.double_track.parameters import DoubleTrackParameters
from drift_drake.car.effects.magnitudes import make_effects
from drift_drake.car.foreign.stepped_plant import SteppedCar, SteppedPlant
from drift_drake.car.given_vehicle import vehicle_given
from drift_drake.car.log.table import InvalidLogError, Run, read_run, write_run
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.sensor_errors import sensor_errors
from drift_drake.car.vehicle_file import write_vehicle
from drift_drake.common.run_folder import write_json
from drift_drake.common.threads import one_blas_thread
from drift_drake.drive.learnt.adapter import OFFSET_TIMES, BayesianAdapter
from drift_drake.drive.learnt.checkpoint import load_varied
from drift_drake.drive.learnt.lag_bank import BANK
from drift_drake.drive.learnt.quality import step_model
from drift_drake.drive.loop.closed_loop import ClosedLoop
from drift_drake.drive.loop.earlier_drive import check_earlier_drive
from drift_drake.drive.loop.faults import Fault
from drift_drake.gap.choose.identified import IdentifiedCar
from drift_drake.gap.identification.identify import identify
from drift_drake.gap.monitoring.baselines import baseline_given, calibrated_watcher
from drift_drake.gap.monitoring.in_loop import GapWatch, events_of
from experiments.made import RunConfig, SpreadConfig, begun, write_report
from experiments.monitoring.closed_loop import CHANGES, PATCH, as_log, disturbances, pairs, reference, table
from experiments.other_worlds.changing_car import ChangingCar
from experiments.other_worlds.true_cars import Stepped
from experiments.settings import run_kept

Plant = Literal["multi_body", "mujoco"]
Mode = Literal["off", "slow", "correct_or_slow"]
MODES: tuple[Mode, ...] = ("off", "slow", "correct_or_slow")
CHANGED = tuple(name for name in CHANGES if name != "friction fade")
ONSETS = (3.0, 8.0)  # [s]
NORMAL = (900, 901, 902)  # seeds of the noise of normal drives


@dataclasses.dataclass(frozen=True)
class ForeignLoopConfig(SpreadConfig, RunConfig):
    """Which cars."""

    plant: Plant = "multi_body"
    vehicles: int = 6
    first: int = 0
    vehicle_seed: int = 0


class Vehicle(NamedTuple):
    """One car of a draw, and the folder of its files."""

    plant: Plant
    number: int
    seed: int
    folder: Path

    @property
    def name(self) -> str:
        return f"{self.plant}-{self.number:03d}"

    def made(self, friction: float = 1.0) -> SteppedCar:
        return Stepped(self.plant, self.number, self.seed).made(friction)

    def onset(self) -> float:
        """When it changes [s]."""
        return round(float(np.random.default_rng([self.seed, self.number, 3]).uniform(*ONSETS)), 2)

    def changing(self, change: str) -> tuple[SteppedCar, list[Fault]]:
        """(the car that changes, what goes wrong in its loop)."""
        effects, onset = make_effects(CHANGES[change]), self.onset()
        if effects.sideslip_bias != 0.0:
            return self.made(), disturbances(change, effects, onset)[0]
        end = onset + PATCH if change == "friction patch" else np.inf
        after = self.made(1.0 + effects.friction_level)
        rate = effects.steering_rate_limit or np.inf
        return ChangingCar(self.made(), after, onset, end, 1.0 + effects.torque_gain_error, rate), []


class Job(NamedTuple):
    """One drive."""

    vehicle: Vehicle
    change: str
    mode: Mode

    @property
    def path(self) -> Path:
        return self.vehicle.folder / f"{self.vehicle.name}-{self.change.replace(' ', '_')}-{self.mode}.json"


def looped(
    car: SteppedCar, believed: IdentifiedCar | None, watch: GapWatch | None = None, faults: list[Fault] | None = None
) -> ClosedLoop:
    """The loop of a car whose controller believes an identified one, or has the adapting model of many structures."""
    parameters, course, learnt = VehicleParameters(), reference("single_track"), load_varied()
    plant = SteppedPlant(car, course.path)
    if believed is None:
        adapter = BayesianAdapter(learnt, offset_time=OFFSET_TIMES["varied"], lags=BANK)
        return ClosedLoop(parameters, course, step_model(learnt, learnt.prior()), plant=plant, adapter=adapter)
    return ClosedLoop(parameters, course, believed.step_model(), plant=plant, watch=watch, faults=faults or [],
                      sensor_errors=sensor_errors(believed.effects))  # fmt: skip


def normal_drives(vehicle: Vehicle, believed: IdentifiedCar | None) -> list[Run]:
    """Those of a car's normal drives that held their drifts."""
    loop, held = looped(vehicle.made(), believed), []
    for seed in NORMAL:
        run = as_log(loop.run(loop.initial_context(seed)).table)
        try:
            check_earlier_drive(run, loop.reference)
        except InvalidLogError:
            continue
        held.append(run)
    return held


@one_blas_thread()
def calibrate(vehicle: Vehicle) -> dict[str, int]:
    """Writes the double-track car that is calibrated on a car's normal drives; how many of them held their drifts."""
    runs = normal_drives(vehicle, None)
    counts = {"learnt": len(runs), "identified": 0}
    if runs:
        first = identify(runs, VehicleParameters(), case=vehicle.name, criterion="prediction", car="double-track",
                         watching=False, force=True)  # fmt: skip
        further = normal_drives(vehicle, IdentifiedCar(first.vehicle, first.effects))
        counts["identified"] = len(further)
        found = identify([*runs, *further], VehicleParameters(), case=vehicle.name, criterion="prediction",
                         car="double-track", force=True)  # fmt: skip
        write_run(runs[0], vehicle.folder / f"{vehicle.name}.csv")
        write_vehicle(vehicle.folder / f"{vehicle.name}.yaml", found.vehicle, found.effects)
        write_json(vehicle.folder / f"{vehicle.name}.calibration.json", found.calibration)
    return counts


@one_blas_thread()
def drive(job: Job) -> dict[str, Any]:
    """How one drive ended, and what the monitor reported."""
    vehicle = job.vehicle
    given = vehicle_given(vehicle.folder / f"{vehicle.name}.yaml")
    assert isinstance(given.parameters, DoubleTrackParameters)
    believed, watch = IdentifiedCar(given.parameters, given.effects), None
    car, faults = vehicle.changing(job.change)
    if job.mode != "off":
        baseline = baseline_given(vehicle.folder / f"{vehicle.name}.calibration.json")
        watch = GapWatch(
            calibrated_watcher(baseline, read_run(vehicle.folder / f"{vehicle.name}.csv"), given), job.mode
        )
    loop = looped(car, believed, watch, faults)
    run = loop.run(loop.initial_context(vehicle.number))
    return {
        "plant": vehicle.plant, "change": job.change, "mode": job.mode, "seed": vehicle.number,
        "onset": vehicle.onset(), "events": events_of(watch.monitor, run.table) if watch else [],
        "slow": float(run.table["slow"].mean()) if "slow" in run.table else 0.0,
        "metrics": dataclasses.asdict(run.metrics()),
    }  # fmt: skip


def main(config: ForeignLoopConfig) -> None:
    """All cars, then all drives."""
    folder = begun("foreign_loop", config)
    cars = [Vehicle(config.plant, config.first + i, config.vehicle_seed, folder) for i in range(config.vehicles)]
    counts = run_kept(config.run_on, calibrate, cars, lambda car: folder / f"{car.name}.counts.json", "car")
    usable = [car for car, count in zip(cars, counts, strict=True) if count["learnt"]]
    jobs = [Job(car, change, mode) for car in usable for change in CHANGED for mode in MODES]
    results = run_kept(config.run_on, drive, jobs, lambda job: job.path, "drive")
    held = [f"{car.name}: of {len(NORMAL)} normal drives with either, {count['learnt']} with the learnt model and "
            f"{count['identified']} with the identified car held their drifts"
            for car, count in zip(cars, counts, strict=True)]  # fmt: skip
    write_report(folder, "\n".join([table(results), "", pairs(results), "", *held]), config)


if __name__ == "__main__":
    run_command(main, ForeignLoopConfig, __doc__)
