"""Replays a log through the BayesianAdapter: what the car would have learnt on the way.

python -m diagrams.adaptation_replay RUN.csv              # one run of a log (log format, 100 Hz)
python -m diagrams.adaptation_replay RUN.csv --graph      # draws the diagram
"""

import dataclasses
from pathlib import Path
from typing import Annotated

import matplotlib

from diagrams.command import run_command
from drift_drake.common.arrays import Array

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import tyro
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from drift_drake.car.log.table import InvalidLogError, Run, read_run
from drift_drake.common.run_folder import make_run_folder, write_json, write_versions
from drift_drake.common.safe_files import write_arrays, write_figure
from drift_drake.drive.learnt.adapter import DEFAULT_THRESHOLD, MEASURED_COUNT, BayesianAdapter
from drift_drake.drive.learnt.bayesian_step import residual
from drift_drake.drive.learnt.checkpoint import BayesianModel, load_model
from drift_drake.drive.learnt.command_lag import TIME_STEP, CommandLag, lagged_commands
from drift_drake.drive.learnt.features import FEATURE_COUNT, MEAN_COUNT, STATE_COUNT, features, network_inputs
from drift_drake.drive.learnt.posterior import covariance_norms, state_norms
from drift_drake.drive.loop.runner import add_logger
from drift_drake.view.pictures.graph import draw_graph

STATES = ("r", "v", "beta", "omega_r")
COMMANDS = ("delta_cmd", "tau_cmd")


@dataclasses.dataclass(frozen=True)
class ReplayConfig:
    """What to replay."""

    log: Annotated[Path, tyro.conf.Positional]
    """One run in the log format."""
    model: Path | None = None
    """Checkpoint; the shipped one without."""
    threshold: float = DEFAULT_THRESHOLD
    """Mahalanobis distance beyond which samples are refused."""
    out: Path | None = None
    """Folder for the results; runs/adaptation_replay-DATE-TIME without."""
    graph: bool = False
    """Only draw the diagram."""


class AdaptationReplay:
    """The diagram: a log's columns as sources, the adapter, and loggers of its outputs at its ticks."""

    def __init__(self, log: Run, model: BayesianModel, threshold: float = DEFAULT_THRESHOLD) -> None:
        """Args: log: a run with r, v, beta, omega_r, delta_cmd and tau_cmd (see `read_log`)."""
        t = log.t
        self._duration = float(t[-1] - t[0])
        states = np.zeros((MEASURED_COUNT, len(t)))  # a log has no path: e, dphi and s stay zero
        states[:STATE_COUNT] = _columns(log, STATES).T
        builder = DiagramBuilder()
        self.adapter = builder.AddNamedSystem("adapter", BayesianAdapter(model, threshold))
        for name, rows in (("measured_state", states), ("command", _columns(log, COMMANDS).T)):
            source = TrajectorySource(PiecewisePolynomial.FirstOrderHold(t - t[0], rows))
            builder.AddNamedSystem(f"logged_{name}", source)
            builder.Connect(source.get_output_port(), self.adapter.GetInputPort(name))
        lag = builder.AddNamedSystem("command_lag", CommandLag())
        builder.Connect(source.get_output_port(), lag.get_input_port())
        builder.Connect(lag.get_output_port(), self.adapter.GetInputPort("lagged_command"))
        self._sinks = {
            name: add_logger(builder, self.adapter.GetOutputPort(name), name, TIME_STEP)
            for name in ("posterior_mean", "posterior_covariance", "counters")
        }
        self.diagram = builder.Build()
        self.diagram.set_name("adaptation_replay")

    def run(self) -> dict[str, Array]:
        """Over the ticks: "t" [K], "mean" [K, 4, 16], "covariance" [K, 64, 64], "counters" [K, 2] (taken, refused).

        Entry k is what is known before the tick's own update, from the samples that ended earlier.
        """
        simulator = Simulator(self.diagram)
        simulator.AdvanceTo(self._duration)
        logs = {name: sink.FindLog(simulator.get_context()) for name, sink in self._sinks.items()}
        shape = (-1, STATE_COUNT, FEATURE_COUNT)
        return {
            "t": logs["counters"].sample_times(),
            "mean": logs["posterior_mean"].data().T.reshape(shape),
            "covariance": logs["posterior_covariance"].data().T.reshape(-1, MEAN_COUNT, MEAN_COUNT),
            "counters": logs["counters"].data().T,
        }


def read_log(path: Path) -> Run:
    """One run in the log format with all that the adapter needs.

    Raises:
        InvalidLogError: names the file, the place and the remedy.
    """
    run = read_run(path)
    missing = [name for name in (*STATES, *COMMANDS) if run.column(name) is None]
    if missing:
        raise InvalidLogError(f"{path}: no column {', '.join(missing)}; the adapter needs it to form its samples")
    return run


def _columns(run: Run, names: tuple[str, ...]) -> Array:
    """Columns of a run [rows, names]."""
    return np.stack([np.asarray(run.column(name)) for name in names], axis=1)


def one_step_errors(log: Run, model: BayesianModel, mean: Array) -> Array:
    """Error [K - 1, 4] of each 0.1 s step under the mean [K, 4, 16] that was known when it began."""
    t = log.t
    ticks = t[0] + TIME_STEP * np.arange(len(mean))
    rows = _columns(log, (*STATES, *COMMANDS))
    lagged = lagged_commands(t, rows[:, STATE_COUNT:])
    states = np.concatenate([rows[:, :STATE_COUNT], np.zeros((len(t), 2)), lagged], axis=1)  # a log has no path
    x, u = (
        np.stack([np.interp(ticks, t, c) for c in columns.T], axis=1) for columns in (states, rows[:, STATE_COUNT:])
    )
    phi = features(model.network, network_inputs(x[:-1], u[:-1], u[1:]))
    y = residual(x[:-1], u[:-1], x[1:], model.vehicle.constants())
    return y - np.sum(mean[:-1] * phi, axis=-1)


def draw(ticks: dict[str, Array], prior_errors: Array, errors: Array, file: Path) -> None:
    """Covariance norms, and one-step errors of the prior and of the adapted model, over time."""
    norms = state_norms(ticks["covariance"])
    figure, axes = plt.subplots(2, 4, figsize=(15, 6), constrained_layout=True, sharex=True)
    for i, state in enumerate(STATES):
        axes[0, i].plot(ticks["t"], norms[:, i])
        axes[0, i].set_yscale("log")
        axes[0, i].set_title(state)
        axes[1, i].plot(ticks["t"][:-1], prior_errors[:, i], color="tab:gray", label="prior")
        axes[1, i].plot(ticks["t"][:-1], errors[:, i], color="tab:blue", label="adapted so far")
        axes[1, i].set_xlabel("t [s]")
        for axis in axes[:, i]:
            axis.grid(alpha=0.3)
    axes[0, 0].set_ylabel("norm of the covariance")
    axes[1, 0].set_ylabel("one-step error")
    axes[1, 0].legend(fontsize=8)
    write_figure(figure, file, dpi=130)
    plt.close(figure)


def main(config: ReplayConfig) -> None:
    """Replays, and leaves numbers, pictures and the posterior in the run folder."""
    log, model = read_log(config.log), load_model(config.model)
    replay = AdaptationReplay(log, model, config.threshold)
    folder = make_run_folder("adaptation_replay", config.out)
    if config.graph:
        for path in draw_graph(replay.diagram, folder / "adaptation_replay"):
            print(path)
        return
    ticks = replay.run()
    errors = one_step_errors(log, model, ticks["mean"])
    prior_errors = one_step_errors(log, model, np.broadcast_to(model.prior_mean, ticks["mean"].shape))
    draw(ticks, prior_errors, errors, folder / "adaptation.png")
    numbers = {
        "taken": int(ticks["counters"][-1, 0]),
        "refused": int(ticks["counters"][-1, 1]),
        "rms_prior": dict(zip(STATES, np.sqrt(np.mean(prior_errors**2, axis=0)), strict=True)),
        "rms_adapted": dict(zip(STATES, np.sqrt(np.mean(errors**2, axis=0)), strict=True)),
        "norms_before": covariance_norms(model.prior())[0],
        "norms_after": state_norms(ticks["covariance"][-1]),
    }
    write_json(folder / "config.json", config)
    write_versions(folder)
    write_json(folder / "numbers.json", numbers)
    write_arrays(folder / "posterior.npz", mean=ticks["mean"][-1], covariance=ticks["covariance"][-1])
    print(f"{numbers['taken']} samples taken, {numbers['refused']} refused; results in {folder}")


if __name__ == "__main__":
    run_command(main, ReplayConfig)
