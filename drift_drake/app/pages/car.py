"""Car: a first guess of it as a form, from a template, or a vehicle file of the folder."""

import dataclasses
from functools import partial
from pathlib import Path
from typing import Any

from nicegui import ui

from drift_drake.app import stages
from drift_drake.app.jobs import Jobs
from drift_drake.app.pages.parts import box, button, choice, field, next_step, number, section, text
from drift_drake.app.project import CALIBRATED, CAR, FILE, Project
from drift_drake.app.recordings import Recordings
from drift_drake.car.effects.magnitudes import magnitudes_of
from drift_drake.car.parameters import WORDS, Tolerance, VehicleParameters
from drift_drake.car.templates import TEMPLATES
from drift_drake.car.vehicle_file import SIZES, check_plausible, ratios, read_vehicle, write_vehicle
from drift_drake.common.errors import DriftDrakeError, significant

UNITS = {"front_axle_distance": "m", "steering_offset": "rad"}  # of tolerances that are not relative
OWN = "described below"


def car_page(project: Project, _readings: Recordings, _jobs: Jobs, data: dict[str, Any]) -> None:
    """The page's content."""
    with section("Which car"):
        files = {CAR: f"{CAR}, {OWN}", **{name: name for name in _vehicle_files(project)}}
        choice("First guess", files, stages.first_guess(data), partial(project.set_option, "vehicle"))
        text("p", "A vehicle file of the folder, or a simulator.yaml of your own simulator, is taken as it is.", "note")
    if stages.first_guess(data) != CAR:
        next_step("Check")
        return
    path = project.folder / CAR
    if not path.exists():
        with section("Begin with"), box("div", "run"):
            for name, vehicle in TEMPLATES.items():
                button(name[0].upper() + name[1:], partial(write_vehicle, path, vehicle), "main")
        text("p", "Weigh and measure what you can: what the logs cannot show stays as it is here.", "note")
        return
    try:
        vehicle, effects = read_vehicle(path)
    except DriftDrakeError as error:
        text("p", str(error), "refusal", role="alert")
        return
    _form(path, vehicle, effects)
    with section("Begin anew"), box("div", "run"):
        for name, other in TEMPLATES.items():
            button(
                name[0].upper() + name[1:], partial(write_vehicle, path, other), label=f"Take the {name} in its place"
            )
    next_step("Check")


def _form(path: Path, vehicle: VehicleParameters, effects: Any) -> None:
    """A field a number, each with the range that any vehicle's lies in, and its tolerance."""
    said = box("div", role="status")

    def change(name: str, words: str) -> None:
        _changed(path, said, lambda car: car.replace(**{name: number(words)}))

    def know(name: str, words: str) -> None:
        _changed(
            path, said, lambda car: car.replace(tolerance=dataclasses.replace(car.tolerance, **{name: number(words)}))
        )

    with section("Parameters"):
        text("p", "SI units; the range is that of all vehicles of such a size.", "note")
        with box("div", "form"):
            for one in dataclasses.fields(vehicle):
                if one.name not in WORDS:
                    with box("div"):
                        field(one.name, float(getattr(vehicle, one.name)), partial(change, one.name),
                              unit=one.metadata["unit"])  # fmt: skip
                        text("p", _range(one.name, vehicle), "note")
    with section("What is known of them"):
        text("p", "One standard deviation: relative, but for those with a unit. The calibration believes twice as "
             "much; a difference of this size is no gap.", "note")  # fmt: skip
        with box("div", "form"):
            for known in dataclasses.fields(Tolerance):
                unit = UNITS.get(known.name, "")
                field(f"tolerance of {known.name}", float(getattr(vehicle.tolerance, known.name)),
                      partial(know, known.name), unit=unit)  # fmt: skip
    if magnitudes := magnitudes_of(effects):
        text("p", f"Effects that the file has in addition: {', '.join(magnitudes)}.", "note")


def _changed(path: Path, said: Any, change: Any) -> None:
    """Writes the file with one number changed, or says why not."""
    said.clear()
    try:
        vehicle, effects = read_vehicle(path)
        car = change(vehicle)
        check_plausible(car, CAR)
        write_vehicle(path, car, effects)
    except (DriftDrakeError, TypeError) as error:
        words = str(error) if isinstance(error, DriftDrakeError) else "give a number"
        with said:
            text("p", f"Not taken: {words}.", "refusal", role="alert")
        ui.notify(words, type="negative")


def _range(name: str, vehicle: VehicleParameters) -> str:
    if name in SIZES:
        low, high = SIZES[name]
    elif (ratio := ratios(vehicle).get(name)) is not None and ratio[0]:
        low, high = (getattr(vehicle, name) / ratio[0] * end for end in ratio[1:3])
        if name in ("torque_min", "torque_max"):
            return f"up to {significant(abs(high), 2)}"
    else:
        return ""
    return f"{significant(low, 2)} to {significant(high, 2)}"


def _vehicle_files(project: Project) -> list[str]:
    """YAML files of the folder that may be vehicle files."""
    own, found = {CAR, CALIBRATED, FILE}, project.folder.glob("*.y*ml")
    return sorted(path.name for path in found if path.name not in own and path.name[:7] != "mapping" and path.is_file())
