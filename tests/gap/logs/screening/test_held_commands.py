"""A command that stands still in a log while the car answers another one is left out; one that is held is not."""

import dataclasses

import numpy as np
import pytest

from drift_drake.gap.logs.screening.held_commands import frozen_command
from drift_drake.gap.logs.screening.screened import screen

COMMANDS = ("delta_cmd", "tau_cmd")


def columns(run):
    return {name: run.column(name) for name in ("r", "v", "beta", *COMMANDS)}


def stopped(run, name, start, value=None):
    """The run with a command that stands still for 2.5 s, at its value there or at another."""
    changed = run.column(name).copy()
    changed[start : start + 250] = changed[start] if value is None else value
    return dataclasses.replace(run, **{name: changed})


def test_commands_of_good_logs_are_left_as_they_are(good_cases):
    for runs in good_cases.values():
        for run in runs:
            assert [frozen_command(name, columns(run), run.period) for name in COMMANDS] == [[], []]


@pytest.mark.parametrize(("name", "value"), [("delta_cmd", None), ("delta_cmd", 0.0), ("tau_cmd", 0.0)])
def test_a_command_that_freezes_or_is_lost_is_said_and_left_out(good_cases, name, value):
    found = []
    for run in [run for runs in good_cases.values() for run in runs[:3] if len(run) > 900]:
        clean, said = screen(stopped(run, name, 500, value))
        parts = [part for part in clean.bad if part.column == name]
        assert len(parts) == sum("stands still" in one for one in said)
        assert all(part.start <= 500 < part.stop and part.kind == "frozen" for part in parts)
        found += [clean.mask()[600] for _ in parts]
    assert found
    assert all(found)


def test_a_steady_corner_and_its_steps_are_no_frozen_command():
    t = 0.01 * np.arange(3000)
    steps = np.repeat([0.02, 0.05, -0.03, 0.04, 0.0, -0.05], 500)  # each held for 5 s
    lively = 0.04 * np.sin(1.3 * t) * (t < 20.0)
    delta = np.where(t < 20.0, lively, steps)
    answered = np.convolve(np.pad(delta, (40, 0), mode="edge"), np.exp(-np.arange(41) / 10.0), "valid")
    v = 15.0 + 2.0 * np.sin(0.2 * t)
    r = answered / np.sum(np.exp(-np.arange(41) / 10.0)) * v / (2.6 + 0.003 * v**2)
    log = {"delta_cmd": delta, "v": v, "r": r + 0.004 * np.random.default_rng(0).standard_normal(3000)}
    assert frozen_command("delta_cmd", log, 0.01) == []
    frozen = delta.copy()
    frozen[700:1000] = delta[700]
    (span,) = frozen_command("delta_cmd", log | {"delta_cmd": frozen}, 0.01)
    assert span == (700, 1000)
