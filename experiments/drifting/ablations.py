"""Which part is to blame where the learnt model does not drive as the oracle does: one part changed at a time.

    python -m experiments.drifting.ablations                          # three vehicles, some 5 minutes of CPU each
    python -m experiments.drifting.ablations --parts belief --vehicles 5

On the figure-8, what the controller believes goes from the nominal car to the truth, one step at a time:

- `prior`, `online`: the features and the meta-trained prior, without and with adaptation on the way;
- `twice_info`: what information gathering has taught (`twice_info_full`: with every sample at weight one, the paper's);
- `own_drift`: what 27 s of the same vehicle's drifting teach (driven by the oracle, with other noise);
- `own_drift_flat`: the same under a prior a hundred times as wide;
- `oracle`: the true car.

If `own_drift_flat` falls short of the oracle, the features are to blame; if `own_drift` falls short of that, the prior;
if `twice_info` falls short of `own_drift`, the data; if all of them, a part of the controller: horizon, weights, the
rule for the path's coordinates, delay, iterations and the lane's tightening are changed one by one, with Twice-Info and
with the oracle. Where plans that are solved to convergence stray as far as those in real time, it is what they believe.
Broken off, it goes on where it was (give --out).
"""

import dataclasses
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pandas as pd

from diagrams.command import run_command
from drift_drake.car.single_track.motion import INPUTS, STATES
from drift_drake.common.errors import InvalidOptionError
from drift_drake.common.executors import run_jobs
from drift_drake.common.run_folder import is_done
from drift_drake.common.safe_files import write_arrays
from drift_drake.drive.learnt.bayesian_step import PathStep
from drift_drake.drive.learnt.checkpoint import BayesianModel, load_model
from drift_drake.drive.learnt.posterior import Posterior
from drift_drake.drive.learnt.quality import learn
from drift_drake.drive.learnt.samples import Samples, samples_from_log
from drift_drake.drive.loop.closed_loop import ControlConfig
from drift_drake.drive.mpc.ocp import OcpWeights
from experiments.benchmarks.vehicles import Population
from experiments.drifting.errors import ROLLOUT_STEPS, drifting_errors
from experiments.drifting.report import summarise
from experiments.drifting.runs import DriftConfig, DriveJob, Learnt, drive, opened, reference, run_drives
from experiments.gathering.beliefs import Attempt
from experiments.made import tabulated, write_results

Part = Literal["belief", "horizon", "path step", "delay", "iterations", "weights", "tightening"]
Belief = Literal["nominal", "prior", "online", "twice_info", "twice_info_full", "own_drift", "own_drift_flat", "oracle"]

OWN_DRIVE = 500  # added to the noise seed of the drive that `own_drift` learns from
LOG_PERIOD = 0.01  # [s]
FLAT = 100.0  # times the prior's covariance
CONVERGED = 1e-4  # of a plan's scaled residuals


@dataclasses.dataclass(frozen=True)
class Variant:
    """One row of the table."""

    part: Part
    name: str
    belief: Belief
    control: ControlConfig
    path_step: PathStep = "trapezoid"


@dataclasses.dataclass(frozen=True)
class AblationsConfig(DriftConfig):
    """Which vehicles, and which parts are changed."""

    vehicles: int = 3
    population: Population = "validation"
    noise_seeds: int = 1
    parts: tuple[Part, ...] = ("belief", "horizon", "path step", "delay", "iterations", "weights", "tightening")


def variants(control: ControlConfig) -> list[Variant]:
    """All rows; those of the part `belief` are the chain, the others change one setting of the controller."""
    change = partial(dataclasses.replace, control)
    weights = control.weights
    beliefs: tuple[Belief, ...] = (
        "nominal", "prior", "online", "twice_info", "twice_info_full", "own_drift", "own_drift_flat", "oracle",
    )  # fmt: skip
    rows = [Variant("belief", belief, belief, control) for belief in beliefs]
    settings: list[tuple[Part, str, ControlConfig]] = [
        ("horizon", "N = 15", change(horizon=15)),
        ("horizon", "N = 35", change(horizon=35)),
        ("delay", "not compensated", change(delay=0.0)),
        ("delay", "two periods", change(delay=2.0 * control.period)),
        ("iterations", "3 a plan", change(iterations=3)),
        ("weights", "e and dphi times 4", change(weights=_scaled(weights, ("e", "dphi"), 4.0))),
        ("weights", "beta and r times 4", change(weights=_scaled(weights, ("beta", "r"), 4.0))),
        ("weights", "inputs times 4", change(weights=_scaled(weights, ("delta", "tau"), 4.0))),
    ]
    for belief in ("twice_info", "own_drift", "own_drift_flat"):
        rows.append(Variant("path step", f"Euler, {belief}", belief, control, "euler"))
    learning: tuple[Belief, ...] = ("twice_info", "online")
    for kappa in (1.0, 2.0):
        narrowed = change(tightening=kappa)
        rows += [Variant("tightening", f"lane less {kappa:g} sigma, {belief}", belief, narrowed) for belief in learning]
    converged, believed = change(tolerance=CONVERGED), (*learning, "prior", "oracle")
    rows += [Variant("iterations", f"to convergence, {belief}", belief, converged) for belief in believed]
    for part, name, setting in settings:
        rows += [Variant(part, f"{name}, {belief}", belief, setting) for belief in ("twice_info", "oracle")]
    return rows


def _scaled(weights: OcpWeights, names: tuple[str, ...], factor: float) -> OcpWeights:
    return dataclasses.replace(weights, **{name: factor * getattr(weights, name) for name in names})


def own_samples(job: DriveJob) -> Samples:
    """A drive of the vehicle, as it measures it, as samples at 10 Hz."""
    table = drive(job).table
    columns = {"t": table["t"]} | {name: table[f"measured_{name}"] for name in (*STATES, "s")}
    columns |= {f"{name}_cmd": table[name] for name in INPUTS}
    return samples_from_log(pd.DataFrame(columns), reference(job.maneuver).path, 0, 0)


def driven_samples(path: Path) -> Samples:
    """A run's file (true states) as samples at 10 Hz."""
    table = pd.read_csv(path).rename(columns={name: f"{name}_cmd" for name in INPUTS})
    return samples_from_log(table, reference("figure_8").path, 0, 0)


def all_beliefs(config: DriftConfig, learnt: BayesianModel, folder: Path) -> dict[Attempt, dict[str, Posterior]]:
    """What is believed of each vehicle in each learnt variant, all of them of typical lags."""
    wanted = frozenset({"twice_info"})
    config = dataclasses.replace(config, gathering=dataclasses.replace(config.gathering, learn_lags=False))
    weighted = config.gathered(wanted, learnt, folder)
    (folder / "full_weight").mkdir(exist_ok=True)
    full = config.gathered(
        wanted,
        dataclasses.replace(learnt, sample_weight=np.ones_like(learnt.sample_weight)),
        folder / "full_weight",
    )
    samples = _own_drives(config, folder)
    prior = learnt.prior()
    flat = prior._replace(covariance=FLAT * prior.covariance, q=prior.q / FLAT)
    return {
        attempt: {
            "prior": prior,
            "online": prior,
            "twice_info": weighted[attempt].after(learnt)[1],
            "twice_info_full": full[attempt].after(learnt)[1],
            "own_drift": learn(learnt, prior, samples[attempt]),
            "own_drift_flat": learn(learnt, flat, samples[attempt]),
        }
        for attempt in config.attempts()
    }


def _own_drives(config: DriftConfig, folder: Path) -> dict[Attempt, Samples]:
    """The oracle's drives of each vehicle, kept in the folder's `own-*.npz`."""
    files = {attempt: folder / f"own-{attempt[0]:03d}-{attempt[1]}.npz" for attempt in config.attempts()}
    jobs = [
        DriveJob(file.stem, {}, "figure_8", config.effects(vehicle), OWN_DRIVE + seed, "oracle", config.control)
        for (vehicle, seed), file in files.items()
        if not is_done(file)
    ]

    def write(job: DriveJob, samples: Samples) -> None:
        write_arrays(folder / f"{job.name}.npz", **samples._asdict())

    run_jobs(config.run_on, own_samples, jobs, write, "own drive")
    drives = {}
    for attempt, file in files.items():
        with np.load(file) as stored:
            drives[attempt] = Samples(*(stored[name] for name in Samples._fields))
    return drives


def table(rows: list[Variant], summary: dict[str, Any], errors: dict[str, dict[str, float]]) -> str:
    """All variants, as Markdown."""
    heads = ("part", "variant", "drift held throughout", "drifting, median", "RMS e, median (most) [m]",
             "RMS sideslip error [rad]", "error in drifts: one step", "2 s")  # fmt: skip
    cells = []
    for row in rows:
        s = summary[row.name]
        e, b = s["rms_e"], s["rms_sideslip_error"]
        found = errors.get(row.name)
        own = (f"{found['one_step']:.2f}", f"{found['rollout']:.2f}") if found else ("", "")
        median, most = (f"{e[q]:.2f}" for q in ("median", "most"))
        cells.append((row.part, row.name, f"{s['drifted']:.0%} of {s['runs']}", f"{s['drifting']['median']:.0%}",
                      f"{median} ({most})", f"{b['median']:.3f} ({b['most']:.3f})", *own))  # fmt: skip
    return "\n".join(tabulated(heads, cells))


def main(config: AblationsConfig) -> None:
    """Runs what is missing, then writes the table."""
    if config.control.period != LOG_PERIOD:
        raise InvalidOptionError(f"samples are made from rows {LOG_PERIOD} s apart; leave --control.period at that")
    folder = opened("ablations", config)
    learnt = load_model(config.checkpoint)
    beliefs = all_beliefs(config, learnt, folder)
    rows = [row for row in variants(config.control) if row.part in config.parts]
    jobs = []
    for row in rows:
        for vehicle, seed in config.attempts():
            stem = row.name.replace(" = ", "").replace(", ", "-").replace(" ", "_")
            believes: Literal["nominal", "oracle"] | Learnt
            if row.belief == "nominal" or row.belief == "oracle":
                believes = row.belief
            else:
                believes = Learnt(learnt, beliefs[vehicle, seed][row.belief], row.belief == "online", row.path_step)
            labels = {"model": row.name, "part": row.part, "vehicle": vehicle, "noise_seed": seed}
            name = f"{stem}-{vehicle:03d}-{seed}"
            jobs.append(DriveJob(name, labels, "figure_8", config.effects(vehicle), seed, believes, row.control))
    summary = summarise(run_drives(jobs, folder, config.run_on))
    errors = belief_errors(learnt, beliefs, folder) if "belief" in config.parts else {}
    numbers = {"runs": summary, "errors_in_drifts": errors}
    write_results(folder, config, numbers, table(rows, summary, errors))


def belief_errors(
    learnt: BayesianModel, beliefs: dict[Attempt, dict[str, Posterior]], folder: Path
) -> dict[str, dict[str, float]]:
    """Each belief's errors on the oracle's run of the same vehicle, medians over the attempts.

    "one_step" in units of the model's noise, "rollout" (2 s) in units of the inputs' scale; see `drifting_errors`.
    """
    found: dict[str, dict[str, list[float]]] = {}
    for (vehicle, seed), known in beliefs.items():
        samples = driven_samples(folder / f"oracle-{vehicle:03d}-{seed}.csv")
        if len(samples.x) < ROLLOUT_STEPS:  # the oracle failed at once: nothing to judge by
            continue
        for name, belief in known.items():
            if name == "online":
                continue
            errors = drifting_errors(learnt, belief, samples)
            entry = found.setdefault(name, {"one_step": [], "rollout": []})
            entry["one_step"].append(errors["one_step_scaled"])
            entry["rollout"].append(errors["rollout_scaled"])
    return {name: {key: float(np.median(values)) for key, values in entry.items()} for name, entry in found.items()}


if __name__ == "__main__":
    run_command(main, AblationsConfig)
