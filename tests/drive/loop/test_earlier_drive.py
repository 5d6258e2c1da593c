"""What an earlier drive teaches: as the adapter learns it on the way, and only of a drive of this course, held."""

import dataclasses
from functools import partial
from pathlib import Path
from typing import cast

import numpy as np
import pandas as pd
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, DiagramBuilder
from pydrake.systems.primitives import TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from drift_drake.car.log.table import COLUMNS, InvalidLogError, Run
from drift_drake.car.parameters import VehicleParameters
from drift_drake.cli.drive_run import ClosedLoopConfig, main, run_closed_loop
from drift_drake.common.arrays import Array
from drift_drake.common.errors import InvalidOptionError
from drift_drake.drive.learnt.adapter import BayesianAdapter
from drift_drake.drive.learnt.checkpoint import load_varied
from drift_drake.drive.learnt.command_lag import CommandLag
from drift_drake.drive.learnt.posterior import Posterior
from drift_drake.drive.loop.closed_loop import ClosedLoop
from drift_drake.drive.loop.earlier_drive import OTHER_COURSE, beliefs_after, check_earlier_drive
from drift_drake.drive.reference.trajectory import Reference, figure_8, loops

CAR = VehicleParameters()
LAGS = np.array([[0.05, 0.1], [0.2, 0.1], [0.02, 0.03]])


@pytest.fixture(scope="module")
def course() -> Reference:
    return figure_8(CAR)


def along(course: Reference, period: float = 0.01, until: float = 1.0) -> Run:
    """A log of a car that follows a course to a share of it; what its actuators do is what the reference has."""
    t = np.arange(0.0, until * course.duration, period)
    s = course.position(t)
    r, v, beta, omega_r = course.state(s)[:, :4].T
    delta, tau = course.input(s).T
    return Run("first.csv", t, r=r, v=v, beta=beta, omega_r=omega_r, delta_cmd=delta, tau_cmd=tau)


def test_beliefs_are_those_of_the_adapter_that_was_in_the_loop(course: Reference) -> None:
    """Its ports are fed with the log, the commands behind the lags by the loop's own system."""
    model, run = load_varied(), along(course)
    run = dataclasses.replace(run, r=run.r + np.random.default_rng(0).normal(scale=0.02, size=len(run)))
    builder = DiagramBuilder()
    adapter = builder.AddSystem(BayesianAdapter(model, lags=LAGS))
    lag = builder.AddSystem(CommandLag(0.01, LAGS))
    states = np.zeros((7, len(run)))
    states[:4] = [run.column(name) for name in ("r", "v", "beta", "omega_r")]
    commands = np.array([run.column(name) for name in ("delta_cmd", "tau_cmd")])
    for name, signals in (("measured_state", states), ("command", commands)):
        source = builder.AddSystem(TrajectorySource(PiecewisePolynomial.FirstOrderHold(run.t, signals)))
        builder.Connect(source.get_output_port(), adapter.GetInputPort(name))
        if name == "command":
            builder.Connect(source.get_output_port(), lag.GetInputPort("command"))
    builder.Connect(lag.get_output_port(), adapter.GetInputPort("lagged_command"))
    simulator = Simulator(builder.Build())
    simulator.AdvanceTo(run.t[-1] + 0.001)
    context = adapter.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    on_the_way, believed = adapter.posterior(context), adapter.believed(context)
    taken, refused = adapter.GetOutputPort("counters").Eval(context)
    assert taken + refused == (len(run) - 1) // 10
    adapter.set_posterior(context, model.prior())
    adapter.set_beliefs(context, beliefs_after(model, [run], course, LAGS))
    assert adapter.believed(context) == believed
    assert np.abs(on_the_way.mean - model.prior().mean).max() > 0.01
    for found, expected in zip(adapter.posterior(context), on_the_way, strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-8)


def test_the_period_of_the_log_does_not_matter(course: Reference) -> None:
    coarse = beliefs_after(load_varied(), [along(course, 0.02)], course, LAGS[:1])
    fine = beliefs_after(load_varied(), [along(course)], course, LAGS[:1])
    learnt = np.abs(fine.posteriors[0].mean - load_varied().prior().mean).max()
    np.testing.assert_allclose(coarse.posteriors[0].mean, fine.posteriors[0].mean, rtol=0.0, atol=0.02 * learnt)


def test_a_spike_teaches_nothing(course: Reference) -> None:
    run = along(course)
    spiked = dataclasses.replace(run, r=np.where(np.arange(len(run)) == 800, 30.0, run.r))
    plain, found = (beliefs_after(load_varied(), [one], course, LAGS[:1]).posteriors[0] for one in (run, spiked))
    assert np.abs(found.mean - plain.mean).max() < 0.1 * np.abs(plain.mean - load_varied().prior().mean).max()


def test_what_is_no_drive_of_this_course_is_refused(course: Reference) -> None:
    run = along(course)
    assert run.beta is not None
    gripped = run.beta * np.where(run.beta > 0.0, 0.2, 1.0)  # in right-hand curves
    for bad, said in (
        (run.without("beta", "tau_cmd"), "first.csv: has no column beta, tau_cmd; a learnt model needs"),
        (along(course, 0.03), "rows are 0.03 s apart"),
        (along(course, until=0.5), r"ends after \d+ m of the 340 m of the course"),
        (along(loops(CAR)), r"is [\d.]+ rad off the course at t = [\d.]+ s"),
        (along(figure_8(CAR, radius=20.0)), r"is [\d.]+ rad off the course at t = [\d.]+ s"),
        (dataclasses.replace(run, beta=-run.beta, r=-run.r), r"rad off the course"),
        (dataclasses.replace(run, beta=gripped), "of the drifts in curves to the right 0% were held"),
    ):
        with pytest.raises(InvalidLogError, match=said):
            check_earlier_drive(bad, course)
    check_earlier_drive(run, course)


def test_samples_of_all_drives_add_up_and_those_of_another_course_count_less(course: Reference) -> None:
    """A precision grows by what the samples hold, whatever was there before them; two drives that are alike elsewhere
    count as one."""
    model, other = load_varied(), loops(CAR)
    here, there = along(course), along(other)
    assert check_earlier_drive(there, course, other) is other
    assert check_earlier_drive(here, course, other) is course

    def growth(runs: list[Run], next_course: Reference, *others: Reference) -> Array:
        beliefs = beliefs_after(model, runs, next_course, LAGS[:1], np.inf, others)
        return np.linalg.inv(beliefs.posteriors[0].covariance) - np.linalg.inv(model.prior().covariance)

    own, less = growth([there], other), growth([there], course, other)
    close = partial(np.testing.assert_allclose, rtol=0.0, atol=1e-6 * np.abs(own).max())
    close(less, OTHER_COURSE * own)
    close(growth([here, there], course, other), growth([here], course) + less)
    close(growth([there, there], course, other), less)


def test_neither_course_is_said_with_what_to_give(course: Reference) -> None:
    with pytest.raises(InvalidLogError, match=r"off the course .* or of another one with the same drifts"):
        check_earlier_drive(along(figure_8(CAR, radius=20.0)), course, loops(CAR))


def written(run: Run, path: Path) -> Path:
    columns = {name: run.column(name) for name in COLUMNS if run.column(name) is not None}
    pd.DataFrame(columns).to_csv(path, index=False, float_format="%.17g")
    return path


def test_a_drive_begins_with_what_an_earlier_one_of_either_course_taught(
    course: Reference, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    log = written(along(course), tmp_path / "first.csv")

    def at_its_start(loop: ClosedLoop, context: Context, *_: object) -> Posterior:
        assert loop.adapter is not None
        return loop.adapter.posterior(loop.adapter.GetMyContextFromRoot(context))

    monkeypatch.setattr(ClosedLoop, "run", at_its_start)
    for config, beliefs in (
        (ClosedLoopConfig(model="varied", after=(log,)), beliefs_after(load_varied(), [along(course)], course)),
        (
            ClosedLoopConfig(model="varied", after=(log, log), reference="loops"),
            beliefs_after(load_varied(), [along(course)] * 2, loops(CAR), others=[course]),
        ),
    ):
        expected = beliefs.posteriors[int(np.argmax(beliefs.evidence))]
        for found, part in zip(cast(Posterior, run_closed_loop(config)), expected, strict=True):
            np.testing.assert_allclose(found, part, rtol=1e-9, atol=1e-12)


def test_a_refused_drive_leaves_no_folder(course: Reference, tmp_path: Path) -> None:
    config = ClosedLoopConfig(model="varied", after=(written(along(course, until=0.3), tmp_path / "first.csv"),))
    for broken, kind, said in (
        (config, InvalidLogError, "first.csv: ends after"),
        (
            dataclasses.replace(config, model="prior"),
            InvalidOptionError,
            "--after is for a model that adapts, not prior",
        ),
    ):
        with pytest.raises(kind, match=said):
            main(dataclasses.replace(broken, out=tmp_path / "out"))
        assert not (tmp_path / "out").exists()
