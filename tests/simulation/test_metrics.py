"""What is said of a run, on made-up runs."""

import numpy as np
import pandas as pd
import pytest

from drift_drake.control.mpc import FOLLOWED
from drift_drake.reference.trajectory import Reference, figure_8, straight_line
from drift_drake.simulation.metrics import before_spin, drifting_share, run_metrics
from drift_drake.vehicle.parameters import VehicleParameters

PARAMETERS = VehicleParameters()


@pytest.fixture(scope="module")
def reference() -> Reference:
    return figure_8(PARAMETERS)


def on_the_reference(reference: Reference, share: float = 1.0) -> pd.DataFrame:
    """A run without any error over the first part of the reference."""
    s = np.linspace(0.0, share * reference.distance, 2000)
    columns = dict(zip(("r", "v", "beta", "omega_r", "e", "dphi"), reference.state(s).T, strict=True))
    work = ("restart", "failures", "step", "iterations", "qp_fallbacks", "qp_unsolved")
    zeros = {f"solve_{name}": np.zeros(len(s)) for name in work}
    return pd.DataFrame({"t": reference.time(s), "s": s, **columns, **zeros, "solve_seconds": 1e-3})


def test_a_run_on_the_reference(reference: Reference) -> None:
    metrics = run_metrics(on_the_reference(reference), "completed", reference, PARAMETERS.steering_limit)
    assert metrics.completed
    assert metrics.completion == metrics.drifting == 1.0
    assert metrics.rms_e == 0.0
    assert metrics.rms_sideslip_error == pytest.approx(0.0, abs=1e-12)


def test_each_error_is_the_root_mean_square_of_its_own_state(reference: Reference) -> None:
    """Errors put in by hand: half of the rows off by twice as much have sqrt(2.5) times the root mean square."""
    table = on_the_reference(reference)
    factor = np.where(np.arange(len(table)) % 2, 2.0, 1.0)
    put_in = {"e": 0.05, "beta": 0.02, "r": -0.03, "v": 0.4}
    for name, error in put_in.items():
        table[name] += error * factor
    metrics = run_metrics(table, "completed", reference, PARAMETERS.steering_limit)
    found = (metrics.rms_e, metrics.rms_sideslip_error, metrics.rms_yaw_rate_error, metrics.rms_speed_error)
    assert found == pytest.approx([abs(error) * np.sqrt(2.5) for error in put_in.values()], rel=1e-9)
    assert metrics.max_e == pytest.approx(0.1)


def test_a_spin_is_cut_where_the_sideslip_last_was_within_the_steering_lock(reference: Reference) -> None:
    table = on_the_reference(reference, share=0.5)
    table.loc[500:502, "beta"] = 0.9  # caught again
    table.loc[1900:, "beta"] = np.linspace(0.7, 1.4, 100)
    table.loc[1900:, "e"] = 3.0
    assert len(before_spin(table, PARAMETERS.steering_limit)) == 1900
    spun = run_metrics(table, "spin", reference, PARAMETERS.steering_limit)
    assert spun.rms_e == spun.max_e == 0.0
    assert spun.completion == pytest.approx(0.5)
    left = run_metrics(table, "left the lane", reference, PARAMETERS.steering_limit)
    assert left.max_e == 3.0


def test_a_run_that_is_beyond_the_lock_throughout_keeps_its_first_row(reference: Reference) -> None:
    table = on_the_reference(reference).assign(beta=1.2)
    assert len(before_spin(table, PARAMETERS.steering_limit)) == 1


def test_drifting_counts_the_steady_drifts_wanted(reference: Reference) -> None:
    table = on_the_reference(reference)
    assert drifting_share(table.assign(beta=0.6 * table["beta"]), reference) == 1.0
    assert drifting_share(table.assign(beta=0.4 * table["beta"]), reference) == 0.0
    assert drifting_share(table.assign(beta=-table["beta"]), reference) == 0.0
    half = drifting_share(on_the_reference(reference, share=0.5), reference)
    assert half == pytest.approx(0.5, abs=0.02)
    straight = straight_line(10.0, 12.0, 4.0)
    assert np.isnan(drifting_share(on_the_reference(straight), straight))


def test_late_plans_and_those_of_the_fallback_are_counted(reference: Reference) -> None:
    table = on_the_reference(reference).assign(t=0.01 * np.arange(2000), solve_iterations=1.0)
    table.loc[100:102, "solve_seconds"] = 0.011
    table.loc[100:101, ["solve_qp_fallbacks", "solve_iterations"]] = [2.0, 3.0]
    table.loc[101, "solve_qp_unsolved"] = 1.0
    table.loc[98:101, "solve_restart"] = [1.0, 1.0, 1.0, FOLLOWED]
    metrics = run_metrics(table, "completed", reference, PARAMETERS.steering_limit)
    assert (metrics.late_solves, metrics.qp_fallbacks, metrics.unsolved_qps) == (3, 4, 1)
    assert metrics.restarts == 1
    assert metrics.sqp_iterations == pytest.approx(1.002)
