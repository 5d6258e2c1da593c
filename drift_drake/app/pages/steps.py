"""The pages by their addresses."""

import importlib
from functools import partial

from nicegui import ui

from drift_drake.app.jobs import Jobs
from drift_drake.app.pages.frame import STEPS, Step, page
from drift_drake.app.project import Project
from drift_drake.app.recordings import Recordings


def add_pages(project: Project, readings: Recordings, jobs: Jobs) -> None:
    """Adds the pages to NiceGUI's app."""
    for step in STEPS:
        ui.page(step.path)(partial(_show, project, readings, jobs, step))


def _show(project: Project, readings: Recordings, jobs: Jobs, step: Step) -> None:
    name = step.name.lower()
    module = importlib.import_module(f"drift_drake.app.pages.{name}")  # once asked for: the workbench opens before
    page(project, jobs, step, partial(getattr(module, f"{name}_page"), project, readings, jobs))
