"""The demo's page: one HTML file with tables, pictures and 3D replays in it, which loads nothing from elsewhere."""

import base64
import gzip
import io
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pandas as pd
from markupsafe import Markup
from matplotlib.figure import Figure

from diagrams.replay import side_by_side
from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.car.log.table import read_case
from drift_drake.car.parameters import VehicleParameters
from drift_drake.common.run_folder import machine
from drift_drake.common.safe_files import write_text
from drift_drake.drive.reference.trajectory import figure_8
from drift_drake.gap.diagnosis.answers.apply import corrected_vehicle
from drift_drake.gap.diagnosis.likelihood.diagnose import Diagnosis
from drift_drake.view.pages.policy import with_policy
from drift_drake.view.pages.templates import templates
from drift_drake.view.pictures.overhead import overhead
from drift_drake.view.pictures.replay import replay
from drift_drake.view.pictures.time_series import time_series
from drift_drake.view.playback.play import UNITS, Comparison, compare, drawn
from drift_drake.view.playback.side_by_side import CarModel, SideBySide
from drift_drake.view.style import colours_of
from experiments.benchmarks.vehicles import draw_effects
from experiments.drifting.report import LABELS
from experiments.gathering.recipe import lane_for_pictures

TEMPLATE = Path(__file__).parent / "demo.html"
RESOLUTION, FINE = 140, 240  # [dots per inch], of narrow pictures
NARROW = 2.8  # [in] of pictures whose letters are then 11 px high or more on a phone, 390 px wide
RESTART = 1.0  # [s] between restarts of the replayed log's cars
NAMES = LABELS | {"online": "online"}
BELIEVES = {
    "nominal": "the vehicle file",
    "prior": "the learnt model, not adapted",
    "once_ocp": "adapted to one drive planned by the OCP",
    "once_info": "adapted to one drive planned by Info-OCP",
    "twice_info": "adapted to two drives planned by Info-OCP",
    "online": "the prior, adapting while it drifts",
    "oracle": "the true car, effects and all",
}
COMPARED = ("nominal", "twice_info", "oracle")  # over the path: more lines could not be distinguished


def picture(figure: Figure, resolution: float = RESOLUTION) -> Markup:
    """A figure as an image element that holds its own pixels."""
    out = io.BytesIO()
    figure.savefig(out, format="png", dpi=resolution, bbox_inches="tight", pad_inches=0.05)
    return Markup(f'<img alt="" src="data:image/png;base64,{base64.b64encode(out.getvalue()).decode()}">')


def written(write: Callable[[Path], Any]) -> str:
    """The page that a function writes into a file."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "replay.html"
        write(path)
        return path.read_text(encoding="utf-8")


def embedded(page: str) -> str:
    """A page, compressed, as base64."""
    return base64.b64encode(gzip.compress(page.encode())).decode()


def replayed_log(diagnosis: Diagnosis, log: Path) -> tuple[str, Comparison, dict[str, pd.DataFrame]]:
    """The run with the largest gap, with the nominal and the corrected car: its name, errors and tables."""
    vehicle, answer = VehicleParameters(), diagnosis.answer
    shares = answer.where["runs"]
    run = max(read_case(log), key=lambda run: float(shares.get(run.name, 0.0)))
    cars = {"nominal": CarModel(vehicle), "corrected": CarModel(*corrected_vehicle(vehicle, answer))}
    played = SideBySide(run, cars).run(RESTART)
    return run.name, compare(played), drawn(played)


def hidden(truth: Mapping[str, Any], diagnosis: Diagnosis) -> list[dict[str, Any]]:
    """What the log hides, and what was answered, effect by effect."""
    answer = diagnosis.answer
    names = sorted({*truth["effects"], *answer.causes})
    return [
        {"name": name, "unit": CATALOGUE[name].unit, "true": truth["effects"].get(name),
         "answered": answer.magnitudes.get(name)}
        for name in names
    ]  # fmt: skip


def write_page(
    folder: Path, config: Any, numbers: Mapping[str, Any], rounds: Mapping[str, Any], runs: Mapping[Any, Any],
    diagnosis: Diagnosis, seconds: float,
) -> Path:  # fmt: skip
    """Writes index.html.

    Args:
        config: `DemoConfig`; numbers: as they go to numbers.json; rounds: `Gathered`, runs: `DriveResult`, by model;
        seconds: that all has taken so far.
    """
    parameters, settings = VehicleParameters(), config.gathering
    eight = figure_8(parameters)
    effects = draw_effects("held_out", config.vehicle, 0)._asdict()
    gathered = {NAMES[name]: _driven(one.table) for name, one in rounds.items()}
    drifts = {kind: run.table for kind, run in runs.items()}
    tables = {NAMES[kind]: table for kind, table in drifts.items()}
    compared = {NAMES[kind]: drifts[kind] for kind in COMPARED}
    name, errors, replayed = replayed_log(diagnosis, config.log)
    replays = [
        written(lambda path: replay(tables, path, eight, parameters, "The figure-8, seven times")),
        written(lambda path: replay(replayed, path, parameters=parameters, title=name, camera="follow",
                                    note=f"Simulated cars start from the real one every {RESTART:g} s.")),
    ]  # fmt: skip
    page = templates(TEMPLATE.parent).get_template(TEMPLATE.name).render(
        config=config,
        numbers=numbers,
        names=NAMES,
        believes=BELIEVES,
        catalogue=CATALOGUE,
        effects={name: value for name, value in effects.items() if value != 0.0},
        rounds=rounds,
        gathered=picture(
            overhead(gathered, lane_for_pictures(settings, gathered.values()), parameters, 0.9, NARROW), FINE
        ),
        map=picture(overhead(tables, eight, parameters, 0.0, NARROW), FINE),
        colours=dict(zip(tables, colours_of(tables), strict=True)),
        over_path=picture(time_series(compared, eight, parameters)),
        drift_replay=embedded(replays[0]),
        answer=diagnosis.answer,
        posterior=[(name.replace("+", " + "), p) for name, p in list(diagnosis.answer.posterior.items())[:8]],
        log_name=name,
        errors=errors,
        units=UNITS,
        restart=RESTART,
        replayed=picture(side_by_side(replayed)),
        log_replay=embedded(replays[1]),
        hidden=hidden(numbers["truth"], diagnosis),
        machine=machine(),
        seconds=seconds,
    )  # fmt: skip
    write_text(folder / "index.html", with_policy(page, replays))
    return folder / "index.html"


def _driven(table: pd.DataFrame) -> pd.DataFrame:
    """A drive's log as pictures want it."""
    return table.rename(columns={"delta_cmd": "delta", "tau_cmd": "tau"})
