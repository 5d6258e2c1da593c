"""The whole chain on one car of another program: gather, choose, drift, diagnose what is left, apply it.

    python -m experiments.drifting.chain --plant multi_body --vehicle 1 --out runs/chain

Two informative drives on the lane are asked which model may drive the car (`gap.choose`). The figure-8 and the loops
are drifted with that model: the identified car, or the learnt one that adapts. The gap between the car of the vehicle
file and the plant is then identified from the two drives (`identify`), and diagnosed relative to that from the drifts.
Written: config.json, logs/{lane,drifts}, identified.yaml, corrected.yaml, report.md, overhead.png, replay.html.
"""

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

from diagrams.command import run_command
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.log.cases import runs_of
from drift_drake.car.log.table import Run, write_run
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.vehicle_file import write_vehicle
from drift_drake.cli.drive_run import as_logged
from drift_drake.common.errors import DriftDrakeError
from drift_drake.common.run_folder import make_run_folder, write_json, write_versions
from drift_drake.common.safe_files import write_figure
from drift_drake.common.threads import one_blas_thread
from drift_drake.drive.gathering.config import GatheringConfig
from drift_drake.drive.gathering.plan import plan_drive
from drift_drake.drive.learnt.adapter import OFFSET_TIMES
from drift_drake.drive.learnt.checkpoint import load_model, load_varied
from drift_drake.drive.learnt.hybrid_step import load_hybrid
from drift_drake.drive.loop.closed_loop import ClosedLoopRun, ControlConfig
from drift_drake.gap.choose.choice import Choice, ask
from drift_drake.gap.diagnosis.answers.apply import corrected_vehicle
from drift_drake.gap.diagnosis.diagnose import diagnose
from drift_drake.gap.identification.identify import identify
from drift_drake.view.pictures.overhead import overhead
from drift_drake.view.pictures.replay import replay
from experiments.drifting.runs import Believes, DriveJob, Learnt, Maneuver, closed_loop, reference
from experiments.gathering.beliefs import informative_drives
from experiments.made import RunConfig, tabulated, write_report
from experiments.other_worlds.true_cars import TrueCar, World, true_car

MANEUVERS: tuple[Maneuver, ...] = ("figure_8", "loops")


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
    varied = load_varied()
    offset_time = OFFSET_TIMES["varied"]
    believes = Learnt(varied, varied.prior(), adapting=True, offset_time=offset_time, lags=True)
    return "the learnt model of many structures, adapting", believes


def drifted(car: TrueCar, believes: Believes, config: ChainConfig) -> dict[Maneuver, ClosedLoopRun]:
    """Both manoeuvres, driven."""
    runs = {}
    for maneuver in MANEUVERS:
        loop = closed_loop(DriveJob(maneuver, {}, maneuver, Effects(), config.seed, believes, config.control, car))
        context = loop.initial_context(seed=config.seed)
        if loop.adapter is not None and isinstance(believes, Learnt):
            loop.adapter.set_posterior(loop.adapter.GetMyMutableContextFromRoot(context), believes.belief)
        runs[maneuver] = loop.run(context)
    return runs


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
    driven = informative_drives(learnt, first, Effects(), config.gathering, config.seed, car)
    drives = runs_of(driven.tables)
    choice = ask(drives, VehicleParameters(), steering=driven.config.steering)
    name, believes = believed(choice, config)
    runs = drifted(car, believes, config)
    drifts = [dataclasses.replace(run, name=maneuver) for maneuver, run in
              zip(MANEUVERS, runs_of([as_logged(runs[m].table) for m in MANEUVERS]), strict=True)]  # fmt: skip
    for kind, logs in {"lane": drives, "drifts": drifts}.items():
        for i, log in enumerate(logs):
            write_run(log, folder / "logs" / kind / f"run_{i}.csv")
    rows = [(maneuver, m.outcome, f"{m.completion:.0%}", f"{m.rms_e:.2f}", f"{m.rms_sideslip_error:.3f}")
            for maneuver, m in ((maneuver, run.metrics()) for maneuver, run in runs.items())]  # fmt: skip
    lines = [f"A {config.plant} car, vehicle {config.vehicle} of draw {config.vehicle_seed}.", "",
             f"- Choice: {choice.sentence()}.", f"- Driven with {name}.", "",
             *tabulated(("", "outcome", "completed", "RMS e [m]", "RMS sideslip error [rad]"), rows)]  # fmt: skip
    try:
        lines += ["", *(f"- {sentence}" for sentence in diagnosed(drives, drifts, folder))]
    except DriftDrakeError as error:
        lines += ["", f"- Not diagnosed: {error}."]
    tables, parameters = {"driven": runs["figure_8"].table}, VehicleParameters()
    write_figure(overhead(tables, reference("figure_8"), parameters), folder / "overhead.png")
    replay(tables, folder / "replay.html", reference("figure_8"), parameters)
    write_report(folder, "\n".join(lines), config)


if __name__ == "__main__":
    run_command(main, ChainConfig, __doc__)
