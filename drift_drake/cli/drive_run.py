"""The closed loop as a command: what to drive with which model, and what a run leaves behind."""

import contextlib
import dataclasses
import json
import shlex
from pathlib import Path
from typing import Any, Literal, NamedTuple, TextIO

import numpy as np
import pandas as pd
from pydrake.systems.framework import Context

from drift_drake.car.car_file import read_plant
from drift_drake.car.double_track.parameters import CARS
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.known_car import known_car_model, plant_of_car
from drift_drake.car.log.cases import only_run
from drift_drake.car.log.table import COLUMNS
from drift_drake.car.parameters import CarParameters, VehicleParameters
from drift_drake.car.sensor_errors import sensor_errors
from drift_drake.car.single_track.effects_step import EffectsStepModel
from drift_drake.car.step_model import NominalStepModel, StepModel
from drift_drake.cli.drive import DriveOptions
from drift_drake.common.errors import InvalidOptionError
from drift_drake.common.run_folder import make_run_folder, write_json, write_versions
from drift_drake.common.safe_files import write_figure, write_table, write_text
from drift_drake.drive.learnt.adapter import OFFSET_TIMES, BayesianAdapter
from drift_drake.drive.learnt.checkpoint import load_model, load_varied
from drift_drake.drive.learnt.lag_bank import BANK
from drift_drake.drive.learnt.quality import step_model
from drift_drake.drive.loop.closed_loop import ClosedLoop, ClosedLoopRun, ControlConfig
from drift_drake.drive.loop.earlier_drive import HELD, beliefs_after
from drift_drake.drive.loop.endings import RunLimits
from drift_drake.drive.loop.faults import parse_fault
from drift_drake.drive.loop.metrics import RunMetrics
from drift_drake.drive.reference.chain import NoTransitionError
from drift_drake.drive.reference.equilibrium import NoEquilibriumError
from drift_drake.drive.reference.similarity import similarity, time_step
from drift_drake.drive.reference.trajectory import Reference, figure_8, loops
from drift_drake.gap.monitoring.events import sentence
from drift_drake.gap.monitoring.in_loop import CORRECTING, GapWatch, verdicts_of
from drift_drake.gap.monitoring.monitor import make_monitor
from drift_drake.gap.monitoring.watch import WATCHED
from drift_drake.gap.watching.live_page import shown_while
from drift_drake.view.pictures.graph import draw_graph
from drift_drake.view.pictures.overhead import overhead
from drift_drake.view.pictures.replay import replay
from drift_drake.view.pictures.time_series import solver_work, time_series

LATERAL_ERROR = 0.5  # [m] at the start, for a car of the default one's size


@dataclasses.dataclass(frozen=True, kw_only=True)
class ClosedLoopConfig(DriveOptions):
    """Drives a reference under MPC, from errors in lateral position and sideslip, with sensor noise."""

    reference: Literal["figure_8", "loops"] = "figure_8"
    lateral_error: float | None = None
    """[m] at the start; half a metre for a car of the default one's size."""
    sideslip_error: float = 0.1
    """[rad] at the start."""
    control: ControlConfig = dataclasses.field(default_factory=ControlConfig)

    def true_car(self) -> tuple[CarParameters, Effects]:
        """The plant's car: the vehicle file's, or a double-track coupe with its effects, which no controller knows."""
        car, effects = self._of_file()
        coupe = self.plant == "double_track" and isinstance(car, VehicleParameters)
        return CARS["coupe"] if coupe else car, effects

    def parameters(self) -> VehicleParameters:
        """What the controller is set up for: the vehicle file's car, the default coupe, or the single-track car that is
        nearest to a double-track one."""
        car = self.true_car()[0] if self.vehicle is None else self._of_file()[0]
        return car.single_track()

    def _of_file(self) -> tuple[CarParameters, Effects]:
        return read_plant(self.vehicle) if self.vehicle else (VehicleParameters(), Effects())


def reference_of(config: ClosedLoopConfig) -> Reference:
    """What is driven.

    Raises:
        NoEquilibriumError, NoTransitionError: the car cannot drive it; the message says why, and what to give instead.
    """
    course = figure_8 if config.reference == "figure_8" else loops
    return course(config.parameters(), radius=config.radius, sideslip=config.sideslip, transition=config.transition,
                  half_width=config.half_width)  # fmt: skip


def others_of(config: ClosedLoopConfig) -> list[Reference]:
    """Further courses with the same drifts, if the car can drive them."""
    other: Literal["figure_8", "loops"] = "loops" if config.reference == "figure_8" else "figure_8"
    with contextlib.suppress(NoEquilibriumError, NoTransitionError, ValueError):
        return [reference_of(dataclasses.replace(config, reference=other))]
    return []


def build(config: ClosedLoopConfig) -> ClosedLoop:
    """The closed loop that a config describes."""
    parameters, reference = config.parameters(), reference_of(config)
    dt = time_step(parameters, config.control.period)
    model: StepModel = NominalStepModel(parameters, dt)
    adapter: BayesianAdapter | None = None
    (car, effects), errors = config.true_car(), Effects()
    if config.model == "known":
        model, errors = known_car_model(car, effects, dt), sensor_errors(effects)
    elif config.model != "nominal":
        learnt = load_varied() if config.model == "varied" else load_model()
        model = step_model(learnt, learnt.prior())
        offset_time = OFFSET_TIMES.get(config.model)
        adapter = BayesianAdapter(learnt, offset_time=offset_time, lags=BANK) if config.model != "prior" else None
    plant = plant_of_car(car, effects, reference.path)
    faults = [parse_fault(text) for text in config.fault]
    watch = None
    if config.monitor != "off":
        watch = GapWatch(make_monitor(parameters, used=WATCHED, period=config.control.period), config.monitor)
    if config.monitor == "forget" and adapter is None:
        raise InvalidOptionError(
            "--monitor forget is for a model that learns (online, offset_free or varied); choose watch or slow"
        )
    if config.monitor in CORRECTING:
        if config.model != "nominal":
            raise InvalidOptionError(
                f"--monitor {config.monitor} is for --model nominal, not {config.model}; choose watch or slow"
            )
        model = EffectsStepModel(parameters, Effects(), dt)
    return ClosedLoop(parameters, reference, model, effects, control=config.control, adapter=adapter, plant=plant,
                      faults=faults, watch=watch, sensor_errors=errors)  # fmt: skip


class StartedRun(NamedTuple):
    """A run before it begins."""

    loop: ClosedLoop
    context: Context
    limits: RunLimits

    def run(self) -> ClosedLoopRun:
        return self.loop.run(self.context, self.limits)


def started(config: ClosedLoopConfig) -> StartedRun:
    """The loop of a config at its start, with what earlier drives have taught.

    Raises:
        InvalidOptionError: such drives for a model that does not adapt; InvalidLogError: one of neither course, or
            that did not hold its drifts; and those of `build`.
    """
    # In a steady state the course is along the path: an error in sideslip alone is one of the heading.
    unit = similarity(config.parameters()).length
    lateral = LATERAL_ERROR * unit if config.lateral_error is None else config.lateral_error
    error = np.array([0.0, 0.0, config.sideslip_error, 0.0, lateral, 0.0])
    loop = build(config)
    context = loop.initial_context(config.seed, error)
    if config.after:
        if loop.adapter is None:
            raise InvalidOptionError(
                f"--after is for a model that adapts, not {config.model}: online, offset_free or varied"
            )
        runs = [only_run(path, "--after") for path in config.after]
        beliefs = beliefs_after(loop.adapter.model, runs, loop.reference, loop.adapter.lags, others=others_of(config))
        loop.adapter.set_beliefs(loop.adapter.GetMyMutableContextFromRoot(context), beliefs)
    return StartedRun(loop, context, RunLimits(lane_margin=RunLimits().lane_margin * unit))


def run_closed_loop(config: ClosedLoopConfig) -> ClosedLoopRun:
    """One run; the same config gives the same run to the bit (wall times aside)."""
    return started(config).run()


def main(config: ClosedLoopConfig, to: TextIO | None = None) -> dict[str, Any]:
    """Runs a config, or draws its diagram, and says where the results are.

    Args:
        to: where sentences go; standard output without.

    Returns:
        The folder of the results (`out`), and the pictures of the diagram, or the run's metrics and events.
    """
    start = started(config)  # what cannot be driven is said before a folder is made
    folder = make_run_folder("closed_loop", config.out)
    if config.graph:
        pictures = draw_graph(start.loop.diagram, folder / "closed_loop")
        print(*pictures, sep="\n", file=to)
        return {"out": folder, "pictures": pictures}
    run = start.run()
    m = run.metrics()
    events = []
    if isinstance(run.watch, GapWatch):
        verdicts = verdicts_of(run.watch.monitor, run.table)
        shown = shown_while(
            verdicts, folder / "watch.html", f"closed loop, {config.reference}", run.watch.monitor.labels, False
        )
        events = [event for judged in shown for event in judged.events]
        write_text(folder / "events.jsonl", "".join(f"{json.dumps(event)}\n" for event in events))
    for event in events:
        print(sentence(event), file=to)
    write_run_results(folder, config, m, run.table, run.reference, config.parameters(), config.control.period)
    print(
        f"{m.outcome} after {m.duration:.1f} s ({m.completion:.0%} of the {config.reference}): "
        f"RMS e {m.rms_e:.3f} m, RMS sideslip error {m.rms_sideslip_error:.3f} rad\n"
        f"{m.solves} solves, {m.solver_failures} failed, {m.late_solves} late; {m.sqp_iterations:.2f} SQP iterations "
        f"each, {m.qp_fallbacks} QPs at a second attempt, {m.unsolved_qps} unsolved; {m.solve_ms_median:.1f} ms in the "
        f"median, {m.solve_ms_99:.1f} ms at the 99th percentile\n"
        f"{m.faults()}{run.error and f'error: {run.error}' + chr(10)}results in {folder}",
        file=to,
    )
    if start.loop.adapter is not None and m.completed and m.drifting >= HELD:
        logs = shlex.join(map(str, [*config.after, folder / "run_0.csv"]))
        print(f"a further attempt, or one of the other course, can begin with what was learnt: --after {logs}", file=to)
    return {"out": folder, "metrics": m, "events": events}


def write_run_results(
    folder: Path,
    config: Any,
    metrics: RunMetrics,
    table: pd.DataFrame,
    reference: Reference,
    parameters: VehicleParameters,
    period: float,
) -> None:
    """Writes config.json, numbers.json, versions.json, run.csv, run_0.csv, three PNG pictures and replay.html.

    run.csv has all that was logged; run_0.csv is the drive as a car's logger has it, in the log format.

    Args:
        config: the dataclass that the run was made from.
        table: a row each control period, as `ClosedLoop.run` gives it.
        period: of the controller [s].
    """
    write_json(folder / "config.json", config)
    write_json(folder / "numbers.json", metrics)
    write_versions(folder)
    write_table(table, folder / "run.csv", index=False)
    write_table(as_logged(table), folder / "run_0.csv", index=False, float_format="%.9g")
    runs = {"driven": table}
    write_figure(overhead(runs, reference, parameters), folder / "overhead.png")
    write_figure(time_series(runs, reference, parameters), folder / "time_series.png")
    statistics = table.filter(regex="^(t$|solve_)").rename(columns=lambda name: str(name).removeprefix("solve_"))
    write_figure(solver_work(statistics, period), folder / "solver.png")
    replay(runs, folder / "replay.html", reference, parameters)


def as_logged(table: pd.DataFrame) -> pd.DataFrame:
    """The rows of a run's table in the log format: what was measured, and the commands.

    Where a reading did not come the last one stands, as with a logger that samples what it has.
    """
    measured = {name: table.get(f"measured_{name}", table.get(name)) for name in COLUMNS}
    commands = {"t": table["t"], "delta_cmd": table["delta"], "tau_cmd": table["tau"]}
    found = {name: column for name, column in (measured | commands).items() if column is not None}
    return pd.DataFrame({name: found[name] for name in COLUMNS if name in found}).ffill().bfill()
