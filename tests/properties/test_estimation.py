"""Symmetries of the estimation: mirrored logs, runs of a case in any order, a case cut in two."""

import dataclasses
from collections.abc import Mapping
from functools import cache

import numpy as np
import pytest

pytest.importorskip("hypothesis", reason="properties need the extra `test`")

from hypothesis import given, settings
from hypothesis import strategies as st

from drift_drake.car.effects.catalogue import CATALOGUE
from drift_drake.car.log.table import COLUMNS, Run
from drift_drake.car.parameters import VehicleParameters
from drift_drake.gap.diagnosis.likelihood.search import search
from drift_drake.gap.estimation.filter_state import CHANNELS
from drift_drake.gap.estimation.filtered import filter_case
from drift_drake.gap.estimation.fit import cost_of
from drift_drake.gap.estimation.make_problem import make_problem
from drift_drake.gap.estimation.problem import NUISANCES, Problem
from drift_drake.gap.evidence.posterior import make_posterior, read_constants
from drift_drake.gap.logs.wording.conversion import MIRRORED
from experiments.benchmarks.compiled_cases import make_case
from experiments.benchmarks.truths import Truth
from tests.gap.fits import fit

CAR = VehicleParameters()
ODD = ("steering_offset", "gyro_bias", "sideslip_bias", "road_bank")  # effects that a mirror turns the sign of
SIGNS = np.array([-1.0 if name in MIRRORED else 1.0 for name in CHANNELS])
FEW = ("rear_stiffness_error", "steering_offset", "gyro_bias")
APART = 5.0  # standard deviations


def few(count: int) -> settings:
    return settings(max_examples=count, deadline=None, derandomize=True, database=None)


def mirrored(run: Run) -> Run:
    """The same drive seen in a mirror: left is right."""
    columns = {name: run.column(name) for name in COLUMNS if name in MIRRORED}
    return dataclasses.replace(run, **{name: None if a is None else -a for name, a in columns.items()})


@cache
def case(effect: str = "rear_stiffness_error", magnitude: float = -0.25, duration: float = 3.0) -> list[Run]:
    return make_case(Truth({effect: magnitude}, {}, {"torque": 0.02}), CAR, np.random.default_rng(11), duration)


def cost(problem: Problem, theta: np.ndarray, names: tuple[str, ...]) -> float:
    return cost_of(problem, filter_case(problem, theta, names).filtered, theta)


@st.composite
def hypotheses(draw: st.DrawFn) -> dict[str, float]:
    """Up to two effects with magnitudes within their practical ranges."""
    names = draw(st.lists(st.sampled_from(list(CATALOGUE)), max_size=2, unique=True))
    return {name: draw(st.floats(*CATALOGUE[name].range_for(CAR)), label=name) for name in names}


def parameters(problem: Problem, nuisances: np.ndarray, effects: Mapping[str, float]) -> np.ndarray:
    return np.concatenate([nuisances, np.zeros(problem.nuisances - len(nuisances)), list(effects.values())])


@few(20)
@given(effects=hypotheses(), seed=st.integers(0, 1000))
def test_a_mirrored_case_has_mirrored_innovations(effects: dict[str, float], seed: int) -> None:
    one, other = (make_problem(runs, CAR) for runs in (case(), [mirrored(run) for run in case()]))
    nuisances, names = np.random.default_rng(seed).standard_normal(len(NUISANCES)), tuple(effects)
    turned = np.where(np.array(NUISANCES) == "steering_offset", -nuisances, nuisances)
    theta = parameters(one, nuisances, effects)
    theta_mirrored = parameters(one, turned, {name: -q if name in ODD else q for name, q in effects.items()})
    seen, seen_mirrored = filter_case(one, theta, names), filter_case(other, theta_mirrored, names)
    for run, e, e_mirrored in zip(one.runs, seen.innovations, seen_mirrored.innovations, strict=True):
        np.testing.assert_allclose(e_mirrored[run.counted], (SIGNS * e)[run.counted], rtol=1e-6, atol=1e-6)


def test_a_mirrored_case_has_the_mirrored_posterior() -> None:
    truth = {"steering_offset": 0.02}
    runs = make_case(Truth(truth, {}, {}), CAR, np.random.default_rng(3), 3.0)[:2]
    found = []
    for seen in (runs, [mirrored(run) for run in runs]):
        hypotheses = search(make_problem(seen, CAR), FEW, workers=1)
        found.append(make_posterior(hypotheses, 0.0, len(FEW), read_constants()))
    one, other = found
    assert one.causes == other.causes == tuple(truth)
    assert one.probabilities == pytest.approx(other.probabilities, abs=0.01)
    sigma = one.leading.deviations["steering_offset"]
    assert one.leading.magnitudes["steering_offset"] == pytest.approx(-other.leading.magnitudes["steering_offset"],
                                                                  abs=0.1 * sigma)  # fmt: skip
    assert sigma == pytest.approx(other.leading.deviations["steering_offset"], rel=0.01)


@few(5)
@given(effects=hypotheses(), order=st.permutations(range(4)))
def test_the_order_of_runs_does_not_matter(effects: dict[str, float], order: list[int]) -> None:
    runs, names = case(), tuple(effects)
    one, other = make_problem(runs, CAR), make_problem([runs[i] for i in order], CAR)
    costs = [cost(problem, parameters(problem, np.zeros(0), effects), names) for problem in (one, other)]
    assert costs[0] == pytest.approx(costs[1], rel=1e-9)


@few(3)
@given(
    effect=st.sampled_from(["rear_stiffness_error", "mass_error", "steering_offset", "torque_gain_error"]),
    share=st.sampled_from([-0.6, 0.6]),
    cut=st.floats(0.4, 0.6),
)
def test_a_case_cut_in_two_gives_compatible_magnitudes(effect: str, share: float, cut: float) -> None:
    truth = share * max(abs(q) for q in CATALOGUE[effect].range_for(CAR))
    runs = case(effect, truth, 6.0)[:2]
    parts = [runs, [r.rows(0, int(cut * len(r))) for r in runs], [r.rows(int(cut * len(r)), len(r)) for r in runs]]
    found = []
    for part in parts:
        problem = make_problem(part, CAR)
        theta = parameters(problem, np.zeros(0), {effect: 0.5 * truth})
        estimate = fit(problem, (effect,), theta)
        found.append((estimate.magnitudes[effect], estimate.deviations[effect]))
    (whole, sigma), (first, sigma_first), (second, sigma_second) = found
    assert abs(first - second) < APART * np.hypot(sigma_first, sigma_second)
    assert abs(whole - first) < APART * sigma_first
    assert abs(whole - second) < APART * sigma_second
    assert sigma < min(sigma_first, sigma_second)
