"""The pages by their addresses."""

from functools import partial
from typing import Any

from nicegui import ui

from drift_drake.app.jobs import Jobs
from drift_drake.app.pages.apply import apply_page
from drift_drake.app.pages.calibrate import calibrate_page
from drift_drake.app.pages.car import car_page
from drift_drake.app.pages.check import check_page
from drift_drake.app.pages.columns import columns_page
from drift_drake.app.pages.diagnose import diagnose_page
from drift_drake.app.pages.frame import STEPS, page
from drift_drake.app.pages.logs import logs_page
from drift_drake.app.project import Project
from drift_drake.app.recordings import Recordings


def add_pages(project: Project, readings: Recordings, jobs: Jobs) -> None:
    """Adds the pages to NiceGUI's app."""
    draws: dict[str, Any] = {
        "Logs": logs_page, "Columns": columns_page, "Car": car_page, "Check": check_page, "Calibrate": calibrate_page,
        "Diagnose": diagnose_page, "Apply": apply_page,
    }  # fmt: skip
    for step in STEPS:
        ui.page(step.path)(partial(_show, project, readings, jobs, step, draws[step.name]))


def _show(project: Project, readings: Recordings, jobs: Jobs, step: Any, draw: Any) -> None:
    page(project, jobs, step, partial(draw, project, readings, jobs))
