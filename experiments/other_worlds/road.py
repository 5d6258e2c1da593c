"""The whole road on cars that no single-track model follows: calibrated on day one, all other days diagnosed, scored.

    python -m experiments.other_worlds.road WORLD ... --out runs/road

A WORLD is a folder as `make_worlds` and `days` write it: day_one/run_*.csv, CODE/run_*.csv, start.yaml, and
labels.json, which is read once all answers are there. Worlds of other makers may have several folders day_one*, of
which `--baseline` names the one to calibrate on. What is done is kept: start again to go on.
"""

import dataclasses
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import tyro

from diagrams.command import run_command
from drift_drake.car.log.table import run_paths
from drift_drake.common.errors import DriftDrakeError
from drift_drake.common.run_folder import write_json
from drift_drake.common.safe_files import write_text
from drift_drake.gap.identification.options import Criterion
from drift_drake.view.style import save
from experiments.made import RunConfig, begun, made
from experiments.other_worlds.calibrations import calibration_row, calibration_scores, calibrations_text
from experiments.other_worlds.jobs import Ask, Calibrate, answer_of, ask, calibrate, done_once
from experiments.other_worlds.pictures import draw_rows
from experiments.other_worlds.scoring import Row, all_scores, scores_text

DAY_ONE = "day_one"


@dataclasses.dataclass(frozen=True)
class Worlds(RunConfig):
    """Folders of days, and which of them to calibrate on."""

    worlds: Annotated[tuple[Path, ...], tyro.conf.Positional]
    """Folders of days."""
    baseline: str = DAY_ONE
    """Folder of each world to calibrate on."""


@dataclasses.dataclass(frozen=True)
class Road(Worlds):
    """Calibrate on day one, diagnose the other days, score."""

    workers: int = 2
    """Processes."""
    criterion: Criterion = "auto"
    """Of the calibration, as `drift-drake identify` takes it."""


class InvalidWorldError(DriftDrakeError, ValueError):
    """A folder that is no world; the message names it and the remedy."""


def checked(world: Path, baseline: str = DAY_ONE) -> Path:
    """The folder, if it is a world with runs to calibrate on.

    Raises:
        InvalidWorldError: a part is missing.
    """
    for part in ("start.yaml", "labels.json"):
        if not (world / part).is_file():
            raise InvalidWorldError(
                f"{world}: has no {part}; make it with 'python -m experiments.other_worlds.make_worlds'"
            )
    if not run_paths(world / baseline):
        raise InvalidWorldError(f"{world / baseline}: holds no runs; a world is calibrated on them")
    return world


def days_of(world: Path) -> list[str]:
    """Codes of the days but those to calibrate on."""
    return sorted(d.name for d in world.iterdir() if d.is_dir() and not d.name.startswith(DAY_ONE) and run_paths(d))


def car_of(world: Path) -> str:
    """The car's name, as the world's maker wrote it; the folder's without."""
    config = world / "config.json"
    return str(json.loads(config.read_text())["car"]) if config.is_file() else world.name


def rows_of(name: str, world: Path, folder: Path) -> list[Row]:
    """The answers of one world, by its labels; days without a label are left out.

    Args:
        name: of the world in the run folder `folder`.
    """
    labels, out = json.loads((world / "labels.json").read_text()), []
    for code in days_of(world):
        if code in labels:
            label, answer = labels[code], answer_of(folder / name / f"{code}.json")
            out.append(Row(name, car_of(world), code, label["effects"], answer, label.get("strange"),
                           bool(label.get("within_tolerances")), label.get("drives", "")))  # fmt: skip
    return out


def score(worlds: Mapping[str, Path], cars: list[Calibrate], folder: Path) -> dict[str, Any]:
    """Opens the labels, scores all answers and writes scores.json, scores.md and said.png."""
    rows = [row for name, world in worlds.items() for row in rows_of(name, world, folder)]
    calibrations = {job.folder.name: calibration_row(job, own_figures=True) for job in cars}
    over_all = calibration_scores(list(calibrations.values()))
    result = all_scores(rows) | {"calibration": over_all, "calibrations": calibrations}
    write_json(folder / "scores.json", result)
    (folder / "scores.md").write_text(scores_text(result) + "\n" + calibrations_text(over_all, calibrations))
    save(draw_rows(rows), folder / "said.png")
    return result


def worlds_by_name(worlds: Sequence[Path], baseline: str) -> dict[str, Path]:
    """Checked folders by their names, which tell answers apart.

    Raises:
        InvalidWorldError: there is none, one is no world, or two have the same name.
    """
    if not worlds:
        raise InvalidWorldError(
            "no worlds; make some with 'python -m experiments.other_worlds.make_worlds', and give their folders"
        )
    out = {world.resolve().name: checked(world, baseline) for world in worlds}
    if len(out) < len(worlds):
        raise InvalidWorldError("two worlds have the same name; rename one folder")
    return out


def answered(worlds: Mapping[str, Path], cars: Sequence[Calibrate], folder: Path, workers: int) -> None:
    """Calibrates what is not calibrated and diagnoses what is not diagnosed, into the run folder.

    Args:
        cars: in the order of the worlds, each into a folder of its world's name.
    """
    done_once(workers, calibrate, cars, "car")
    asks = [Ask(world / code, folder / name, folder / name / f"{code}.json")
            for name, world in worlds.items() for code in days_of(world)]  # fmt: skip
    done_once(workers, ask, asks, "day")


def main(config: Road) -> None:
    """Everything."""
    worlds = worlds_by_name(config.worlds, config.baseline)
    folder = begun("road", config)
    cars = [Calibrate((world / config.baseline,), world / "start.yaml", folder / name, config.criterion)
            for name, world in worlds.items()]  # fmt: skip
    answered(worlds, cars, folder, config.workers)
    score(worlds, cars, folder)
    text = f"{(folder / 'scores.md').read_text()}\n{made(config)}\n"
    write_text(folder / "scores.md", text)
    print(text)


if __name__ == "__main__":
    run_command(main, Road, __doc__)
