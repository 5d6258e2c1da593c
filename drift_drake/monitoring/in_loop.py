"""The monitor in a closed loop's diagram: its wires, what is logged of it, and the events of a run."""

from collections.abc import Iterator, Sequence
from typing import Any, Literal, NamedTuple

import numpy as np
import pandas as pd
from pydrake.systems.framework import DiagramBuilder, OutputPort

from drift_drake.control.effects_step import EffectsStepModel
from drift_drake.monitoring.correction import GapCorrection
from drift_drake.monitoring.events import Events
from drift_drake.monitoring.gap_monitor import GapMonitor
from drift_drake.monitoring.monitor import Monitor
from drift_drake.monitoring.slow_down import SlowDown
from drift_drake.vehicle.step_model import StepModel

PREFIX = "gap_"  # of a run's columns: probabilities by name, and the leading effect's magnitude and onset
FURTHER = ("magnitude", "low", "high")


Policy = Literal["watch", "correct", "slow", "correct_or_slow", "forget"]
"""What follows from a gap: nothing; what is named is corrected; the car is slowed down; slow until it is corrected; an
adapter forgets."""
CORRECTING: tuple[Policy, ...] = ("correct", "correct_or_slow")
SLOWING: tuple[Policy, ...] = ("slow", "correct_or_slow")


class Watched(NamedTuple):
    """What the monitor adds to a loop."""

    monitor: GapMonitor | None
    measured_state: OutputPort  # for the controller
    effects: OutputPort | None = None  # for its model
    correction: OutputPort | None = None
    trusted: OutputPort | None = None  # for an adapter that forgets


def watching(
    builder: DiagramBuilder, monitor: Monitor | None, measured_state: OutputPort, command: OutputPort,
    log_row: OutputPort, policy: Policy, model: StepModel | None,
) -> Watched:  # fmt: skip
    """Adds the monitor, if there is one, and by the policy the correction of a controller's model.

    Raises:
        ValueError: a policy without a monitor, or a correction of a model that takes none.
    """
    if policy != "watch" and monitor is None:
        raise ValueError(f"the policy {policy} needs a monitor")
    if policy in CORRECTING and not isinstance(model, EffectsStepModel):
        raise ValueError("a correction needs an EffectsStepModel, which takes it")
    if monitor is None:
        return Watched(None, measured_state)
    system = builder.AddNamedSystem("monitor", GapMonitor(monitor))
    for name, port in (("measured_state", measured_state), ("command", command), ("log_row", log_row)):
        builder.Connect(port, system.GetInputPort(name))
    if policy not in CORRECTING:
        trusted = system.GetOutputPort("trusted") if policy == "forget" else None
        return Watched(system, measured_state, trusted=trusted)
    correction = builder.AddNamedSystem("correction", GapCorrection(monitor))
    for name in ("posterior", "magnitude"):
        builder.Connect(system.GetOutputPort(name), correction.GetInputPort(name))
    builder.Connect(measured_state, correction.GetInputPort("measured_state"))
    return Watched(system, *(correction.GetOutputPort(name) for name in ("corrected_state", "effects", "correction")))


def slowing(
    builder: DiagramBuilder, system: SlowDown, watched: Watched, plan: OutputPort, measured_state: OutputPort,
    command: OutputPort, reading: OutputPort | None,
) -> OutputPort:  # fmt: skip
    """Adds the slow-down to a diagram with a monitor; the plan that is to be followed."""
    assert watched.monitor is not None
    builder.AddNamedSystem("slow_down", system)
    ports = {"plan": plan, "state": measured_state, "command": command, "correction": watched.correction,
             "reading": reading,
             "posterior": watched.monitor.GetOutputPort("posterior")}  # fmt: skip
    for name, port in ports.items():
        if port is not None:
            builder.Connect(port, system.GetInputPort(name))
    return system.GetOutputPort("paced_plan")


def logged_ports(system: GapMonitor) -> dict[str, tuple[OutputPort, Sequence[str]]]:
    """Ports and columns of a run's table."""
    return {
        "gap_posterior": (system.GetOutputPort("posterior"), [f"{PREFIX}{name}" for name in system.monitor.labels]),
        "gap_magnitude": (system.GetOutputPort("magnitude"), [f"{PREFIX}{name}" for name in FURTHER]),
        "gap_onset": (system.GetOutputPort("onset"), [f"{PREFIX}onset"]),
    }


def verdicts_of(monitor: Monitor, table: pd.DataFrame) -> Iterator[tuple[float, np.ndarray, list[dict[str, Any]]]]:
    """The monitor's verdicts during a run, from its table: times [s], verdicts (`monitor.State`), and their events."""
    columns = [f"{PREFIX}{name}" for name in (*monitor.labels, *FURTHER, "onset")]
    rows = table[columns].to_numpy()
    new = np.flatnonzero(np.any(np.diff(rows[:, : len(monitor.labels)], axis=0) != 0.0, axis=1)) + 1
    reported = Events()
    for i in new:
        reported, events = reported.after(monitor, rows[i], float(table["t"].iloc[i]))
        yield float(table["t"].iloc[i]), rows[i], events


def events_of(monitor: Monitor, table: pd.DataFrame) -> list[dict[str, Any]]:
    """The events of a run, from its table."""
    return [event for _, _, events in verdicts_of(monitor, table) for event in events]
