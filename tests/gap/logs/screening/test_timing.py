"""The column that is on another clock is named, not those that it is held against."""

import dataclasses
import re

import numpy as np
import pytest
from kinematic_log import kinematic_log

from drift_drake.car.log.table import Run
from drift_drake.gap.logs.screening.consistency import consistency_of
from drift_drake.gap.logs.screening.timing import late_columns

MASS, INERTIA, AHEAD, BEHIND = 1500.0, 2500.0, 1.2, 1.4  # [kg], [kg m^2], [m], [m]
FRONT, REAR = 8e4, 1e5  # [N/rad]
PERIOD = 0.01
NOISE = {"r": 0.004, "psi": 0.002, "beta": 0.003, "v": 0.02}


def driven(speed: float, seed: int = 0, seconds: float = 40.0) -> Run:
    """A bicycle on linear tyres that steers to and fro at a steady speed [m/s]."""
    rng, rows = np.random.default_rng(seed), round(seconds / PERIOD)
    t = PERIOD * np.arange(rows)
    phases = rng.uniform(0.0, 2.0 * np.pi, 3)
    wave = np.sum([np.sin(2.0 * np.pi * f * t + p) for f, p in zip((0.11, 0.23, 0.37), phases, strict=True)], axis=0)
    delta = min(0.08, 1.2 / speed**2) * wave
    z, out, step = np.zeros(2), [], 0.2 * PERIOD
    for row in range(rows):
        out.append(z)
        for _ in range(5):
            r, beta = z
            front = FRONT * (delta[row] - beta - AHEAD * r / speed)
            rear = REAR * (-beta + BEHIND * r / speed)
            z = z + step * np.array([(AHEAD * front - BEHIND * rear) / INERTIA, (front + rear) / (MASS * speed) - r])
    r, beta = np.array(out).T
    v = np.full(rows, speed)
    psi = np.cumsum(r) * PERIOD
    read = {name: values + NOISE.get(name, 0.0) * rng.normal(size=rows)
            for name, values in {"r": r, "v": v, "beta": beta, "psi": psi}.items()}  # fmt: skip
    return Run(name="run", t=t, delta_cmd=delta, **read)


def late(run: Run, name: str, seconds: float) -> Run:
    """The run with a column that is logged so much later than it is measured."""
    return dataclasses.replace(run, **{name: np.interp(run.t - seconds, run.t, getattr(run, name))})


def said(*runs: Run) -> list[str]:
    columns = [{name: run.column(name) for name in ("r", "v", "beta", "psi", "delta_cmd")} for run in runs]
    return [doubt.sentence for doubt in late_columns(columns, [run.period for run in runs])]


@pytest.mark.parametrize("speed", [4.0, 7.0, 14.0, 25.0])
@pytest.mark.parametrize("seed", [0, 1])
def test_clocks_that_agree_get_no_sentence(speed, seed):
    assert said(driven(speed, seed)) == []


@pytest.mark.parametrize("time", [0.3, 0.8, -0.4])
def test_a_late_sideslip_is_named_with_its_time(time):
    (sentence,) = said(late(driven(5.0), "beta", time))
    assert sentence.startswith(f"beta comes {abs(time):.1f}"[:14])
    assert f"{'later' if time > 0.0 else 'earlier'} than r, psi and delta_cmd" in sentence
    offset = float(sentence.rsplit("offset: ", 1)[1])
    assert offset == pytest.approx(-time, abs=0.08)


def test_a_late_yaw_rate_is_not_taken_for_early_commands():
    """All else agrees: the heading, the steering, the lateral speed."""
    (sentence,) = said(late(driven(5.0), "r", 0.4))
    assert sentence.startswith("r comes 0.4")
    assert "later than psi, delta_cmd and beta" in sentence
    assert float(sentence.rsplit("offset: ", 1)[1]) == pytest.approx(-0.4, abs=0.05)


def test_commands_that_lead_all_else_are_named_alone():
    (sentence,) = said(late(driven(14.0), "delta_cmd", -0.4))
    assert sentence.startswith("commands lead the motion by")


def test_two_columns_that_disagree_leave_open_which_is_late():
    run = late(driven(14.0), "r", 0.4).without("beta")
    columns = {name: run.column(name) for name in ("r", "v", "psi")}
    (found,) = late_columns([columns], [PERIOD])
    assert re.match(r"psi comes 0\.(39|4) s .* earlier than r, and no other column tells", found.sentence)


def test_a_doubtful_acceleration_hides_no_clock():
    """Each has its sentence, and what a late column alone contradicts has none."""
    log = kinematic_log()
    mistaken = late(dataclasses.replace(log, ax=0.5 * log.ax), "r", 0.4)
    late_yaw_rate, scale = consistency_of([mistaken]).doubts
    assert re.match(r"r comes 0\.4.* s .* later than psi", late_yaw_rate.sentence)
    assert scale.sentence.startswith("column ax reads 50 % too small")


def test_a_turn_or_two_of_slow_driving_say_nothing_of_the_sideslip():
    assert said(late(driven(5.0, seconds=8.0), "beta", 0.8)) == []
