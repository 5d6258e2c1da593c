"""Strange faults change what they say, and nothing else; a play of the steering is one that a wheel would follow."""

import numpy as np
import pytest

from drift_drake.car.effects.catalogue import CATALOGUE, REFERENCE
from drift_drake.car.log.table import Run
from experiments.other_worlds.days import single_track
from experiments.other_worlds.strange_faults import STRANGE, strange_day

PERIOD = 0.01
COMMANDS = {"delta_cmd", "tau_cmd"}
CHANGED = {
    "sideslip_gain": {"beta"}, "sideslip_by_speed": {"beta"}, "gyro_drift": {"r"}, "gyro_wander": {"r"},
    "heading_drift": {"psi"}, "coarse_wheel_speed": {"omega_r"}, "held_wheel_speed": {"omega_r"},
    "stretched_clock": {"r", "v", "beta", "omega_r", "psi"} | COMMANDS, "jittered_commands": COMMANDS,
    "held_commands": COMMANDS, "steering_backlash": {"delta_cmd"}, "nonlinear_steering": {"delta_cmd"},
    "one_sided_steering": {"delta_cmd"}, "torque_dead_zone": {"tau_cmd"}, "torque_ceiling": {"tau_cmd"},
    "torque_by_speed": {"tau_cmd"},
}  # fmt: skip


@pytest.fixture
def run():
    t = np.arange(600) * PERIOD
    v = 12.0 + 2.0 * np.sin(0.5 * t)
    return Run("run_0", t, 0.4 * np.sin(2.0 * t), v, 0.1 * np.sin(2.5 * t), 40.0 + 60.0 * np.sin(t),
               0.05 * np.sin(2.0 * t), 1.01 * v, psi=0.3 * np.sin(t))  # fmt: skip


def put(kind, run, q, seed=0):
    return STRANGE[kind].put(run, q, np.random.default_rng(seed))


def test_there_are_twelve_kinds_and_more_that_the_catalogue_lacks():
    assert len(STRANGE) >= 12
    assert set(STRANGE) == set(CHANGED)
    assert not set(STRANGE) & set(CATALOGUE)


@pytest.mark.parametrize("kind", STRANGE)
def test_a_fault_changes_its_columns_alone_and_is_made_again_from_its_seed(run, kind):
    (one,), q = strange_day([run], kind, REFERENCE, np.random.default_rng(3))
    (again,), same = strange_day([run], kind, REFERENCE, np.random.default_rng(3))
    changed = {name for name in ("r", "v", "beta", "omega_r", "psi", "delta_cmd", "tau_cmd")
               if not np.array_equal(one.column(name), run.column(name))}  # fmt: skip
    assert changed == CHANGED[kind]
    assert len(one) == len(run)
    assert q == same
    for name in changed:
        np.testing.assert_array_equal(one.column(name), again.column(name))


def test_a_wheel_with_that_play_follows_the_logged_command_to_where_it_was(run):
    q, command = 0.03, put("steering_backlash", run, 0.03).delta_cmd
    wheel = np.empty(len(command))
    wheel[0] = run.delta_cmd[0]
    for i in range(1, len(wheel)):
        wheel[i] = np.clip(wheel[i - 1], command[i] - 0.5 * q, command[i] + 0.5 * q)
    np.testing.assert_allclose(wheel, run.delta_cmd, atol=4e-3)
    assert np.max(np.abs(command - run.delta_cmd)) == pytest.approx(0.5 * q)


def test_a_torque_below_the_dead_zone_does_nothing(run):
    tau, most = put("torque_dead_zone", run, 0.3).tau_cmd, np.quantile(np.abs(run.tau_cmd), 0.95)
    came = np.sign(tau) * np.maximum(np.abs(tau) - 0.3 * most, 0.0)
    np.testing.assert_allclose(came, run.tau_cmd, atol=0.05 * most)


def test_a_clock_that_runs_fast_slows_what_is_logged(run):
    slow = put("stretched_clock", run, 0.03)
    np.testing.assert_allclose(slow.psi, 0.3 * np.sin(run.t / 1.03), atol=1e-4)


def test_a_drift_is_in_one_sensor_alone(run):
    assert put("gyro_drift", run, 0.05).r[-1] - run.r[-1] == pytest.approx(0.05)
    np.testing.assert_allclose(put("heading_drift", run, 0.03).psi - run.psi, 0.03 * run.t)


def test_commands_are_early_by_no_more_than_the_jitter(run):
    early = np.interp(put("jittered_commands", run, 0.08).tau_cmd[:100], run.tau_cmd[:140], run.t[:140]) - run.t[:100]
    assert -1e-9 <= early.min() < 0.04 < early.max() <= 0.08 + 1e-9


def test_sizes_follow_the_cars():
    small = single_track("small")
    low, high = STRANGE["gyro_drift"].range_for(small)
    assert low > STRANGE["gyro_drift"].low
    drawn = [STRANGE["gyro_drift"].drawn(small, np.random.default_rng(seed)) for seed in range(20)]
    assert {np.sign(q) for q in drawn} == {-1.0, 1.0}
    assert all(low - 1e-4 <= abs(q) <= high + 1e-4 for q in drawn)
    assert STRANGE["sideslip_gain"].range_for(small) == (0.2, 0.35)


def test_a_column_that_its_fault_needs_is_named(run):
    with pytest.raises(ValueError, match="column beta is missing"):
        put("sideslip_gain", run.without("beta"), 0.3)
