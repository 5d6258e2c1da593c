"""Which parts of long logs are asked."""

import dataclasses

import numpy as np
import pytest

from drift_drake.car.log.table import Run
from drift_drake.car.parameters import VehicleParameters
from drift_drake.gap.choose.usable_drives import MOST_SECONDS, PIECE, asked_parts, liveliness

CAR = VehicleParameters()


def drive(name: str, seconds: float, lateral: float) -> Run:
    """A run at 15 m/s that reaches a lateral acceleration [m/s^2]."""
    t = 0.01 * np.arange(round(100 * seconds))
    one = np.ones_like(t)
    r = lateral / 15.0 * np.sin(t)
    return Run(name=name, t=t, r=r, v=15.0 * one, beta=0.0 * t, omega_r=15.0 * one, delta_cmd=0.1 * np.sin(t),
               tau_cmd=50.0 * one)  # fmt: skip


def test_short_logs_are_asked_whole() -> None:
    runs = [drive("a", 4.5, 12.0), drive("b", 4.5, 12.0)]
    assert asked_parts(runs, CAR) == (runs, [])


def test_two_drives_that_are_logged_to_their_last_moment_are_asked_whole() -> None:
    """As gathering logs them: 451 rows in 4.5 s."""
    runs = [drive("a", 4.51, 12.0), drive("b", 4.51, 12.0)]
    assert [len(run) for run in runs] == [451, 451]
    assert asked_parts(runs, CAR) == (runs, [])


@pytest.mark.parametrize("seconds", [20.0, 96.0, 3600.0])
def test_of_long_logs_so_many_seconds_are_asked_and_it_is_said(seconds: float) -> None:
    parts, said = asked_parts([drive("a", seconds, 12.0)], CAR)
    total = sum(len(run) * run.period for run in parts)
    assert MOST_SECONDS - PIECE < total <= MOST_SECONDS + 0.02
    assert said == [f"of {seconds:.0f} s of logs {total:.0f} s are asked: {len(parts)} pieces spread evenly over them"]
    assert len({run.name for run in parts}) == len(parts)
    starts = [float(run.t[0]) for run in parts]
    assert starts == sorted(starts)


def test_lively_parts_come_first() -> None:
    runs = [drive("gentle", 60.0, 2.0), drive("lively", 9.0, 13.0), drive("more", 60.0, 2.0)]
    parts, said = asked_parts(runs, CAR)
    assert {run.name.split()[0] for run in parts} == {"lively"}
    assert "their lively parts" in said[0]
    assert liveliness(runs[1]) > CAR.friction * CAR.gravity > liveliness(runs[0])


def test_which_parts_are_asked_depends_on_the_logs_alone() -> None:
    runs = [drive("a", 50.0, 12.0)]
    names = [run.name for run in asked_parts(runs, CAR)[0]]
    other = [dataclasses.replace(runs[0], beta=0.01 * np.cos(runs[0].t))]
    assert [run.name for run in asked_parts(other, CAR)[0]] == names
