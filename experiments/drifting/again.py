"""The figure-8 once more: what a car's own drifts teach, relative to the best of our cars on ten times the data.

    python -m experiments.drifting.again --plant multi_body --vehicles 8 --vehicle-seed 301128 --out runs/again

Each car drifts the figure-8 with the adapting model of many structures (`first`), then once more with another noise:
with that model anew (`first again`); so that it begins with what the first drift taught (`learnt`, as `drift-drake
drive --after`), and a third time with what both taught (`learnt twice`); and with the double-track car that the first
drift identifies (`identified`). After a first drift that was not held these are `first again`. It drifts the figure-8
after one at 0.4 rad of sideslip, too (`after a gentle one`). The reference stands in for an oracle where nobody has the
car's equations: of the single-track, double-track and brush cars, each identified on the two lane drives and three
further drifts (some 90 s, ten times the lane drives), the one that drives best. Broken off, it goes on where it was
(give `--out`).
"""

import contextlib
import dataclasses
from collections.abc import Sequence
from typing import Any, Literal, NamedTuple

import numpy as np
import pandas as pd

from diagrams.command import run_command
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.log.cases import runs_of
from drift_drake.car.log.table import InvalidLogError, Run
from drift_drake.car.parameters import CarParameters, VehicleParameters
from drift_drake.cli.drive_run import as_logged
from drift_drake.common.arrays import Array
from drift_drake.common.threads import one_blas_thread
from drift_drake.drive.gathering.config import GatheringConfig
from drift_drake.drive.gathering.plan import plan_drive
from drift_drake.drive.learnt.checkpoint import load_model, load_varied
from drift_drake.drive.learnt.noise import within
from drift_drake.drive.learnt.quality import squared_distances
from drift_drake.drive.learnt.samples import samples_from_log
from drift_drake.drive.loop.closed_loop import ControlConfig
from drift_drake.drive.loop.earlier_drive import check_earlier_drive
from drift_drake.gap.choose.choice import car_error
from drift_drake.gap.choose.identified import IdentifiedCar, identified_with_own_states
from drift_drake.gap.estimation.windows import windowed
from drift_drake.gap.identification.identify import calibrate
from drift_drake.gap.identification.stated import Asked
from experiments.benchmarks.intervals import by_vehicle
from experiments.drifting.runs import Believes, DriveJob, Learnt, Maneuver, adapting, adapting_after, drive, reference
from experiments.gathering.beliefs import informative_drives
from experiments.made import RunConfig, SpreadConfig, begun, tabulated, write_report
from experiments.other_worlds.brush_drifters import COUPE
from experiments.other_worlds.true_cars import TrueCar, true_car
from experiments.settings import run_kept

SECOND, THIRD, FURTHER = 1, 2, (101, 102, 103)  # seeds of the noise: of later attempts, of the reference's drifts
GUESSES: dict[str, CarParameters] = {"double-track": VehicleParameters(), "brush": COUPE}
KINDS = ("single-track", *GUESSES)
Plant = Literal["multi_body", "mujoco", "brush"]  # drawn one by one, without further effects
MODELS = (
    "first",
    "first again",
    "after a gentle one",
    "learnt",
    "learnt twice",
    "identified",
    *KINDS,
    "reference",
    "oracle",
)


@dataclasses.dataclass(frozen=True)
class AgainConfig(SpreadConfig, RunConfig):
    """Which cars."""

    plant: Plant = "multi_body"
    vehicles: int = 8
    first: int = 0
    vehicle_seed: int = 0

    def cars(self) -> "list[Vehicle]":
        return [Vehicle(self.plant, self.first + i, self.vehicle_seed) for i in range(self.vehicles)]


class Vehicle(NamedTuple):
    """One car of a draw."""

    world: Plant
    number: int
    seed: int

    def made(self) -> TrueCar:
        return true_car(self.world, self.number, self.seed)

    def drifted(
        self, believes: Believes, seed: int, maneuver: Maneuver = "figure_8"
    ) -> tuple[pd.DataFrame, dict[str, Any]]:
        """(the log of a drive, its metrics) with what a controller believes."""
        job = DriveJob("again", {}, maneuver, Effects(), seed, believes, ControlConfig(), self.made())
        metrics, table = drive(job)
        return as_logged(table), metrics

    def lane_drives(self) -> list[pd.DataFrame]:
        """The logs of the two informative drives."""
        learnt, config = load_model(), GatheringConfig()
        first = plan_drive(learnt, learnt.prior(), config, config.alpha)
        return informative_drives(learnt, first, Effects(), config, 0, self.made()).tables


def distances_of(log: pd.DataFrame) -> Array:
    """Squared Mahalanobis distances of a drive's samples from what that model believed before each, eq. (7)."""
    model = load_varied()
    samples = samples_from_log(log.assign(e=0.0, dphi=0.0), None, 0, 0, lag=model.lag)
    return squared_distances(model, model.prior(), samples)


def single_track(runs: Sequence[Run]) -> IdentifiedCar:
    """The car of one track that predicts drives best."""
    asked = Asked(VehicleParameters(), Effects(), known=(), criterion="prediction", force=True, kind="single-track")
    found = calibrate(runs, asked)
    return IdentifiedCar(found.vehicle, found.effects)


def identified_kinds(runs: Sequence[Run]) -> dict[str, IdentifiedCar]:
    """The cars that runs identify, by kind."""
    cars = {"single-track": single_track(runs)}
    for kind, guess in GUESSES.items():
        found = identified_with_own_states([windowed(run) for run in runs], guess)
        if found is not None:
            cars[kind] = found[0]
    return cars


def after(drifts: Sequence[Run], maneuver: Maneuver = "figure_8") -> Learnt:
    """What those figure-8s taught that held their drifts."""
    taught = []
    for run in drifts:
        with contextlib.suppress(InvalidLogError):
            check_earlier_drive(run, reference("figure_8"))
            taught.append(run)
    return adapting_after(taught, maneuver, "figure_8")


@one_blas_thread()
def attempts(vehicle: Vehicle) -> dict[str, Any]:
    """The metrics of each attempt of one car; of its first drift how far off its identified cars are (`car_error`), and
    how much of it the model's covariance holds."""
    found, refused = dict[str, Any](), ""

    def keep(name: str, believes: Believes, seed: int = SECOND) -> pd.DataFrame:
        log, found[name] = vehicle.drifted(believes, seed)
        return log

    first = keep("first", adapting(), seed=0)
    keep("first again", adapting())
    gentle, _ = vehicle.drifted(adapting(), 0, "gentle")
    keep("after a gentle one", after(runs_of([gentle])))
    (run,) = runs_of([first])
    try:
        second = keep("learnt", adapting_after([run], "figure_8"))
        keep("learnt twice", after([run, *runs_of([second])]), THIRD)
        once = identified_with_own_states([windowed(run)], VehicleParameters())
        if once is not None:
            keep("identified", once[0])
    except InvalidLogError as error:
        refused = str(error)
        found["learnt"] = found["learnt twice"] = found["identified"] = found["first again"]
    further = [vehicle.drifted(adapting(), seed)[0] for seed in FURTHER]
    cars = identified_kinds(runs_of([*vehicle.lane_drives(), *further]))
    for kind, car in cars.items():
        keep(kind, car)
    if vehicle.world == "brush":
        keep("oracle", "oracle")
    judged = [windowed(run)]
    errors = {kind: car_error(car, judged) for kind, car in cars.items()}
    held = float(np.mean(within(distances_of(first), 0.95)))
    return {"vehicle": vehicle.number, "errors": errors, "within": held, "refused": refused, "attempts": found}


def text(rows: Sequence[dict[str, Any]]) -> str:
    """A row a model: completed runs, errors, and errors relative to the best of the cars identified on much data; a run
    that was not completed is infinitely far off."""
    runs = pd.DataFrame([
        {"vehicle": row["vehicle"], "model": name, **one} for row in rows for name, one in row["attempts"].items()
    ])  # fmt: skip
    completed = runs["outcome"] == "completed"
    errors = {key: runs[key].where(completed, np.inf) for key in ("rms_e", "rms_sideslip_error")}
    runs = runs.assign(completed=completed, **errors)
    of_kind = runs[runs["model"].isin(KINDS)]
    best = of_kind.loc[of_kind.groupby("vehicle")["rms_e"].idxmin()]
    runs = pd.concat([runs, best.assign(model="reference")])
    runs["ratio"] = runs["rms_e"] / runs["vehicle"].map(best.set_index("vehicle")["rms_e"])

    def cells(name: str) -> tuple[object, ...]:
        some = runs[runs["model"] == name]
        low, high = by_vehicle(some, "ratio", lambda values: float(np.median(values)))
        return (name, f"{some['completed'].sum()} of {len(some)}", f"{some['rms_e'].median():.3f}",
                f"{some['rms_sideslip_error'].median():.3f}", f"{some['ratio'].median():.2f} ({low:.2f} to {high:.2f})",
                f"{some['ratio'].max():.2f}")  # fmt: skip

    heads = ("the controller uses", "completed", "RMS e [m], median", "RMS sideslip error [rad]",
             "RMS e over the reference's, median (95 %)", "most")  # fmt: skip
    count = ", ".join(f"{kind} {number}" for kind, number in best["model"].value_counts().items())
    table = tabulated(heads, map(cells, [name for name in MODELS if (runs["model"] == name).any()]))
    within = sorted(row["within"] for row in rows)
    stated = f"{within[0]:.2f} to {within[-1]:.2f} of the first drift's samples are within the 95 % region stated"
    said = [f"Car {row['vehicle']}: the first drift is refused: {row['refused']}." for row in rows if row["refused"]]
    return "\n".join([*table, "", f"The reference is of the kind: {count}; {stated}.", *said])


def main(config: AgainConfig) -> None:
    """All cars."""
    folder = begun("again", config)
    rows = run_kept(config.run_on, attempts, config.cars(), lambda car: folder / f"{car.number:03d}.json", "car")
    write_report(folder, text(rows), config)


if __name__ == "__main__":
    run_command(main, AgainConfig, __doc__)
