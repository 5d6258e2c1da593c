"""The monitor in a closed loop's diagram: its wires, what is logged of it, and the events of a run."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from pydrake.systems.framework import DiagramBuilder, OutputPort

from drift_drake.control.effects_step import EffectsStepModel
from drift_drake.control.step_model import StepModel
from drift_drake.monitoring.correction import GapCorrection
from drift_drake.monitoring.events import Events
from drift_drake.monitoring.gap_monitor import GapMonitor
from drift_drake.monitoring.monitor import Monitor

PREFIX = "gap_"  # of a run's columns: probabilities by name, and the leading effect's magnitude and onset
FURTHER = ("magnitude", "low", "high")


def watching(
    builder: DiagramBuilder, monitor: Monitor | None, measured_state: OutputPort, command: OutputPort,
    log_row: OutputPort, correct: bool, model: StepModel | None,
) -> tuple[GapMonitor | None, OutputPort, OutputPort | None]:  # fmt: skip
    """Adds the monitor, if there is one, and where it is asked for the correction of a controller's model.

    Returns:
        (the monitor, the measured state for the controller, the effects for its model).

    Raises:
        ValueError: a correction without a monitor, or of a model that takes none.
    """
    if correct and (monitor is None or not isinstance(model, EffectsStepModel)):
        raise ValueError("a correction needs a monitor, and an EffectsStepModel that takes it")
    if monitor is None:
        return None, measured_state, None
    system = builder.AddNamedSystem("monitor", GapMonitor(monitor))
    for name, port in (("measured_state", measured_state), ("command", command), ("log_row", log_row)):
        builder.Connect(port, system.GetInputPort(name))
    if not correct:
        return system, measured_state, None
    correction = builder.AddNamedSystem("correction", GapCorrection(monitor))
    for name in ("posterior", "magnitude"):
        builder.Connect(system.GetOutputPort(name), correction.GetInputPort(name))
    builder.Connect(measured_state, correction.GetInputPort("measured_state"))
    return system, correction.GetOutputPort("corrected_state"), correction.GetOutputPort("effects")


def logged_ports(system: GapMonitor) -> dict[str, tuple[OutputPort, Sequence[str]]]:
    """Ports and columns of a run's table."""
    return {
        "gap_posterior": (system.GetOutputPort("posterior"), [f"{PREFIX}{name}" for name in system.monitor.labels]),
        "gap_magnitude": (system.GetOutputPort("magnitude"), [f"{PREFIX}{name}" for name in FURTHER]),
        "gap_onset": (system.GetOutputPort("onset"), [f"{PREFIX}onset"]),
    }


def events_of(monitor: Monitor, table: pd.DataFrame) -> list[dict[str, Any]]:
    """The events of a run, from its table."""
    columns = [f"{PREFIX}{name}" for name in (*monitor.labels, *FURTHER, "onset")]
    rows = table[columns].to_numpy()
    new = np.flatnonzero(np.any(np.diff(rows[:, : len(monitor.labels)], axis=0) != 0.0, axis=1)) + 1
    reported, out = Events(), list[dict[str, Any]]()
    for i in new:
        reported, events = reported.after(monitor, rows[i], float(table["t"].iloc[i]))
        out += events
    return out
