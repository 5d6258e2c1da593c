"""The log that `drift-drake drive` leaves is one that the other commands read."""

import numpy as np
import pandas as pd

from drift_drake.car.log.table import read_run
from drift_drake.cli.drive_run import as_logged
from drift_drake.common.safe_files import write_table


def test_a_drive_is_a_run_of_the_log_format(tmp_path):
    t = 0.01 * np.arange(80)
    states = {"r": 0.2 * np.sin(t), "v": 12.0 + t, "beta": -0.1 + 0.0 * t, "omega_r": 12.5 + t, "psi": 0.1 * t}
    commands = {"delta": 0.05 * np.cos(t), "tau": 120.0 + t}
    table = pd.DataFrame({"t": t, "x": 12.0 * t, "y": 0.1 * t, "s": 12.0 * t} | states | commands)
    for name, values in states.items():
        table[f"measured_{name}"] = values + 0.001
    table.loc[[0, 30], "measured_r"] = np.nan  # readings that did not come
    write_table(as_logged(table), tmp_path / "run_0.csv", index=False, float_format="%.9g")
    run = read_run(tmp_path / "run_0.csv")
    np.testing.assert_allclose(run.v, table["measured_v"])
    np.testing.assert_allclose(run.delta_cmd, commands["delta"], atol=1e-8)
    np.testing.assert_allclose(run.tau_cmd, commands["tau"])
    assert run.r[30] == run.r[29]
    assert run.ax is None
