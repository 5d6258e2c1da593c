"""Symmetries of a diagnosis by prediction: mirrored logs, runs in another order, a day cut in two."""

import dataclasses

import numpy as np
import pytest

from drift_drake.car.effects.magnitudes import Effects
from drift_drake.car.log.table import COLUMNS, Run
from drift_drake.gap.diagnosis.calibrated.diagnose_change import diagnose_change
from drift_drake.gap.estimation.normal import Normal
from drift_drake.gap.estimation.partial import DRIVING, partial_effects
from drift_drake.gap.estimation.windows import HORIZONS, PREDICTED
from drift_drake.gap.logs.wording.conversion import MIRRORED

ODD = ("steering_offset", "gyro_bias", "sideslip_bias", "road_bank")  # effects that a mirror turns the sign of
TURNED = ("direction of the turn", "direction of steering", "sideslip")  # functions of the driving, likewise
MIRRORED_FREE = ("heading drift", "yaw moment")  # free directions, likewise
FEW = ("steering_delay", "gyro_bias", "mass_error")
APART = 5.0  # standard deviations
TWO_SIDED = 1.96


def mirrored_run(run: Run) -> Run:
    """The same drive seen in a mirror: left is right."""
    columns = {name: run.column(name) for name in COLUMNS if name in MIRRORED}
    return dataclasses.replace(run, **{name: None if a is None else -a for name, a in columns.items()})


def mirrored_normal(normal: Normal) -> Normal:
    """The baseline of the car that is the mirror's image of a car."""
    channels = np.array([-1.0 if name in MIRRORED else 1.0 for name in PREDICTED])
    of_errors = np.tile(channels, HORIZONS)
    effects = np.array([-1.0 if name in ODD else 1.0 for name in normal.names])
    both, names = np.outer(effects, effects), list(normal.names)
    functions = np.array([-1.0 if name in TURNED else 1.0 for name in DRIVING])
    of_parts = [effects[names.index(p.effect)] * functions[DRIVING.index(p.driving)] if p.driving
                else -1.0 if p.effect in MIRRORED_FREE else 1.0 for p in partial_effects(names)]  # fmt: skip
    scores = np.concatenate([effects, of_parts])
    return dataclasses.replace(
        normal, offset=normal.offset * channels, precision=normal.precision * np.outer(of_errors, of_errors),
        standard=normal.standard * np.stack([functions, np.ones(len(DRIVING))]), expected=normal.expected * scores,
        covariance=normal.covariance * np.outer(scores, scores),
        left_open=normal.left_open * np.outer(scores, scores),
        unknown=normal.unknown * both, recording=normal.recording * both,
    )  # fmt: skip


def mirrored_effects(effects: Effects) -> Effects:
    return effects._replace(**{name: -getattr(effects, name) for name in ODD})


@pytest.fixture(scope="module")
def biased_runs(other_car) -> list[Run]:
    """Half a day whose yaw-rate sensor is off by 0.04 rad/s."""
    return other_car.day({"gyro_bias": 0.04}, 4, duration=7.0)[:2]


@pytest.fixture(scope="module")
def biased_day(biased_runs, diagnosed):
    return diagnosed(biased_runs, "biased", FEW)


def test_a_mirrored_day_has_the_mirrored_answer(other_car, biased_runs, biased_day):
    car = other_car.found
    other = diagnose_change(
        [mirrored_run(run) for run in biased_runs], car.vehicle, mirrored_normal(other_car.normal),
        mirrored_effects(car.effects), "mirrored", 1, catalogue=FEW,
    ).answer  # fmt: skip
    one = biased_day.answer
    assert one.causes == other.causes == ["gyro_bias"]
    # Derivatives are one-sided differences: those of a mirrored effect are taken on the other side.
    assert one.posterior == pytest.approx(other.posterior, abs=3e-3)
    a, b = one.magnitudes["gyro_bias"], other.magnitudes["gyro_bias"]
    assert [a.estimate, a.low, a.high] == pytest.approx([-b.estimate, -b.high, -b.low], rel=3e-3)


def test_the_order_of_runs_does_not_matter(biased_runs, biased_day, diagnosed):
    again, one = diagnosed(biased_runs[::-1], "reversed", FEW).answer, biased_day.answer
    assert again.posterior == pytest.approx(one.posterior, abs=1e-6)
    assert again.magnitudes["gyro_bias"].estimate == pytest.approx(one.magnitudes["gyro_bias"].estimate, rel=1e-6)


def test_a_day_cut_in_two_gives_compatible_magnitudes(biased_runs, biased_day, diagnosed):
    parts = [
        [run.rows(0, len(run) // 2) for run in biased_runs],
        [run.rows(len(run) // 2, len(run)) for run in biased_runs],
    ]
    found = [diagnosed(part, "part", FEW).answer.magnitudes["gyro_bias"] for part in parts]
    found.append(biased_day.answer.magnitudes["gyro_bias"])
    for i, a in enumerate(found):
        for b in found[:i]:
            spread = np.hypot(a.high - a.low, b.high - b.low) / (2.0 * TWO_SIDED)
            assert abs(a.estimate - b.estimate) < APART * spread
