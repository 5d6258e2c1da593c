"""Cars that cannot be drifted, or hardly: what their informative drives and the rehearsal say of it beforehand.

    python -m experiments.drifting.rehearsed --out runs/rehearsed

Every fourth car has little torque, a slow steering (rate limit), little grip, or a late steering. After a check of its
steering each drives the lane twice; its car is identified and rehearsed (`gap.choose.rehearsal`). The truth is a
figure-8 of the real car under a controller that knows it. Broken off, the experiment goes on where it was (give --out).
"""

import dataclasses
import json
from typing import Any

import numpy as np
from tqdm import tqdm

from diagrams.command import run_command
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.log.cases import runs_of
from drift_drake.car.parameters import VehicleParameters
from drift_drake.common.run_folder import is_done, write_json
from drift_drake.drive.gathering.config import GatheringConfig
from drift_drake.drive.gathering.plan import Trajectory, plan_drive
from drift_drake.drive.learnt.checkpoint import BayesianModel, load_model
from drift_drake.drive.loop.closed_loop import ControlConfig
from drift_drake.gap.choose.choice import ask
from drift_drake.gap.choose.identified import IdentifiedCar
from drift_drake.gap.choose.rehearsal import HELD, rehearse
from experiments.benchmarks.vehicles import draw_effects
from experiments.drifting.runs import DriveJob, drive
from experiments.gathering.beliefs import informative_drives
from experiments.made import RunConfig, begun, tabulated, write_report

WORSE = {"torque_gain_error": (-0.8, -0.55), "steering_rate_limit": (0.15, 0.4), "friction_level": (-0.6, -0.4),
         "steering_lag": (0.4, 0.8)}  # fmt: skip
AS_PLANNED = "time"  # how a lane drive ends


@dataclasses.dataclass(frozen=True)
class RehearsedConfig(RunConfig):
    """How many cars."""

    vehicles: int = 20
    vehicle_seed: int = 0
    gathering: GatheringConfig = dataclasses.field(default_factory=GatheringConfig)


def true_effects(config: RehearsedConfig) -> list[tuple[str, Effects]]:
    """What makes each car a bad one, and all of its effects."""
    rng, out = np.random.default_rng(config.vehicle_seed), list[tuple[str, Effects]]()
    for i in range(config.vehicles):
        name = list(WORSE)[i % len(WORSE)]
        car = draw_effects("held_out", i, config.vehicle_seed)
        out.append((name, car._replace(**{name: float(rng.uniform(*WORSE[name]))})))
    return out


def row(
    name: str, effects: Effects, learnt: BayesianModel, first: Trajectory, gathering: GatheringConfig
) -> dict[str, Any]:
    """What is said of one car, and what is true."""
    driven = informative_drives(learnt, first, effects, gathering, 0)
    steering, tables = driven.config.steering, driven.tables
    car = ask(runs_of(tables), VehicleParameters(), steering=steering).found.car if tables else None
    if car is None and not steering.usual:  # all that is known of the car
        car = IdentifiedCar(VehicleParameters(), steering.effects)
    said = None if car is None else rehearse(car, VehicleParameters()).can
    farthest = max((float(table["e"].abs().max()) for table in tables), default=0.0)
    m = drive(DriveJob(name, {}, "figure_8", effects, 0, "oracle", ControlConfig())).metrics
    true = m["outcome"] == "completed" and m["drifting"] >= HELD
    return {"what": name, "magnitude": getattr(effects, name), "said": said, "true": true,
            "drives": [end for _, end in driven.logs], "farthest": farthest, "steering": steering}  # fmt: skip


def text(rows: list[dict[str, Any]], half_width: float) -> str:
    """Counts by what makes the car a bad one; half_width: of the lane [m]."""
    cells = []
    for name in WORSE:
        some = [r for r in rows if r["what"] == name]
        can, cannot = [r for r in some if r["true"]], [r for r in some if not r["true"]]
        left = sum(any(end != AS_PLANNED for end in r["drives"]) or r["farthest"] > half_width for r in some)
        cells.append((name, f"{sum(r['said'] is False for r in cannot)} of {len(cannot)}",
                      f"{sum(r['said'] is True for r in can)} of {len(can)}",
                      sum(r["said"] is None for r in some), f"{left} of {len(some)}"))  # fmt: skip
    heads = ("", "cannot: said so", "can: said so", "no car identified", "left the lane in a lane drive")
    return "\n".join(tabulated(heads, cells))


def main(config: RehearsedConfig) -> None:
    """All cars."""
    folder, rows, learnt = begun("rehearsed", config), list[dict[str, Any]](), load_model()
    first = plan_drive(learnt, learnt.prior(), config.gathering, config.gathering.alpha)
    for i, (name, effects) in enumerate(tqdm(true_effects(config), unit="car")):
        path = folder / f"{i:03d}.json"
        if not is_done(path):
            write_json(path, row(name, effects, learnt, first, config.gathering))
        rows.append(json.loads(path.read_text()))
    write_report(folder, text(rows, config.gathering.half_width), config)


if __name__ == "__main__":
    run_command(main, RehearsedConfig, __doc__)
