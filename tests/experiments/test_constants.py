"""Constants halved and doubled: every one is shown or said not to be, patched where it is read, and put back."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

from drift_drake.car.effects.catalogue import REFERENCE
from drift_drake.car.effects.magnitudes import Effects
from drift_drake.gap.estimation import baseline, prediction_constants, recordings_left_out
from drift_drake.gap.estimation.baseline import left_of
from drift_drake.gap.estimation.learn_normal import learn_normal
from drift_drake.gap.estimation.partial import partial_effects
from drift_drake.gap.estimation.scores import between_recordings, make_day, units
from drift_drake.gap.estimation.windows import windowed
from drift_drake.gap.evidence import alarms, left_out, left_over, ranking
from drift_drake.gap.evidence import constants as of_diagnosis
from drift_drake.gap.identification.by_prediction import prior_of
from experiments.other_worlds import constants, stretches
from experiments.other_worlds.constants import (
    NOT_SEEN,
    UNCHANGED,
    changed,
    constants_text,
    counted,
    counts_by_constant,
    learnt,
    names_of_constants,
    times,
    value_of,
)
from experiments.other_worlds.days import Days, first_guess
from experiments.other_worlds.days import make_day as make_runs
from experiments.other_worlds.stretches import REGULARS, Calibrated, KeptDay, Seen, kept_world, seen_of

NAMES = ("friction_level", "mass_error", "gyro_bias")
SCORES = len(NAMES) + len(partial_effects(NAMES))


def calibrated(steps, vehicle, *more):
    """A calibrated car, of whose baseline residuals only the names and units count here."""
    return Calibrated(vehicle, Effects(), SimpleNamespace(names=NAMES, units=steps), {}, *more)


def some_stretches(rng, recordings, off=0.0):
    """Stretches of as many recordings, two each, whose car is `off` units of friction away."""
    half = rng.standard_normal((2 * recordings, SCORES, 40))
    information = 10.0 * np.eye(SCORES) + np.einsum("kij,klj->kil", half, half)
    noise = np.einsum("kij,kj->ki", np.linalg.cholesky(information), rng.standard_normal((2 * recordings, SCORES)))
    recording = np.repeat(np.arange(recordings), 2)
    return baseline.Stretches(noise - off * information[:, :, 0], information, np.full(2 * recordings, 6.0),
                              np.ones(2 * recordings), recording)  # fmt: skip


@pytest.fixture
def world():
    rng = np.random.default_rng(0)
    own = some_stretches(rng, 4)
    total = own.information.sum(axis=0)
    seen = Seen(own, total / own.blocks.sum(), np.diag(total) / own.blocks.sum(), 1.0, int(own.blocks.sum()), 0.0,
                np.zeros((0, SCORES)))  # fmt: skip
    truths = (("none", 0.0), ("none", 0.0), ("friction_level", -4.0))
    days = [KeptDay(str(i), truth, False, dict.fromkeys(REGULARS, some_stretches(rng, 4, off)))
            for i, (truth, off) in enumerate(truths)]  # fmt: skip
    days.append(KeptDay("3", "unknown", True, dict.fromkeys(REGULARS, days[0].stretches[1.0])))
    n = len(NAMES)
    return calibrated(units(NAMES, REFERENCE), REFERENCE, np.ones(n), np.full(n, 0.1), np.ones(n, dtype=bool),
                      dict.fromkeys(REGULARS, seen)), days  # fmt: skip


def test_every_constant_is_shown_or_said_not_to_be():
    named = {name for module in (prediction_constants, of_diagnosis) for name in vars(module) if name.isupper()}
    shown = names_of_constants()
    assert {name.split(".")[0] for name in shown} | {n for n in NOT_SEEN if "." not in n} == named
    assert not set(shown) & set(NOT_SEEN)
    fields = {field.name for field in dataclasses.fields(of_diagnosis.PRIORS)}
    assert {name.removeprefix("PRIORS.") for name in (*shown, *NOT_SEEN) if name.startswith("PRIORS.")} <= fields


@pytest.mark.parametrize("name", [name for name in names_of_constants() if name != "REGULAR"])
def test_a_constant_is_another_one_in_the_modules_that_read_it(name):
    modules = [
        m
        for m in (baseline, recordings_left_out, left_out, left_over, ranking, alarms)
        if hasattr(m, name.split(".")[0])
    ]
    assert modules
    before = [repr(getattr(m, name.split(".")[0])) for m in modules]
    with changed(name, 2.0):
        assert all(repr(getattr(m, name.split(".")[0])) != old for m, old in zip(modules, before, strict=True))
    assert [repr(getattr(m, name.split(".")[0])) for m in modules] == before


def test_shares_keep_below_one():
    assert times(0.8, 2.0, odds=True) == pytest.approx(8.0 / 9.0)
    assert times(0.5, 0.5, odds=True) == pytest.approx(1.0 / 3.0)
    assert times({"a": (1.0, 2.0)}, 2.0, odds=False) == {"a": (2.0, 4.0)}
    assert value_of("PRIORS.temperature") == of_diagnosis.PRIORS.temperature


def test_days_are_counted(world):
    c = counted([world])
    assert (c.right["hits"], c.right["count"]) == (3, 3)
    assert (c.alarms["hits"], c.alarms["count"]) == (0, 2)
    assert (c.strange["hits"], c.strange["count"]) == (0, 1)  # it lies where a normal day does
    assert c.log_score < 0.0


def test_the_table_has_two_rows_a_constant(world):
    found = counts_by_constant([world])
    assert next(iter(found)) == UNCHANGED
    usual = found[UNCHANGED][1.0].log_score
    tells = [name for name, by in found.items() if any(c.log_score != usual for c in by.values())]
    assert {"HANGS", "TYRES_AND_BODY", "SCALE", "PRIORS.temperature", "ELSE", "WIDER"} <= set(tells)
    lines = constants_text(found).splitlines()
    assert sum(line.startswith("| SCALE |") for line in lines) == 2
    assert any(line.startswith("| THRESHOLDS | 0.001 ") and "| 2 (odds) |" in line for line in lines)
    assert "- SECOND: pairs" in lines


def test_what_is_learnt_is_what_a_calibration_learns():
    vehicle = first_guess("coupe")
    runs = make_runs(Days("unused", duration=5.0), {}, ("slalom", "circle"), 0)
    steps = units(NAMES, vehicle)
    day = make_day([windowed(run) for run in runs], vehicle.constants(), Effects(), NAMES, steps)
    prior = np.array([prior_of(name, vehicle, frozenset()) for name in NAMES]) / steps
    between, fitted = between_recordings(NAMES, vehicle) / steps, np.array([True, True, False])
    normal = learn_normal(day, NAMES, steps, prior, between, left_of(prior, fitted)).normal
    seen = {1.0: seen_of(day, normal.scales, normal.precision)}
    spread, shown = learnt(calibrated(steps, vehicle, prior, between, fitted, seen), 1.0)
    np.testing.assert_allclose(shown.known.mean, normal.expected)
    np.testing.assert_allclose(shown.known.covariance, normal.left_open)
    np.testing.assert_allclose(spread.covariance, normal.covariance)
    np.testing.assert_allclose(shown.factors, normal.factors)
    assert shown.scale == pytest.approx(normal.scale)


def test_a_world_is_read_once(tmp_path, monkeypatch, world, capsys):
    asked = []

    def calibrate(_world, folder):
        asked.append(folder)
        return world[0]

    def read(case, _car):
        asked.append(case.name)
        if case.name == "bb":
            raise stretches.DriftDrakeError("bb: 1.2 s of driving can be used")
        return world[1][0].stretches

    monkeypatch.setattr(stretches, "calibrated", calibrate)
    monkeypatch.setattr(stretches, "day_of", read)
    for code in ("aa", "bb", "day_one"):
        (tmp_path / "world" / code).mkdir(parents=True)
        (tmp_path / "world" / code / "run_0.csv").touch()
    (tmp_path / "world" / "labels.json").write_text('{"aa": {"effects": {}, "strange": "x"}, "bb": {"effects": {}}}')
    for _ in range(2):
        kept = kept_world(tmp_path / "world", "day_one_4", tmp_path / "out")
    assert asked == ["day_one_4", "aa", "bb", "bb"]
    assert [(day.code, day.truth, day.strange) for day in kept[1]] == [("aa", "unknown", True)]
    assert "left out: bb: 1.2 s" in capsys.readouterr().out
    assert constants.counted([kept]).strange["count"] == 1
