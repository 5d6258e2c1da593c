"""What is said of a run, on made-up runs."""

import numpy as np
import pandas as pd
import pytest

from drift_drake.car.parameters import VehicleParameters
from drift_drake.drive.loop.actuation import PlanStatus
from drift_drake.drive.loop.metrics import before_spin, drifting_share, run_metrics
from drift_drake.drive.mpc.mpc import FOLLOWED
from drift_drake.drive.reference.trajectory import Reference, figure_8, straight_line
from drift_drake.drive.screening.screen import ReadingKind

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


def test_a_car_that_turned_round_is_judged_until_it_began_to_turn(reference: Reference) -> None:
    table = on_the_reference(reference, share=0.5)
    table.loc[1700:1749, "beta"] = 1.0  # the spin; from there on it drives back, without sideslip
    table.loc[1750:, ["beta", "dphi", "e"]] = [0.0, 3.0, 5.0]
    table.loc[1750:, "s"] = table["s"].to_numpy()[1750] - 0.1 * np.arange(250)
    assert len(before_spin(table, PARAMETERS.steering_limit)) == 1700
    spun = run_metrics(table, "spin", reference, PARAMETERS.steering_limit)
    assert spun.max_e == 0.0
    assert spun.completion == pytest.approx(table["s"].max() / reference.distance)


def test_a_car_that_heads_backwards_for_less_than_half_a_second_has_just_begun_to_spin(reference: Reference) -> None:
    table = on_the_reference(reference).assign(t=0.01 * np.arange(2000), beta=0.0, dphi=0.0)
    for first, rows in ((1960, 2000), (1940, 1940)):  # for 0.39 s and 0.59 s, without sideslip
        assert len(before_spin(table.assign(dphi=np.where(table.index < first, 0.0, 3.0)), 0.6)) == rows


def test_a_run_beyond_the_end_of_the_reference_is_complete(reference: Reference) -> None:
    table = on_the_reference(reference)
    table.loc[1999, "s"] += 5.0
    assert run_metrics(table, "completed", reference, PARAMETERS.steering_limit).completion == 1.0


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


def made_up(reference: Reference) -> pd.DataFrame:
    """Ten rows of a run, a plan in eight of them."""
    table = on_the_reference(reference).iloc[:10].assign(t=0.01 * np.arange(10), solve_failures=[0.0] * 4 + [2.0] * 6)
    table["solve_seconds"] = [0.0, 0.004, 0.002, 0.003, 0.0, 0.010, 0.012, 0.001, 0.005, 0.006]
    table["solve_step"] = [0.0, 1.0, 0.0, 0.5, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0]
    table["solve_iterations"] = [9.0, 1.0, 2.0, 1.0, 9.0, 1.0, 3.0, 1.0, 1.0, 2.0]
    return table


def test_numbers_of_a_run_by_hand(reference: Reference) -> None:
    metrics = run_metrics(made_up(reference), "left the lane", reference, PARAMETERS.steering_limit)
    assert not metrics.completed
    assert metrics.outcome == "left the lane"
    assert metrics.duration == pytest.approx(0.09)
    assert metrics.completion == pytest.approx(9.0 / 1999.0)
    assert (metrics.solves, metrics.solver_failures, metrics.line_search_failures) == (8, 2, 2)
    assert metrics.sqp_iterations == pytest.approx(12.0 / 8.0)
    assert metrics.late_solves == 1  # longer than the 10 ms of a period, not as long
    assert metrics.solve_ms_median == pytest.approx(4.5)
    assert metrics.solve_ms_99 == pytest.approx(10.0 + 0.93 * 2.0)  # 0.99 of the way through eight
    assert metrics.faults() == ""


@pytest.mark.parametrize(("seconds", "late"), [(0.009995, 0), (0.010005, 1)])
def test_a_solve_is_late_by_any_time_over_the_period(reference: Reference, seconds: float, late: int) -> None:
    table = made_up(reference)
    table["solve_seconds"] = np.where(table.index == 7, seconds, 0.001)
    assert run_metrics(table, "completed", reference, PARAMETERS.steering_limit).late_solves == late


def test_faults_of_the_loop_are_counted_by_kind(reference: Reference) -> None:
    kinds = [ReadingKind.GOOD, ReadingKind.MISSING, ReadingKind.STOPPED, ReadingKind.STOPPED, ReadingKind.JUMPED,
             ReadingKind.FROZEN, ReadingKind.FROZEN, ReadingKind.FROZEN, ReadingKind.DISAGREEING,
             ReadingKind.GOOD]  # fmt: skip
    status = [PlanStatus.MISSING, PlanStatus.LATE, PlanStatus.ENDED, PlanStatus.MISSING, PlanStatus.MISSING]
    good = next(kind for kind in PlanStatus if kind.name not in ("MISSING", "LATE", "ENDED"))
    table = made_up(reference).assign(
        t=[0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9], reading=kinds, plan_status=[*status, *[good] * 5],
        refused_plans=[0.0] * 5 + [4.0] * 5, stopping=[0.0] * 7 + [1.0] * 3,
    )  # fmt: skip
    metrics = run_metrics(table, "left the lane", reference, PARAMETERS.steering_limit)
    readings = (metrics.missing_readings, metrics.stopped_readings, metrics.jumped_readings, metrics.frozen_readings,
                metrics.disagreeing_readings)  # fmt: skip
    assert readings == (1, 2, 1, 3, 1)
    # The first period may be without a plan; one that is late or has ended is late.
    assert (metrics.late_plans, metrics.missing_plans, metrics.refused_plans) == (2, 2, 4)
    assert metrics.stopping_from == pytest.approx(0.7)
    assert "3 frozen readings" in metrics.faults()
    assert "from 0.70 s on" in metrics.faults()
    calm = run_metrics(table.assign(stopping=0.0), "completed", reference, PARAMETERS.steering_limit)
    assert calm.stopping_from is None
    nothing = run_metrics(made_up(reference), "completed", reference, PARAMETERS.steering_limit)
    assert not any(value for name, value in vars(nothing).items() if name.endswith(("_readings", "_plans")))


def test_a_run_without_a_plan_has_no_times(reference: Reference) -> None:
    table = made_up(reference).assign(solve_seconds=0.0)
    metrics = run_metrics(table, "completed", reference, PARAMETERS.steering_limit)
    assert metrics.solves == 0
    assert np.isnan([metrics.solve_ms_median, metrics.solve_ms_99]).all()


def test_a_drift_of_just_half_the_sideslip_is_one(reference: Reference) -> None:
    """Every half metre counts: a drift that ends with the run's last metre is missed by that metre alone."""
    table = on_the_reference(reference)
    assert drifting_share(table.assign(beta=0.5 * table["beta"]), reference) > 0.99
    grid = np.arange(0.0, reference.distance, 0.5)
    wanted = reference.state(grid)[:, 2]
    steady = ~reference.transition(grid) & (np.abs(wanted) > 0.2)
    for driven in (0.3, 0.31, 0.7):
        run = on_the_reference(reference, share=driven)
        share = np.mean(grid[steady] <= run["s"].iloc[-1])
        assert drifting_share(run, reference) == pytest.approx(share, abs=1e-9)
