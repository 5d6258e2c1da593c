"""Every system of every diagram that the package and `diagrams/` build has a name that a person chose."""

import importlib
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydrake.systems.framework import Diagram, DiagramBuilder, System
from pydrake.systems.primitives import MatrixGain

from diagrams.adaptation_replay import AdaptationReplay
from drift_drake.car.effects.magnitudes import Effects, make_effects
from drift_drake.car.log.table import Run
from drift_drake.car.parameters import VehicleParameters
from drift_drake.car.single_track.effects_step import EffectsStepModel
from drift_drake.car.step_model import NominalStepModel
from drift_drake.drive.learnt.adapter import BayesianAdapter
from drift_drake.drive.learnt.checkpoint import load_model
from drift_drake.drive.learnt.lag_bank import BANK
from drift_drake.drive.learnt.quality import step_model
from drift_drake.drive.loop.closed_loop import ClosedLoop, ControlConfig
from drift_drake.drive.loop.drive import Drive
from drift_drake.drive.loop.faults import ACTUATOR_KINDS, PLAN_KINDS, SENSOR_KINDS, SOLVER_KINDS, Fault
from drift_drake.drive.manoeuvres.drivers import ROW_PERIOD
from drift_drake.drive.reference.equilibrium import drift_equilibrium
from drift_drake.drive.reference.trajectory import Reference, straight_line
from drift_drake.gap.monitoring.in_loop import GapWatch
from drift_drake.gap.monitoring.monitor import make_monitor
from drift_drake.gap.monitoring.watch import WATCHED
from drift_drake.view.playback.side_by_side import CarModel, SideBySide
from experiments.benchmarks.drake_cases import drake_case
from experiments.benchmarks.drifters import HoldDriver
from experiments.benchmarks.truths import Truth

ROOT = Path(__file__).parents[2]
CAR = VehicleParameters()
LATE = make_effects({"steering_delay": 0.03, "command_clock_error": -0.02, "sensor_latency": 0.02, "aero_drag": 1.0})
KINDS = SENSOR_KINDS | PLAN_KINDS | SOLVER_KINDS | ACTUATOR_KINDS


def modules_that_build() -> list[str]:
    """Modules of the package and of `diagrams/` that make a `DiagramBuilder`."""
    files = [*(ROOT / "drift_drake").rglob("*.py"), *(ROOT / "diagrams").glob("*.py")]
    found = [path for path in files if "DiagramBuilder()" in path.read_text(encoding="utf-8")]
    return sorted(".".join(path.relative_to(ROOT).with_suffix("").parts) for path in found)


@pytest.fixture
def built(monkeypatch: pytest.MonkeyPatch) -> dict[str, list[Diagram]]:
    """Diagrams by the module that builds them, as they are built."""
    diagrams: dict[str, list[Diagram]] = {}
    for name in modules_that_build():

        class Recording(DiagramBuilder):  # type: ignore[misc]
            def Build(self, name: str = name) -> Diagram:  # noqa: N802
                diagrams.setdefault(name, []).append(DiagramBuilder.Build(self))
                return diagrams[name][-1]

            def BuildInto(self, target: Diagram, name: str = name) -> None:  # noqa: N802
                DiagramBuilder.BuildInto(self, target)
                diagrams.setdefault(name, []).append(target)

        monkeypatch.setattr(importlib.import_module(name), "DiagramBuilder", Recording)
    return diagrams


def systems(diagram: Diagram, path: str = "") -> Iterator[tuple[str, System]]:
    """All systems in a diagram, at any depth, with the names on the way to each."""
    for system in diagram.GetSystems():
        here = f"{path}{system.get_name()}"
        yield here, system
        if isinstance(system, Diagram):
            yield from systems(system, f"{here} / ")


def unnamed(diagram: Diagram) -> list[str]:
    """Systems that bear Drake's own name, of type and address, or none."""
    named = [(diagram.get_name(), diagram), *systems(diagram)]
    return [where for where, system in named if not re.fullmatch(r"[a-z][a-z0-9_]*", system.get_name())]


def loops(lane: Reference) -> Iterator[ClosedLoop]:
    """Closed loops that together have every part that there is."""
    learnt = load_model()

    def adapting() -> dict[str, Any]:
        return {"model": step_model(learnt, learnt.prior()), "adapter": BayesianAdapter(learnt, lags=BANK)}

    monitor, faults = make_monitor(CAR, used=WATCHED), [Fault(kind, 1.0, 0.1, KINDS[kind]) for kind in KINDS]
    narrow, nominal = ControlConfig(horizon=4, tightening=1.0), NominalStepModel(CAR)
    yield ClosedLoop(CAR, lane, nominal, LATE, faults=faults, watch=GapWatch(monitor), sensor_errors=LATE)
    yield ClosedLoop(CAR, lane, control=narrow, **adapting())
    yield ClosedLoop(CAR, lane, watch=GapWatch(monitor, "forget"), **adapting())
    yield ClosedLoop(CAR, lane, EffectsStepModel(CAR, Effects()), watch=GapWatch(monitor, "correct_or_slow"))
    for size in (6, 7):  # of what a controller of one's own is given
        yield ClosedLoop(CAR, lane, controller=MatrixGain(np.zeros((2, size))))


def test_every_system_of_every_diagram_has_a_name_of_its_own(built: dict[str, list[Diagram]]) -> None:
    made = [*loops(straight_line(v_start=12.0, v_end=15.0, duration=2.0))]
    driver = HoldDriver(CAR, drift_equilibrium(CAR, 18.0, -0.6), np.zeros((2, 2)))
    made.append(Drive(CAR, driver, 1, ROW_PERIOD, np.zeros((3, 2)), driver.initial_command(), LATE))
    t = 0.01 * np.arange(51)
    run = Run("run", t, r=0.1 + 0.0 * t, v=12.0 + t, beta=0.0 * t, omega_r=12.0 + t, delta_cmd=0.02 + 0.0 * t,
              tau_cmd=50.0 + 0.0 * t, bank=0.0 * t)  # fmt: skip
    made.append(AdaptationReplay(run, load_model()))
    for log in (run, run.without("tau_cmd"), run.without("tau_cmd").without("omega_r")):
        made.append(SideBySide(log, {"nominal": CarModel(CAR), "corrected": CarModel(CAR, LATE)}))
    rng = np.random.default_rng(0)
    for truth in (Truth({}), Truth({}, strange={"slippery_patch": 0.2})):
        drake_case(truth, CAR, rng, duration=0.05)
    assert sorted(built) == modules_that_build()
    assert {where for diagrams in built.values() for diagram in diagrams for where in unnamed(diagram)} == set()


def test_a_name_that_nobody_chose_is_found() -> None:
    builder = DiagramBuilder()
    builder.AddSystem(MatrixGain(np.eye(2)))
    builder.AddNamedSystem("gain", MatrixGain(np.eye(2)))
    diagram = builder.Build()
    diagram.set_name("test")
    assert len(unnamed(diagram)) == 1
