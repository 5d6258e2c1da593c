"""Runs and hypotheses that are filtered together come out as each alone, and as plain Python computes them."""

import os
import subprocess
import sys

import numpy as np
import pytest

from drift_drake.car.log.table import write_run
from drift_drake.car.parameters import VehicleParameters
from drift_drake.gap.estimation.filter_state import SIZE
from drift_drake.gap.estimation.filtered import filter_case, filter_each
from drift_drake.gap.estimation.make_problem import make_problem
from drift_drake.gap.estimation.observed import observe_each
from drift_drake.gap.estimation.roll_outs import roll_out
from drift_drake.gap.estimation.variants import Variant, ready

STEPS_ALIKE = 5e-3  # [standard deviations]: cars at once take the steps of the one that needs the most


@pytest.fixture(scope="module")
def problem(stiffness_case):
    _, runs = stiffness_case
    return make_problem([runs[0], runs[1].rows(0, 400), runs[2].rows(0, 700)], VehicleParameters())


def test_short_runs_are_filtered_with_long_ones_as_alone(problem):
    together = filter_case(problem, np.zeros(problem.nuisances), ())
    for i, run in enumerate(problem.runs):
        alone = problem.replace(runs=[run])
        found = filter_case(alone, np.zeros(alone.nuisances), ())
        assert together.gain[i].shape == found.gain[0].shape == (len(run.y), 9, 9)
        np.testing.assert_allclose(together.innovations[i], found.innovations[0], atol=STEPS_ALIKE)


def test_hypotheses_are_filtered_at_once_as_one_by_one(problem):
    nothing = np.zeros(problem.nuisances)
    some = [Variant(np.append(nothing, q), (name,)) for name, q in (("friction_level", -0.2), ("sensor_latency", 0.03))]
    for found, (theta, names, *_) in zip(filter_each(problem, some), some, strict=True):
        alone = filter_case(problem, theta, names)
        assert found.filtered.logdet == pytest.approx(alone.filtered.logdet, rel=1e-6)
        for e, expected in zip(found.innovations, alone.innovations, strict=True):
            np.testing.assert_allclose(e, expected, atol=STEPS_ALIKE)


def test_more_variants_than_lanes_and_late_ones_keep_their_order(problem):
    nothing = np.zeros(problem.nuisances)
    gains = filter_case(problem, nothing, ())
    names = ["mass_error", "sensor_latency"] * 6
    thetas = [np.append(nothing, 0.01 * (k + 1)) for k in range(len(names))]
    found = observe_each(problem, gains, 1, [Variant(theta, (n,)) for theta, n in zip(thetas, names, strict=True)])
    for e, theta, name in zip(found, thetas, names, strict=True):
        alone = observe_each(problem, gains, 1, [Variant(theta, (name,))])[0]
        np.testing.assert_allclose(e, alone, atol=STEPS_ALIKE)


def test_a_roll_out_ends_with_its_run(problem):
    run, states = problem.runs[1], np.zeros((len(problem.runs[1].y), SIZE))
    states[:, [1, 3]] = 10.0
    car = ready(problem, 1, Variant(np.zeros(problem.nuisances), ()))
    starts = np.arange(len(run.y) - 30, len(run.y), 3)
    out = roll_out(car, run.period, states, starts, np.array([1, 20, 500]))
    reached = starts[:, None] + np.array([1, 20, 500]) < len(run.y)
    np.testing.assert_array_equal(np.isfinite(out).all(axis=-1), reached)
    one = roll_out(car, run.period, states, starts[:1], np.array([1, 20, 500]))
    np.testing.assert_allclose(out[:1, :2], one[:, :2], atol=1e-4)


PLAIN = """
import sys

import numpy as np

from drift_drake.car.effects.magnitudes import make_effects
from drift_drake.car.log.table import read_case
from drift_drake.car.parameters import VehicleParameters
from drift_drake.gap.estimation.filtered import filter_case
from drift_drake.gap.estimation.make_problem import make_problem
from drift_drake.gap.estimation.observed import observe_each
from drift_drake.gap.estimation.variants import Variant
from drift_drake.gap.estimation.windows import errors, windowed

runs = [run.rows(0, rows) for run, rows in zip(read_case(sys.argv[1])[:2], (120, 110), strict=True)]
problem, names = make_problem(runs, VehicleParameters()), ("tyre_relaxation",)
theta = np.append(np.zeros(problem.nuisances), 0.3)
gains = filter_case(problem, theta, names)
e = errors([windowed(run) for run in runs], VehicleParameters().constants(), make_effects({"tyre_thermal_fade": 0.1}))
np.savez(sys.argv[2], *gains.innovations, *observe_each(problem, gains, 1, [Variant(theta, names)]), e)
"""  # on a few rows


def test_compiled_passes_are_what_python_computes(stiffness_case, tmp_path):
    _, runs = stiffness_case
    (tmp_path / "case").mkdir()
    for i, run in enumerate(runs[:2]):
        write_run(run, tmp_path / "case" / f"run_{i}.csv")
    found = []
    for disabled in ("0", "1"):
        out = tmp_path / f"{disabled}.npz"
        subprocess.run([sys.executable, "-c", PLAIN, tmp_path / "case", out], check=True,
                       env=os.environ | {"NUMBA_DISABLE_JIT": disabled})  # fmt: skip
        with np.load(out) as arrays:
            found.append([arrays[name] for name in arrays])
    for compiled, plain in zip(*found, strict=True):
        np.testing.assert_allclose(compiled, plain, rtol=1e-9, atol=1e-9)
