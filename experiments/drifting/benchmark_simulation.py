"""How much faster than real time the simulations are, where their time goes, and how memory grows.

    python -m experiments.drifting.benchmark_simulation

Of the closed loop: seconds driven for one of CPU, with the learnt model adapting at 100 Hz, and the parts: plans, what
the plant's derivatives take, and the rest, which is Drake and the other systems. Of the car alone (plant, sensors, an
actuator with a plan, logs): the same. All times are CPU times of one thread.
"""

import dataclasses
import gc
import resource
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from pydrake.systems.framework import BasicVector, Context, LeafSystem

from diagrams.command import run_command
from drift_drake.car.parameters import VehicleParameters
from drift_drake.cli.drive_run import ClosedLoopConfig, build
from drift_drake.common.run_folder import machine
from drift_drake.common.threads import one_blas_thread
from drift_drake.drive.loop.drive import Drive, DriveLimits
from drift_drake.drive.loop.runner import LogFile, make_simulator
from drift_drake.drive.mpc.plan import Plan
from drift_drake.drive.reference.trajectory import figure_8
from experiments.drifting.timed_parts import cpu
from experiments.made import RunConfig, begun, tabulated, write_results

DERIVATIVES = "DoCalcTimeDerivatives"
ERROR = np.array([0.0, 0.0, 0.1, 0.0, 0.5, 0.0])  # at the start, as in `drift-drake drive`


@dataclasses.dataclass(frozen=True)
class BenchmarkConfig(RunConfig):
    """Size of the benchmark."""

    repeats: int = 5
    """Of each simulation; medians are stated."""
    car_seconds: float = 60.0
    """[s] that the car alone is simulated for."""
    loops: int = 20
    """That are built one after the other, for memory."""
    minutes: float = 10.0
    """[min] of one closed loop on a circle, for memory."""


class Counted:
    """Counts the calls of an object's method and their CPU time, while it stands in for it."""

    def __init__(self, owner: Any, name: str) -> None:
        self._owner, self._name, self._method = owner, name, getattr(owner, name)
        self.calls, self.seconds = 0, 0.0

    def __enter__(self) -> "Counted":
        setattr(self._owner, self._name, self._timed)
        return self

    def __exit__(self, *_: object) -> None:
        delattr(self._owner, self._name)

    def _timed(self, *arguments: Any) -> Any:
        start = time.thread_time()
        result = self._method(*arguments)
        self.seconds += time.thread_time() - start
        self.calls += 1
        return result


class HeldPlan(LeafSystem):
    """Gives the same plan for ever: a slalom of small steering."""

    def __init__(self, steps: int) -> None:
        LeafSystem.__init__(self)
        u = np.column_stack([0.03 * np.sin(0.5 * np.arange(steps + 1)), np.full(steps + 1, 40.0)])
        self._plan = Plan(0.0, u).vector()
        self.DeclareVectorOutputPort("plan", self._plan.size, self._calc, {self.nothing_ticket()})

    def _calc(self, context: Context, output: BasicVector) -> None:  # noqa: ARG002
        output.SetFromVector(self._plan)


def closed_loop(seed: int) -> dict[str, float]:
    """One figure-8 with the adapting model: seconds driven for one of CPU, and shares of its CPU time."""
    loop = build(ClosedLoopConfig(model="online"))
    context = loop.initial_context(seed, ERROR)
    mpc = loop.controller.mpc  # type: ignore[union-attr]
    with Counted(loop.car.plant, DERIVATIVES) as plant, Counted(mpc, "solve") as solves:
        seconds, run = cpu(lambda: loop.run(context))
    plans = solves.seconds
    driven = float(run.table["t"].iloc[-1])
    return {
        "seconds for one of CPU": driven / seconds,
        "share of plans": plans / seconds,
        "share of the plant's derivatives": plant.seconds / seconds,
        "share of Drake and the rest": 1.0 - (plans + plant.seconds) / seconds,
        "derivatives a second": plant.calls / driven,
    }


def car_alone(seconds: float, seed: int) -> dict[str, float]:
    """The car with a plan that does not change: seconds driven for one of CPU, and shares of its CPU time.

    It is driven twice, since counting 300 calls a second costs a tenth.
    """
    parameters, steps = VehicleParameters(), int(10 * seconds)
    drive = Drive(parameters, HeldPlan(steps), steps, 0.1, None, (0.0, 40.0))
    arguments = np.array([0.0, 12.0, 0.0, 12.0, 0.0, 0.0]), 0.0, seconds, seed, DriveLimits(max_speed=np.inf)
    uncounted, _ = cpu(lambda: drive.run(*arguments))
    with Counted(drive.car.plant, DERIVATIVES) as plant:
        spent, (table, ending) = cpu(lambda: drive.run(*arguments))
    driven = float(table["t"].iloc[-1])
    return {
        "seconds for one of CPU": driven / uncounted,
        "share of the plant's derivatives": plant.seconds / spent,
        "of these alone": driven / plant.seconds,
        "derivatives a second": plant.calls / driven,
        "ended early": float(ending != "time"),
    }


def megabytes() -> float:
    """The most memory that this process has had."""
    gc.collect()
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3


def memory(config: BenchmarkConfig) -> dict[str, float]:
    """Growth of the peak [MB]: a loop built and dropped, and over a long run of one, logged to a file and in memory."""
    reference = figure_8(VehicleParameters())
    for _ in range(2):
        build(ClosedLoopConfig(model="online"))
    before = megabytes()
    for _ in range(config.loops):
        build(ClosedLoopConfig(model="online"))
    each = (megabytes() - before) / config.loops
    with tempfile.TemporaryDirectory() as folder:
        in_file = growth(config.minutes, reference.duration, Path(folder) / "run.csv")
    in_memory = growth(config.minutes, reference.duration, None)
    return {"MB a loop built": each, "MB of a long run logged to a file": in_file,
            "MB of a long run": in_memory, "minutes": config.minutes}  # fmt: skip


def growth(minutes: float, before: float, path: Path | None) -> float:
    """Growth of the peak [MB] over a loop's run, once `before` [s] have made compiled code and buffers."""
    loop = build(ClosedLoopConfig(model="online"))
    ends = None if path is None else (loop.car.plant, LogFile(loop.logs, path).take)
    simulator = make_simulator(loop.diagram, loop.initial_context(0, ERROR), ends)
    simulator.AdvanceTo(before)
    start = megabytes()
    simulator.AdvanceTo(before + 60.0 * minutes)
    return megabytes() - start


def medians(runs: list[dict[str, float]]) -> dict[str, float]:
    """Median of each number."""
    return {name: float(np.median([run[name] for run in runs])) for name in runs[0]}


@one_blas_thread()
def run(config: BenchmarkConfig) -> dict[str, Any]:
    """All numbers."""
    closed_loop(0)  # compiles, and loads what is loaded once
    car_alone(1.0, 0)
    return {
        "machine": machine(),
        "closed loop, the learnt model adapting at 100 Hz": medians([closed_loop(k) for k in range(config.repeats)]),
        "the car alone": medians([car_alone(config.car_seconds, k) for k in range(config.repeats)]),
        "memory": memory(config),
    }


def table(numbers: dict[str, Any]) -> str:
    """The numbers as Markdown."""
    rows = [(what, name, f"{value:.3g}") for what, found in numbers.items() if isinstance(found, dict)
            for name, value in found.items()]  # fmt: skip
    return "\n".join([f"{numbers['machine']}; medians", "", *tabulated(("", "", ""), rows)])


def main(config: BenchmarkConfig) -> None:
    """Runs, prints and stores the benchmark."""
    folder = begun("benchmark_simulation", config)
    numbers = run(config)
    write_results(folder, config, numbers, table(numbers))


if __name__ == "__main__":
    run_command(main, BenchmarkConfig, __doc__)
