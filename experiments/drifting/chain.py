"""The whole chain on one car of another program: gather, choose, drift, diagnose what is left, apply it.

    python -m experiments.drifting.chain --plant multi_body --vehicle 1 --out runs/chain

Two informative drives on the lane are asked which model may drive the car (`gap.choose`). The figure-8 and the loops
are drifted with that model: the identified car, or the learnt one that adapts, which drifts each twice and begins with
what all drifts before taught. The gap between the car of the vehicle file and the plant is then identified from the two
drives (`identify`), and diagnosed relative to that from the drifts.
Written: config.json, logs/{lane,drifts}, identified.yaml, corrected.yaml, report.md, overhead.png, replay.html.
"""

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

from diagrams.command import run_command
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.log.cases import runs_of
from drift_drake.car.log.table import InvalidLogError, Run, write_run
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.vehicle_file import write_vehicle
from drift_drake.cli.drive_run import as_logged
from drift_drake.common.errors import DriftDrakeError
from drift_drake.common.run_folder import make_run_folder, write_json, write_versions
from drift_drake.common.safe_files import write_figure
from drift_drake.common.threads import one_blas_thread
from drift_drake.drive.gathering.config import GatheringConfig
from drift_drake.drive.gathering.plan import plan_drive
from drift_drake.drive.learnt.checkpoint import load_model
from drift_drake.drive.learnt.hybrid_step import load_hybrid
from drift_drake.drive.loop.closed_loop import ClosedLoopRun, ControlConfig
from drift_drake.drive.loop.earlier_drive import check_earlier_drive
from drift_drake.gap.choose.choice import Choice, ask
from drift_drake.gap.diagnosis.answers.apply import corrected_vehicle
from drift_drake.gap.diagnosis.diagnose import diagnose
from drift_drake.gap.identification.identify import identify
from drift_drake.view.pictures.overhead import overhead
from drift_drake.view.pictures.replay import replay
from experiments.drifting.runs import Believes, DriveJob, Learnt, Maneuver, adapting, adapting_after, driven, reference
from experiments.gathering.beliefs import informative_drives
from experiments.made import RunConfig, tabulated, write_report
from experiments.other_worlds.true_cars import TrueCar, World, true_car

MANEUVERS: tuple[Maneuver, ...] = ("figure_8", "loops")
AGAIN = "again"


@dataclasses.dataclass(frozen=True)
class ChainConfig(RunConfig):
    """Which car, and how it is driven."""

    plant: World = "multi_body"
    vehicle: int = 0
    """Its place in the draw."""
    vehicle_seed: int = 0
    seed: int = 0
    """Of the sensors' noise."""
    model: Literal["chosen", "identified", "adapting"] = "chosen"
    """What drives, where not what the informative drives choose."""
    gathering: GatheringConfig = dataclasses.field(default_factory=GatheringConfig)
    control: ControlConfig = dataclasses.field(default_factory=ControlConfig)


def believed(choice: Choice, config: ChainConfig) -> tuple[str, Believes]:
    """(what drives, in words; the same for a `DriveJob`)."""
    car = choice.found.car
    if car is not None and "identified" in (config.model, choice.believed) and config.model != "adapting":
        return car.name, car
    if car is not None and choice.believed == "hybrid" and config.model == "chosen":
        hybrid = load_hybrid()
        return f"{car.name} and what it leaves over", Learnt(hybrid, hybrid.prior(), adapting=True, car=car)
    return "the learnt model of many structures, adapting", adapting()


def drifted(car: TrueCar, believes: Believes, config: ChainConfig) -> tuple[dict[str, ClosedLoopRun], list[str]]:
    """(both manoeuvres, driven, and with the learnt model a second time each, which begins with what all drives before
    taught; which of them taught nothing, and why, in sentences)."""
    runs, taught, said = dict[str, ClosedLoopRun](), list[Run](), list[str]()
    adapts = isinstance(believes, Learnt) and believes.car is None
    for maneuver in MANEUVERS:
        for attempt, name in enumerate((maneuver, f"{maneuver} {AGAIN}")[: 1 + adapts]):
            begins = adapting_after(taught, maneuver, *MANEUVERS) if taught else believes
            job = DriveJob(name, {}, maneuver, Effects(), config.seed + attempt, begins, config.control, car)
            runs[name] = driven(job)
            log = logged(name, runs[name])
            if not adapts:
                continue
            try:
                check_earlier_drive(log, reference(maneuver))
            except InvalidLogError as error:
                said.append(f"Nothing was learnt from {error}.")
                break
            taught.append(log)
    return runs, said


def logged(name: str, run: ClosedLoopRun) -> Run:
    """What a car's logger has of a run."""
    return dataclasses.replace(runs_of([as_logged(run.table)])[0], name=name)


def diagnosed(drives: Sequence[Run], drifts: Sequence[Run], folder: Path) -> list[str]:
    """Identifies the car from the informative drives, diagnoses the drifts relative to it, applies; sentences."""
    found = identify(drives, VehicleParameters(), criterion="prediction", force=True, watching=False, case="lane")
    write_vehicle(folder / "identified.yaml", found.vehicle, found.effects)
    answer = diagnose(drifts, (found.vehicle, found.effects), found.calibration, case="drifts").answer
    vehicle, effects = corrected_vehicle(found.vehicle, answer, own=found.effects)
    write_vehicle(folder / "corrected.yaml", vehicle, effects)
    write_json(folder / "answer.json", answer)
    return [found.calibration.sentence(), answer.sentence()]


@one_blas_thread()
def main(config: ChainConfig) -> None:
    """Runs the chain on one car."""
    folder, learnt = make_run_folder("chain", config.out), load_model()
    write_json(folder / "config.json", config)
    write_versions(folder)
    car = true_car(config.plant, config.vehicle, config.vehicle_seed)
    first = plan_drive(learnt, learnt.prior(), config.gathering, config.gathering.alpha)
    gathered = informative_drives(learnt, first, Effects(), config.gathering, config.seed, car)
    drives = runs_of(gathered.tables)
    choice = ask(drives, VehicleParameters(), steering=gathered.config.steering)
    name, believes = believed(choice, config)
    runs, said = drifted(car, believes, config)
    drifts = [logged(name, run) for name, run in runs.items()]
    for kind, logs in {"lane": drives, "drifts": drifts}.items():
        for i, log in enumerate(logs):
            write_run(log, folder / "logs" / kind / f"run_{i}.csv")
    rows = [(maneuver, m.outcome, f"{m.completion:.0%}", f"{m.rms_e:.2f}", f"{m.rms_sideslip_error:.3f}")
            for maneuver, m in ((maneuver, run.metrics()) for maneuver, run in runs.items())]  # fmt: skip
    lines = [f"A {config.plant} car, vehicle {config.vehicle} of draw {config.vehicle_seed}.", "",
             f"- Choice: {choice.sentence()}.", f"- Driven with {name}.", "",
             *tabulated(("", "outcome", "completed", "RMS e [m]", "RMS sideslip error [rad]"), rows), "",
             *(f"- {sentence}" for sentence in said)]  # fmt: skip
    try:
        lines += [f"- {sentence}" for sentence in diagnosed(drives, drifts, folder)]
    except DriftDrakeError as error:
        lines.append(f"- Not diagnosed: {error}.")
    tables = {name: run.table for name, run in runs.items() if name.startswith("figure_8")}
    parameters = VehicleParameters()
    write_figure(overhead(tables, reference("figure_8"), parameters), folder / "overhead.png")
    replay(tables, folder / "replay.html", reference("figure_8"), parameters)
    write_report(folder, "\n".join(lines), config)


if __name__ == "__main__":
    run_command(main, ChainConfig, __doc__)
