"""The monitor compared with what people use, on drives during which the car changes at a moment that is not stated.

    python -m experiments.monitoring.comparison make OUT --first 0 --count 32        # seeds to tune on
    python -m experiments.monitoring.comparison make OUT --first 5000 --count 32     # held-out seeds
    python -m experiments.monitoring.comparison score OUT --first 5000 --tuned 0

Each seed makes four drives: with and without a change, of the nominal equations (the car off within its tolerances)
and of a double-track car relative to its calibrated single-track simulator. The change's size is twice its detection
limit on that drive. What every method says is written at 10 Hz, a file a drive; existing drives are not made again.
"""

import dataclasses
import json
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import tyro

from diagrams.command import run_command
from drift_drake.car.effects.catalogue import CATALOGUE, LIMITS
from drift_drake.car.effects.magnitudes import NOT_ON_FOUR_WHEELS, Effects, make_effects
from drift_drake.car.log.table import Run
from drift_drake.car.parameters import VehicleParameters
from drift_drake.common.errors import DriftDrakeError
from drift_drake.common.executors import ExecutorConfig
from drift_drake.common.run_folder import is_done, write_json, write_versions
from drift_drake.drive.learnt.checkpoint import load_model
from drift_drake.drive.learnt.command_lag import lagged_commands
from drift_drake.drive.learnt.quality import squared_distance
from drift_drake.gap.monitoring import bank as filters
from drift_drake.gap.monitoring.evidence import ALARM, Sums, no_sums
from drift_drake.gap.monitoring.monitor import SETTLING, Monitor, with_row
from drift_drake.gap.monitoring.watch import rows_of, watched
from experiments.benchmarks.drivers import MANOEUVRES
from experiments.benchmarks.truths import drawn_deviations
from experiments.made import write_report
from experiments.monitoring.cars import Simulator, double_track_simulator
from experiments.monitoring.drives import changed_double_track_drive, changed_drive
from experiments.monitoring.limits import limits
from experiments.monitoring.peers import augmented_filters, chi_square, cumulative_sum
from experiments.monitoring.scoring import METHODS, Score, score, table, threshold
from experiments.other_worlds.drivers import DAY_ONE
from experiments.settings import run_kept

Plant = Literal["nominal", "double_track"]
PLANTS: tuple[Plant, ...] = ("nominal", "double_track")
DURATION = 20.0  # [s]
ONSETS = (6.0, 12.0)  # [s] between which a change comes
SECONDS = 3.0  # after a change, in which it is to be named
TIMES_LIMIT = 2.0
WINDOW = 20  # samples of the learnt model, 0.1 s apart


@dataclasses.dataclass(frozen=True)
class Job:
    """One drive."""

    plant: Plant
    changed: bool
    seed: int
    simulator: Simulator

    @property
    def name(self) -> str:
        return f"{self.plant}-{'changed' if self.changed else 'none'}-{self.seed:05d}"


@dataclasses.dataclass(frozen=True)
class Trace:
    """The bank over a whole drive: its rows, innovations [rows, 9], signatures [rows, n, channels that are used]."""

    t: np.ndarray
    used: np.ndarray
    innovations: np.ndarray  # [rows, 1 + n, 9]


def traced(monitor: Monitor, run: Run) -> Trace:
    """Innovations of all cars of the bank over a drive."""
    state, rows = filters.make_state(monitor.bank), list(rows_of(run))
    y = np.where(monitor.used, np.array([row.y for row in rows]), 0.0)
    filters.start_bank(y[0], monitor.used, rows[0].command, monitor.bank, state)
    e = [filters.advance_bank(y[k], monitor.used, rows[k].command, monitor.bank, state) for k in range(1, len(y))]
    return Trace(run.t[1:], monitor.used, np.array(e))


def sums_between(trace: Trace, start: float, end: float) -> Sums:
    """The sums of the rows in a part [s] of a drive."""
    block = no_sums(trace.innovations.shape[1] - 1)
    for e in trace.innovations[(trace.t > start) & (trace.t <= end)]:
        block = with_row(block, e, trace.used)
    return block


def drive(job: Job, rng: np.random.Generator, effects: Effects, onset: float, attempt: int) -> Run:
    """A drive of the job's plant; the generator gives the same kind of drive and car whatever the effects."""
    seed = 100 * job.seed + attempt
    if job.plant == "double_track":
        return changed_double_track_drive(str(rng.choice(DAY_ONE)), effects, onset, seed, DURATION)
    vehicle = VehicleParameters()
    kind, deviations = str(rng.choice(MANOEUVRES)), drawn_deviations(rng, vehicle.tolerance)
    return changed_drive(kind, effects, onset, seed, DURATION, vehicle, deviations)


def drawn_change(
    monitor: Monitor, trace: Trace, onset: float, plant: Plant, rng: np.random.Generator
) -> tuple[str, float, float] | None:
    """An effect, its magnitude and its detection limit on a drive; None if the drive would show none in range."""
    found = limits(monitor.problem, sums_between(trace, onset, onset + SECONDS),
                   sums_between(trace, SETTLING, onset), SECONDS, ALARM)  # fmt: skip
    candidates: dict[str, list[tuple[float, float]]] = {}
    for node, limit in zip(monitor.problem.nodes, found, strict=True):
        if node.name not in CATALOGUE or (plant == "double_track" and node.name in NOT_ON_FOUR_WHEELS):
            continue
        amplitude = 1.0 if node.name in LIMITS else TIMES_LIMIT * limit.detected
        sign = -1.0 if node.signed and rng.uniform() < 0.5 else 1.0
        q = sign * node.magnitude_at(amplitude) if node.signed else node.magnitude_at(amplitude)
        low, high = CATALOGUE[node.name].range_for(VehicleParameters())
        reachable = TIMES_LIMIT * limit.detected <= 1.0 if node.name in LIMITS else low <= q <= high
        if reachable:
            candidates.setdefault(node.name, []).append((q, abs(q) / TIMES_LIMIT))
    if not candidates:
        return None
    name = str(rng.choice(sorted(candidates)))
    q, limit_of = candidates[name][int(rng.integers(len(candidates[name])))]
    return name, q, limit_of


def driven(job: Job) -> tuple[Run, dict[str, Any], int]:
    """A drive long enough to judge, what is true of it, and at which attempt it came about."""
    for attempt in range(20):
        seeds = [job.seed, PLANTS.index(job.plant), int(job.changed), attempt]
        onset = float(np.random.default_rng([*seeds, 1]).uniform(*ONSETS))
        run = drive(job, np.random.default_rng(seeds), Effects(), onset, attempt)
        if run.t[-1] < onset + SECONDS:
            continue
        truth: dict[str, Any] = {}
        if job.changed:
            monitor = job.simulator.monitor(run)
            change = drawn_change(monitor, traced(monitor, run), onset, job.plant, np.random.default_rng([*seeds, 2]))
            if change is None:
                continue
            name, q, limit = change
            run = drive(job, np.random.default_rng(seeds), make_effects({name: q}), onset, attempt)
            if run.t[-1] < onset + SECONDS:
                continue
            truth = {"effect": name, "magnitude": q, "limit": limit, "onset": onset}
        return run, truth, attempt
    raise RuntimeError(f"{job.name}: no drive in 20 attempts")


def watch(job: Job) -> dict[str, Any]:
    """What every method says of one drive, at 10 Hz."""
    run, truth, attempt = driven(job)
    return {"plant": job.plant, "seed": job.seed, "attempt": attempt, "truth": truth,
            "duration": float(run.t[-1])} | said(job.simulator.monitor(run), run, truth)  # fmt: skip


def said(monitor: Monitor, run: Run, truth: dict[str, Any]) -> dict[str, Any]:
    """The monitor's verdicts and the peers' statistics, at the monitor's times."""
    verdicts = [(judged.t, judged.verdict) for judged in watched(monitor, rows_of(run))]
    t = np.array([at for at, _ in verdicts])
    p = np.array([v[:-4] for _, v in verdicts])
    trace = traced(monitor, run)
    at = np.searchsorted(trace.t, t - 1e-9)
    counts = trace.t >= SETTLING
    nu = np.where(counts[:, None], trace.innovations[:, 0], 0.0)
    g = (trace.innovations[:, :1] - trace.innovations[:, 1:])[:, :, trace.used] * counts[:, None, None]
    kept = [i for i, node in enumerate(monitor.problem.nodes) if node.name in CATALOGUE]
    filters_of_effects = augmented_filters(nu[:, trace.used], g[:, kept])
    leading = [monitor.problem.nodes[kept[i]].name for i in np.argmax(filters_of_effects[at], axis=1)]
    true = monitor.labels.index(truth.get("effect", "none"))
    return {
        "t": t, "none": p[:, 0], "true": p[:, true],
        "leading": [monitor.labels[1 + i] for i in np.argmax(p[:, 1:], axis=1)],
        "leading_probability": p[:, 1:].max(axis=1), "magnitude": [v[-4:-1] for _, v in verdicts],
        "onset": [v[-1] for _, v in verdicts],
        "chi_square": chi_square(nu, trace.used)[at], "cumulative_sum": cumulative_sum(nu, trace.used)[at],
        "augmented": filters_of_effects[at].max(axis=1), "augmented_leading": leading,
        "learnt": learnt_statistic(run, t),
    }  # fmt: skip


def learnt_statistic(run: Run, t: np.ndarray) -> np.ndarray:
    """Mean of the last `WINDOW` squared distances of samples from the learnt model's prior, at times t; 0 before."""
    model = load_model()
    belief, every = model.prior(), max(round(0.1 / run.period), 1)
    commands = np.stack([run.delta_cmd, np.asarray(run.tau_cmd)], axis=1)
    states = np.stack([np.asarray(run.column(name)) for name in ("r", "v", "beta", "omega_r")], axis=1)
    x = np.concatenate([states, np.zeros((len(run), 2)), lagged_commands(run.t, commands)], axis=1)[::every]
    u, times = commands[::every], run.t[::every]
    d = np.array([squared_distance(model, belief, x[k], u[k], u[k + 1], x[k + 1]) for k in range(len(x) - 1)])
    values = np.zeros(len(d))
    if len(d) >= WINDOW:
        values[WINDOW - 1 :] = np.convolve(d, np.full(WINDOW, 1.0 / WINDOW), "valid")
    return np.asarray(np.concatenate([[0.0], values])[np.clip(np.searchsorted(times, t + 1e-9) - 1, 0, len(values))])


@dataclasses.dataclass(frozen=True)
class Make:
    """Drives and what every method says of them."""

    out: Annotated[Path, tyro.conf.Positional]
    first: int = 0
    """First seed."""
    count: int = 16
    """Seeds: four drives each."""
    executor: ExecutorConfig = dataclasses.field(default_factory=ExecutorConfig)


class NoDrivesError(DriftDrakeError, ValueError):
    """A folder has no drives of the seeds that are asked for."""


@dataclasses.dataclass(frozen=True)
class Judge:
    """Scores of drives that are made; thresholds of the peers from other seeds."""

    out: Annotated[Path, tyro.conf.Positional]
    first: int = 5000
    """First seed that is scored."""
    count: int = 32
    tuned: int = 0
    """First seed that thresholds are taken from."""
    tuned_count: int = 16


def run_make(command: Make) -> None:
    """Makes the drives that are not there."""
    simulators = {"nominal": Simulator(VehicleParameters()), "double_track": double_track_simulator(command.out)}
    jobs = [Job(plant, changed, seed, simulators[plant]) for seed in range(command.first, command.first + command.count)
            for plant in PLANTS for changed in (False, True)]  # fmt: skip
    write_versions(command.out)
    run_kept(command.executor, watch, jobs, lambda job: command.out / f"{job.name}.json", "drive")


def run_score(command: Judge) -> None:
    """Prints a table for each plant; writes report.md and the scores."""
    scores: dict[str, dict[str, Score]] = {}
    parts = []
    for plant in PLANTS:
        held, tuning = (read_results(command.out, plant, first, count) for first, count in
                        ((command.first, command.count), (command.tuned, command.tuned_count)))  # fmt: skip
        scores[plant] = {method: score(held, method, threshold(tuning, method)) for method in METHODS}
        some = scores[plant]["monitor"]
        counts = f"{plant}: {some.changed} drives with a change, {some.minutes:.0f} min without"
        parts.append(f"{counts}\n\n{table(scores[plant])}\n")
    write_report(command.out, "\n".join(parts), command)
    write_json(command.out / f"scores-{command.first:05d}.json", scores)


def read_results(folder: Path, plant: Plant, first: int, count: int) -> list[dict[str, Any]]:
    """What `run_make` wrote of some seeds.

    Raises:
        NoDrivesError: there are none.
    """
    paths = [folder / f"{plant}-{kind}-{seed:05d}.json" for seed in range(first, first + count)
             for kind in ("none", "changed")]  # fmt: skip
    done = [json.loads(path.read_text()) for path in paths if is_done(path)]
    if not done:
        made = f"python -m experiments.monitoring.comparison make {folder} --first {first} --count {count}"
        raise NoDrivesError(
            f"{folder}: has no drives of the seeds {first} to {first + count - 1}; make them with '{made}'"
        )
    return done


Command = Annotated[Make, tyro.conf.subcommand("make")] | Annotated[Judge, tyro.conf.subcommand("score")]


def main(command: Make | Judge) -> None:
    """Makes or scores."""
    run_make(command) if isinstance(command, Make) else run_score(command)


if __name__ == "__main__":
    run_command(main, Command, __doc__)
