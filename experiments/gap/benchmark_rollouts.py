"""How many rollouts a second a diagnosis makes of each kind, compared with the same car in Drake.

    python -m experiments.gap.benchmark_rollouts

On the runs of one simulated case, under a hypothesis with an effect: the filter over a run, the innovations of other
parameters under its gains, predictions of half a second from each window, and the learnt model's over the same time,
all starts in one batch. Each kind in turn, CPU times of one thread; Drake's simulation of the car alone (plant,
sensors, actuator, log) is the peer.
"""

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np

from diagrams.command import run_command
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.parameters import VehicleParameters
from drift_drake.common.run_folder import machine
from drift_drake.common.threads import one_blas_thread
from drift_drake.drive.learnt.checkpoint import load_model
from drift_drake.drive.learnt.quality import step_model
from drift_drake.gap.estimation.filtered import filter_case
from drift_drake.gap.estimation.make_problem import make_problem
from drift_drake.gap.estimation.observed import observe_case
from drift_drake.gap.estimation.variants import Variant
from drift_drake.gap.estimation.windows import HORIZONS, STRIDE, errors, windowed
from experiments.benchmarks.compiled_cases import make_case
from experiments.benchmarks.truths import Truth
from experiments.drifting.benchmark_simulation import car_alone
from experiments.drifting.timed_parts import cpu
from experiments.made import RunConfig, begun, tabulated, write_results

EFFECT = {"rear_stiffness_error": -0.1}
AHEAD = HORIZONS * STRIDE  # [s]
STARTS = 400  # of the learnt model's predictions: those of a case's windows, about


@dataclasses.dataclass(frozen=True)
class BenchmarkConfig(RunConfig):
    """Size of the benchmark."""

    repeats: int = 20
    """Of each kind in turn; medians are stated, and the least and the most."""
    seed: int = 0
    """Of the case."""


@dataclasses.dataclass(frozen=True)
class Kind:
    """One sort of rollout."""

    count: int  # of rollouts in a call
    seconds: float  # that one of them lasts
    call: Callable[[], Any]


def kinds(seed: int) -> dict[str, Kind]:
    """By name; the last is the peer."""
    vehicle = VehicleParameters()
    runs = make_case(Truth(EFFECT), vehicle, np.random.default_rng(seed))
    problem, windows = make_problem(runs, vehicle), [windowed(run) for run in runs]
    names, theta = tuple(EFFECT), np.append(np.zeros(problem.nuisances), list(EFFECT.values()))
    gains = filter_case(problem, theta, names)
    lasting = float(np.mean([len(run) * run.period for run in runs]))
    model = load_model()
    stepper, straight = step_model(model, model.prior()), np.zeros(STARTS)
    x, u = np.tile([0.3, 12.0, -0.1, 13.0, 0.0, 0.0, 0.05, 80.0], (STARTS, 1)), np.tile([0.05, 80.0], (STARTS, 1))

    def learnt() -> None:
        state = x
        for _ in range(HORIZONS):
            state = stepper.step(state, u, u, straight)

    constants, effects = vehicle.constants(), Effects(**EFFECT)
    predicted = sum(len(run.starts) for run in windows)
    return {
        "filter over a run": Kind(len(runs), lasting, lambda: filter_case(problem, theta, names)),
        "innovations of a run": Kind(
            len(runs), lasting, lambda: observe_case(problem, gains, [Variant(theta, names)])[0]
        ),
        "prediction from a window": Kind(predicted, AHEAD, lambda: errors(windows, constants, effects)),
        "the learnt model's prediction": Kind(STARTS, AHEAD, learnt),
        "the car alone in Drake": Kind(1, lasting, lambda: car_alone(lasting, seed)),
    }


@one_blas_thread()
def run(config: BenchmarkConfig) -> dict[str, dict[str, Any]]:
    """Of each kind: how long a rollout lasts [s], and rollouts a second of CPU in each repeat."""
    found = kinds(config.seed)
    for kind in found.values():
        kind.call()  # compiles
    rates: dict[str, list[float]] = {name: [] for name in found}
    for _ in range(config.repeats):
        for name, kind in found.items():
            rates[name].append(kind.count / cpu(kind.call)[0])
    return {name: {"seconds": found[name].seconds, "rates": rates[name]} for name in found}


def table(numbers: dict[str, dict[str, Any]]) -> str:
    """The numbers as Markdown."""
    said = f"{machine()}; medians (least to most) of {len(next(iter(numbers.values()))['rates'])} calls"
    rows = []
    for name, found in numbers.items():
        rates = np.array(found["rates"])
        rows.append((name, f"{found['seconds']:.3g}",
                     f"{np.median(rates):,.1f} ({rates.min():,.1f} to {rates.max():,.1f})",
                     f"{found['seconds'] * np.median(rates):,.0f}"))  # fmt: skip
    return "\n".join([said, "", *tabulated(("rollout", "lasts [s]", "a second of CPU", "times real time"), rows)])


def main(config: BenchmarkConfig) -> None:
    """Runs, prints and stores the benchmark."""
    folder = begun("benchmark_rollouts", config)
    numbers = run(config)
    write_results(folder, config, numbers, table(numbers))


if __name__ == "__main__":
    run_command(main, BenchmarkConfig, __doc__)
