"""Simulators of the user's calibrated and diagnosed on the days of `experiments.simulators.days`: a row for each.

    python -m experiments.simulators.judge runs/four_wheels runs/mujoco_car --out runs/judged

What is done is kept: start again to go on.
"""

import dataclasses
import json
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import tyro

from diagrams.command import run_command
from drift_drake.car.car_file import read_car, read_simulator_car
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.foreign.led_in import led_in
from drift_drake.car.foreign.pool import end_workers
from drift_drake.car.log.table import read_case
from drift_drake.common.run_folder import write_json, write_versions
from drift_drake.common.safe_files import write_text
from drift_drake.gap.estimation.usable import admit
from drift_drake.gap.estimation.windows import stride_of, thinned, windowed
from drift_drake.gap.identification.by_prediction import held_out_windows
from experiments.made import tabulated
from experiments.other_worlds.jobs import Ask, Calibrate, answer_of, ask, calibrate, done_once, failure_path
from experiments.other_worlds.scoring import Row, share

COLUMNS = ("simulator", "errors of the first guess's", "the true car's", "effects named", "none said",
           "strange faults: unknown", "wrongly sure", "intervals hold", "ms a roll-out", "s a calibration",
           "s a day")  # fmt: skip
FRESH = 400  # windows of the days without a change


@dataclasses.dataclass(frozen=True)
class Judge:
    """Worlds to judge."""

    worlds: Annotated[tuple[Path, ...], tyro.conf.Positional]
    """Folders of days."""
    out: Path
    """Run folder; one that exists is gone on with."""
    workers: int = 1
    """Days at once, each with processes of its own."""


def judged(world: Path, out: Path, workers: int) -> tuple[dict[str, Any], list[Row]]:
    """A world's calibration, and its days."""
    job = Calibrate((world / "day_one",), world / "start.yaml", out / world.name)
    done_once(workers, calibrate, [job], "calibration")
    labels = json.loads((world / "labels.json").read_text())
    days = [Ask(world / code, job.folder, job.folder / "answers" / f"{code}.json") for code in labels]
    done_once(workers, ask, days, "day")
    rows = [Row(world.name, world.name, code, label["effects"], answer_of(day.out), label["strange"],
                drives=label["drives"]) for (code, label), day in zip(labels.items(), days, strict=True)]  # fmt: skip
    found = json.loads((job.out if job.out.exists() else failure_path(job.out)).read_text())
    return found, rows


def fresh_errors(world: Path, calibrated: Path) -> tuple[float, float]:
    """Errors half a second ahead on the world's days without a change, of those of the first guess: the calibrated
    car's and the true car's, which sensors' noise alone leaves. Medians, their geometric mean over the states."""
    guess, _ = led_in(read_simulator_car(world / "start.yaml"))
    values = json.loads((world / "truth.json").read_text())["values"]
    start, (found, effects) = guess.constants(), read_car(calibrated)
    true = start._replace(values=tuple(values[name] for name in start.by_name()))
    labels = json.loads((world / "labels.json").read_text())
    unchanged = [code for code, label in labels.items() if not label["effects"] and not label["strange"]]
    runs, _, _ = admit([run for code in unchanged for run in read_case(world / code)], guess)
    windows = thinned([windowed(run, run.filled, stride_of(guess.single_track())) for run in runs], FRESH)
    ratios = [
        held_out_windows(windows, (start, Effects()), car).ratio
        for car in ((found.constants(), effects), (true, Effects()))
    ]
    end_workers()
    return ratios[0], ratios[1]


def said_share(flags: list[bool]) -> str:
    """Hits of how many, with the exact 95 % interval of the share."""
    s = share(flags)
    return f"{s['hits']} of {s['count']} ({s['low']:.2f} to {s['high']:.2f})" if s["count"] else "-"


def row_of(world: Path, out: Path, calibration: dict[str, Any], rows: list[Row]) -> list[str]:
    """A world as a row of the table."""
    if "held_out" not in calibration:
        return [world.name, calibration["message"]]
    calibrated, true = fresh_errors(world, out / world.name / "car.yaml")
    cost = [w.split(" takes ")[1].split(" for ")[0] for w in calibration["warnings"] if "for a roll-out" in w]
    seconds = [row.answer["seconds"] for row in rows if "seconds" in row.answer]
    return [
        world.name, f"{calibrated:.2f}", f"{true:.2f}", said_share([row.right for row in rows if row.effects]),
        said_share([row.right for row in rows if not row.effects and not row.strange]),
        said_share([row.right for row in rows if row.strange]),
        said_share([row.sure_alone for row in rows if row.strange]),
        said_share([held for row in rows for held in row.covered]), cost[0] if cost else "-",
        f"{calibration['seconds']:.0f}", f"{np.median(seconds):.0f}" if seconds else "-",
    ]  # fmt: skip


def main(config: Judge) -> None:
    """Judges all worlds."""
    worlds, every = [], list[Row]()
    config.out.mkdir(parents=True, exist_ok=True)
    for world in config.worlds:
        calibration, rows = judged(world, config.out, config.workers)
        worlds.append(row_of(world, config.out, calibration, rows))
        every += rows
    details = [(row.world, f"{row.case} ({row.drives})", row.strange or row.effects or "none",
                f"{row.said} {row.probability:.2f}", "right" if row.right else "wrong") for row in every]  # fmt: skip
    lines = tabulated(COLUMNS, worlds)
    text = "\n".join([*lines, "", *tabulated(("simulator", "day", "hidden", "said", ""), details)])
    write_text(config.out / "judged.md", text + "\n")
    write_json(config.out / "judged.json", [dataclasses.asdict(row) | {"right": row.right} for row in every])
    write_versions(config.out)
    print("\n".join(lines))


if __name__ == "__main__":
    run_command(main, Judge, __doc__)
