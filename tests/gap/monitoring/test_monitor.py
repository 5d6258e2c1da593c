"""The monitor over a drive: its sums are those of the whole log at once, and it names what changed, and when."""

import numpy as np
import pytest

from drift_drake.car.effects.magnitudes import Effects, make_effects
from drift_drake.car.parameters import VehicleParameters
from drift_drake.gap.estimation.filter_state import CHANNELS
from drift_drake.gap.monitoring import bank as filters
from drift_drake.gap.monitoring.events import sentence
from drift_drake.gap.monitoring.evidence import Sums, no_sums
from drift_drake.gap.monitoring.history import since
from drift_drake.gap.monitoring.monitor import SETTLING, with_row
from drift_drake.gap.monitoring.watch import monitor_of, rows_of, watched
from experiments.monitoring.drives import changed_drive
from experiments.monitoring.limits import limits

ONSET = 2.5  # [s] in `changed_run`


def states(monitor, run, stop=None):
    state, out = monitor.start(), []
    for row in list(rows_of(run))[:stop]:
        state = monitor.after_row(state, row.y, row.command, row.t)
        out.append(state)
    return out


def test_recursive_scores_are_those_of_the_whole_log(monitor, changed_run, commands):
    rows, stop = list(rows_of(changed_run)), 191
    state = filters.make_state(monitor.bank)
    y = np.array([np.where(monitor.used, row.y, 0.0) for row in rows])
    filters.start_bank(y[0], monitor.used, commands[0], monitor.bank, state)
    e = np.array([filters.advance_bank(y[k], monitor.used, commands[k], monitor.bank, state) for k in range(1, stop)])
    first = round(SETTLING / changed_run.period) - 1
    nu = e[first:, 0][:, monitor.used]
    g = nu[:, None] - e[first:, 1:][:, :, monitor.used]
    _, recent = since(states(monitor, changed_run, stop)[-1].history)
    np.testing.assert_allclose(recent.score[-1], np.einsum("kpc,kc->p", g, nu), rtol=1e-9, atol=1e-6)
    np.testing.assert_allclose(recent.information[-1], np.einsum("kpc,kqc->pq", g, g), rtol=1e-9, atol=1e-6)
    assert recent.rows[-1] == len(nu)


def test_a_bank_that_is_lost_begins_anew_and_what_was_found_stays(monitor, changed_run):
    rows = list(rows_of(changed_run))
    state = states(monitor, changed_run, 100)[-1]
    z = state.bank.z.copy()
    z[3] = np.nan
    after = monitor.after_row(
        state._replace(bank=state.bank._replace(z=z)), rows[100].y, rows[100].command, rows[100].t
    )
    assert after.clock[0] == 0.0
    for row in rows[101:200]:
        after = monitor.after_row(after, row.y, row.command, row.t)
    assert np.isfinite(after.bank.z).all()
    _, sums = since(after.history)
    assert sums.rows[-1] > 100  # of those before, too


def test_a_row_far_off_is_clipped():
    zero = Sums(*(np.zeros(()) for _ in range(3)), np.zeros(1), np.zeros((1, 1)))
    used = np.ones(len(CHANNELS), dtype=bool)
    rows = [with_row(zero, np.stack([np.full(9, size), np.zeros(9)]), used) for size in (1.0, 1e3, 1e6)]
    assert rows[0].energy == 9.0
    assert rows[1].energy == pytest.approx(float(rows[2].energy))


def test_the_change_is_named_and_its_onset_found(changed_run):
    monitor = monitor_of(changed_run, VehicleParameters(), Effects())
    reported = [event for judged in watched(monitor, rows_of(changed_run)) for event in judged.events]
    assert reported[0]["event"] == "change"
    assert reported[0]["t"] > ONSET
    last = reported[-1]
    assert last["cause"] == "rear_stiffness_error"
    assert last["low"] - 0.05 < -0.25 < last["high"] + 0.05
    assert last["onset"] == pytest.approx(ONSET, abs=0.3)
    assert "rear_stiffness_error" in sentence(last)


def test_the_simulators_own_car_raises_no_alarm():
    run = changed_drive("slalom", Effects(), 2.0, seed=5, duration=5.0)
    monitor = monitor_of(run, VehicleParameters(), Effects())
    assert all(not judged.events for judged in watched(monitor, rows_of(run)))


def test_missing_readings_are_waited_through(monitor, changed_run):
    state = monitor.start()
    for i, row in enumerate(list(rows_of(changed_run))[:150]):
        y = np.full_like(row.y, np.nan) if 60 <= i < 70 else row.y
        state = monitor.after_row(state, y, row.command, row.t)
    assert np.isfinite(state.verdict[:-4]).all()
    assert state.verdict[0] > 0.5


def test_a_change_that_is_over_is_reported():
    effects, end = make_effects({"friction_level": -0.25}), 4.5
    run = changed_drive("power", effects, ONSET, seed=6, duration=8.0, until=end)
    monitor = monitor_of(run, VehicleParameters(), Effects())
    reported = [event for judged in watched(monitor, rows_of(run)) for event in judged.events]
    over = [event["t"] for event in reported if event["event"] == "over"]
    assert over
    assert over[0] > end
    assert any(event.get("cause") == "friction_level" for event in reported)


def test_limits_fall_with_time_and_are_not_below_what_was_seen(monitor, changed_run):
    """Twice the time halves a limit at the most; an effect beyond its limit is seen, one at zero has none."""
    n = len(monitor.problem.nodes)
    history = states(monitor, changed_run, 240)[-1].history
    ages, recent = since(history)
    nothing = no_sums(n)
    found = [limits(monitor.problem, Sums(*(a[i] for a in recent)), nothing, 1.0, 0.05)
             for i in (len(ages) // 2, -1)]  # fmt: skip
    for short, long in zip(*found, strict=True):
        assert 0.0 < long.detected <= short.detected
        assert long.named >= long.detected
