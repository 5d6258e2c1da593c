"""How long a plan of a lane drive takes: OCP, Info-OCP's first and a later one, and an iteration of each.

    python -m experiments.gathering.benchmark_planning

On validation vehicles: the straight drive, the first informative one, and the one planned with what driving that has
taught. CPU times of one thread, the three in turn.
"""

import dataclasses
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from diagrams.command import run_command
from drift_drake.common.run_folder import machine
from drift_drake.drive.gathering.config import GatheringConfig
from drift_drake.drive.gathering.gather import gather, learn_drive
from drift_drake.drive.gathering.plan import Trajectory, plan_again, plan_drive
from drift_drake.drive.learnt.checkpoint import load_model
from drift_drake.drive.mpc.sqp import LineSearchSqp
from experiments.benchmarks.vehicles import draw_effects
from experiments.made import RunConfig, begun, tabulated, write_results

PLANS = ("OCP", "Info-OCP, first", "Info-OCP, later")


@dataclasses.dataclass(frozen=True)
class BenchmarkConfig(RunConfig):
    """Size of the benchmark."""

    vehicles: int = 10
    """Of the validation population."""
    vehicle_seed: int = 0


@contextmanager
def solves_timed() -> Iterator[list[tuple[int, float]]]:
    """(iterations, CPU time [s]) of each SQP solve within the block."""
    solves: list[tuple[int, float]] = []
    solve = LineSearchSqp.solve

    def counted(self: LineSearchSqp, *arguments: Any, **named: Any) -> Any:
        start = time.thread_time()
        result = solve(self, *arguments, **named)
        solves.append((len(result.iterations), time.thread_time() - start))
        return result

    LineSearchSqp.solve = counted  # type: ignore[method-assign]
    try:
        yield solves
    finally:
        LineSearchSqp.solve = solve  # type: ignore[method-assign]


def timed(plan: Callable[[], Trajectory]) -> tuple[dict[str, float], Trajectory]:
    """CPU time [s] in all and before the SQP, SQP iterations and the time of one of a plan, and the plan."""
    with solves_timed() as solves:
        start = time.thread_time()
        found = plan()
        seconds = time.thread_time() - start
    iterations, solving = (sum(column) for column in zip(*solves, strict=True))
    numbers = {"seconds": seconds, "iterations": iterations, "an iteration": solving / iterations}
    return numbers | {"setting up": seconds - solving}, found


def vehicle(index: int, config: BenchmarkConfig, gathering: GatheringConfig) -> dict[str, dict[str, float]]:
    """The plans of one vehicle, in numbers."""
    model = load_model()
    prior, effects = model.prior(), draw_effects("validation", index, config.vehicle_seed)
    straight, _ = timed(lambda: plan_drive(model, prior, gathering, 0.0))
    first, informative = timed(lambda: plan_drive(model, prior, gathering, gathering.alpha, index))
    table, _ = gather(informative, effects, model.vehicle, gathering, index)
    belief = learn_drive(model, prior, table, gathering)
    later, _ = timed(lambda: plan_again(model, belief, informative, gathering, index))
    return dict(zip(PLANS, (straight, first, later), strict=True))


def table(numbers: dict[str, Any]) -> str:
    """The numbers as Markdown."""
    said = f"{numbers['machine']}; medians and most of {len(numbers['vehicles'])} vehicles"
    heads = ("plan", "CPU time [s]", "of it before the SQP [ms]", "SQP iterations", "an iteration [ms]", "over OCP's")
    rows = []
    found = {plan: {name: np.array([each[plan][name] for each in numbers["vehicles"]])
                    for name in ("seconds", "setting up", "iterations", "an iteration")} for plan in PLANS}  # fmt: skip
    straight = np.median(found["OCP"]["an iteration"])
    for plan, by_name in found.items():
        seconds, before, iterations, each = by_name.values()
        rows.append((plan, f"{np.median(seconds):.2f} / {seconds.max():.2f}", f"{1e3 * np.median(before):.0f}",
                     f"{np.median(iterations):.0f} / {iterations.max():.0f}", f"{1e3 * np.median(each):.1f}",
                     f"{np.median(each) / straight:.2f}"))  # fmt: skip
    return "\n".join([said, "", *tabulated(heads, rows)])


def main(config: BenchmarkConfig) -> None:
    """Runs, prints and stores the benchmark."""
    folder, gathering = begun("benchmark_planning", config), GatheringConfig()
    vehicle(0, config, dataclasses.replace(gathering, steps=12, v_end=9.0, starts=1))  # compiles
    vehicles = [vehicle(index, config, gathering) for index in range(config.vehicles)]
    numbers = {"machine": machine(), "vehicles": vehicles}
    write_results(folder, config, numbers, table(numbers))


if __name__ == "__main__":
    run_command(main, BenchmarkConfig, __doc__)
