"""From logs to samples."""

import numpy as np
import pandas as pd

from drift_drake.drive.learnt.command_lag import LAGGED, lagged_commands
from drift_drake.drive.learnt.samples import samples_from_log
from experiments.model.drives import all_phases


class Ramp:
    """A path whose curvature grows along it."""

    def curvature(self, s: np.ndarray) -> np.ndarray:
        return 0.01 * s


def log(rows: int) -> pd.DataFrame:
    k = np.arange(rows, dtype=float)
    columns = ("r", "v", "beta", "omega_r", "e", "dphi", "s", "delta_cmd", "tau_cmd")
    return pd.DataFrame({"t": 0.01 * k} | {name: 100.0 * i + k for i, name in enumerate(columns)})


def test_every_tenth_row_makes_a_sample() -> None:
    samples = samples_from_log(log(35), None, vehicle=3, drive=7, phase=2)
    np.testing.assert_array_equal(samples.x[:, 0], [2, 12, 22])
    np.testing.assert_array_equal(samples.x_next[:, 5], 500 + np.array([12, 22, 32]))
    np.testing.assert_array_equal(samples.u[:, 1], 800 + np.array([2, 12, 22]))
    np.testing.assert_array_equal(samples.u_next[:, 0], 700 + np.array([12, 22, 32]))
    assert set(samples.vehicle) == {3}
    assert set(samples.drive) == {7}
    np.testing.assert_array_equal(samples.curvature, 0.0)


def test_lagged_commands_are_those_of_the_whole_log() -> None:
    """Not of every tenth row, and settled where the log begins, whatever the phase."""
    table = log(35)
    table["delta_cmd"], table["tau_cmd"] = np.random.default_rng(0).normal(size=(2, 35)) * [[0.3], [100.0]]
    every = lagged_commands(table["t"].to_numpy(), table[["delta_cmd", "tau_cmd"]].to_numpy())
    for phase in (0, 4):
        samples = samples_from_log(table, None, 0, 0, phase)
        np.testing.assert_array_equal(samples.x[:, LAGGED], every[[phase, phase + 10, phase + 20]])
        np.testing.assert_array_equal(samples.x_next[:, LAGGED], every[[phase + 10, phase + 20, phase + 30]])


def test_curvature_is_the_mean_over_the_step() -> None:
    samples = samples_from_log(log(31), Ramp(), 0, 0)
    np.testing.assert_allclose(samples.curvature, 0.01 * (600 + np.array([5, 15, 25])))


def test_a_log_shorter_than_a_step_has_no_sample() -> None:
    assert len(samples_from_log(log(10), None, 0, 0).x) == 0


def test_phases_become_drives_of_their_own() -> None:
    drives = [[samples_from_log(log(40), None, 0, d, phase) for d in range(2)] for phase in range(3)]
    together = all_phases(drives)
    assert list(np.unique(together.drive)) == [0, 1, 2, 3, 4, 5]
    np.testing.assert_array_equal(together.where(together.drive == 3).x, drives[1][1].x)
