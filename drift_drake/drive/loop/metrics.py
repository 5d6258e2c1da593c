"""What is said of a run: tracking errors, how far it came, what the solver did."""

import dataclasses

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from drift_drake.common.arrays import Array
from drift_drake.drive.loop.actuation import PlanStatus
from drift_drake.drive.loop.endings import heads_backwards
from drift_drake.drive.mpc.mpc import FOLLOWED
from drift_drake.drive.reference.trajectory import Reference
from drift_drake.drive.screening.screen import ReadingKind

TURNED_ROUND = 0.5  # [s] at a run's end, from which on a car that heads backwards has not just begun to spin
GRID = 0.5  # [m] along the path
START = 0.1  # [s] until which there need not be a plan
STEADY_SIDESLIP = 0.2  # [rad] of the reference from which on it is a drift


@dataclasses.dataclass(frozen=True)
class RunMetrics:
    """Errors of the true states against the reference at the car's path position, up to the run's end or a spin."""

    outcome: str
    completed: bool
    completion: float  # share of the distance driven
    drifting: float  # share of the distance wanted in a steady drift that was driven in one; see `drifting_share`
    duration: float  # [s]
    rms_e: float  # [m]
    max_e: float  # [m]
    rms_sideslip_error: float  # [rad]
    rms_yaw_rate_error: float  # [rad/s]
    rms_speed_error: float  # [m/s]
    solves: int
    solver_failures: int
    line_search_failures: int
    sqp_iterations: float  # per solve, in the mean
    qp_fallbacks: int  # QPs that took a second attempt
    unsolved_qps: int  # that no attempt solved
    late_solves: int  # that took longer than the control period
    solve_ms_median: float
    solve_ms_99: float
    restarts: int = 0  # plans from a fresh guess that took the place of one that led no further
    missing_readings: int = 0  # control periods in which the sensors gave no finite reading
    stopped_readings: int = 0  # in which they gave a speed of zero or less
    jumped_readings: int = 0  # in which a reading was out of reach of the last good one
    frozen_readings: int = 0  # in which readings repeated themselves
    disagreeing_readings: int = 0  # in which a reading was far from what the model made of the last good one
    late_plans: int = 0  # control periods whose plan in force was late, or had ended
    missing_plans: int = 0  # without any plan in force
    refused_plans: int = 0  # samples of the plan's port that the actuator refused
    stopping_from: float | None = None  # [s] when the car began to be stopped, if it was

    def faults(self) -> str:
        """What was wrong in the loop and what followed, a line each; empty where nothing was."""
        counts = {
            name.replace("_", " "): count
            for name, count in dataclasses.asdict(self).items()
            if name.endswith(("_readings", "_plans")) and count
        }
        lines = ["faults: " + ", ".join(f"{count} {name}" for name, count in counts.items())] if counts else []
        if self.stopping_from is not None:
            lines.append(
                f"without a valid plan for too long, the car was brought to a stop from {self.stopping_from:.2f} s on"
            )
        return "".join(f"{line}\n" for line in lines)


def loop_faults(table: pd.DataFrame) -> dict[str, int]:
    """Counts of bad readings and plans in a run's table; none of those whose columns it lacks."""
    counts: dict[str, int] = {}
    if "reading" in table:
        kinds = table["reading"].to_numpy(dtype=int)
        counts |= {
            f"{kind.name.lower()}_readings": int((kinds == kind).sum())
            for kind in ReadingKind
            if kind != ReadingKind.GOOD
        }
    if "plan_status" not in table:
        return counts
    status, started = table["plan_status"].to_numpy(dtype=int), table["t"].to_numpy() > START
    return counts | {
        "late_plans": int(np.isin(status, (PlanStatus.LATE, PlanStatus.ENDED)).sum()),
        "missing_plans": int(((status == PlanStatus.MISSING) & started).sum()),
        "refused_plans": int(table["refused_plans"].iloc[-1]),
    }


def stopping_from(table: pd.DataFrame) -> float | None:
    """When the car began to be stopped [s], if it was."""
    if "stopping" not in table or not (table["stopping"] > 0.0).any():
        return None
    return float(table["t"][table["stopping"] > 0.0].iloc[0])


def before_spin(table: pd.DataFrame, steering_limit: float) -> pd.DataFrame:
    """The rows up to the last moment at which the sideslip was within the steering lock.

    Beyond it the front wheels can no longer point along the course: that is where the last spin of a run began. Of a
    car that has turned round, and may drive back with little sideslip, that is sought before it headed backwards.
    """
    ahead = np.flatnonzero(~heads_backwards(table["beta"].to_numpy(), table["dphi"].to_numpy()))
    headed = ahead[-1] + 1 if len(ahead) else 1
    if headed < len(table) and table["t"].iloc[-1] - table["t"].iloc[headed] >= TURNED_ROUND:
        table = table.iloc[:headed]
    within = np.flatnonzero(table["beta"].abs().to_numpy() <= steering_limit)
    return table.iloc[: within[-1] + 1 if len(within) else 1]


def steady_drifts(s: Array, beta: Array, reference: Reference) -> tuple[Array, NDArray[np.bool_]]:
    """(sideslip [n] in rad wanted along the reference's steady drifts, whether the car drifted there [n]).

    Drifting means at least half of the sideslip wanted, to the same side. Without this, a car that rounds the course in
    grip would pass for one that drifts.

    Args:
        s: path positions of a drive [rows] in m; beta: its sideslip there [rows] in rad.
    """
    grid = np.arange(0.0, reference.distance, GRID)
    wanted = reference.state(grid)[:, 2]
    steady = ~reference.transition(grid) & (np.abs(wanted) > STEADY_SIDESLIP)
    driven = np.interp(grid, np.maximum.accumulate(s), beta, right=0.0)
    return wanted[steady], (driven * np.sign(wanted) >= 0.5 * np.abs(wanted))[steady]


def drifting_share(table: pd.DataFrame, reference: Reference) -> float:
    """Share of the reference's `steady_drifts` over which the car drifted too; NaN where none is wanted."""
    _, drifted = steady_drifts(table["s"].to_numpy(dtype=float), table["beta"].to_numpy(dtype=float), reference)
    return float(np.mean(drifted)) if len(drifted) else float("nan")


def run_metrics(table: pd.DataFrame, outcome: str, reference: Reference, steering_limit: float) -> RunMetrics:
    """Numbers of one run.

    Errors of a run that spun are taken up to the beginning of the spin (the paper's Appendix B truncates "before the
    spin out"), by `before_spin`; how far it came and how long it took are those of the whole run.
    """
    s = table["s"].to_numpy(dtype=float)
    judged = before_spin(table, steering_limit) if outcome == "spin" else table
    wanted = reference.state(judged["s"].to_numpy(dtype=float))
    solves = table[table["solve_seconds"] > 0.0]
    milliseconds = 1e3 * solves["solve_seconds"].to_numpy(dtype=float)

    def rms(name: str, target: np.ndarray) -> float:
        return float(np.sqrt(np.mean((judged[name].to_numpy(dtype=float) - target) ** 2)))

    return RunMetrics(
        outcome=outcome,
        completed=outcome == "completed",
        completion=float(np.clip(s.max() / reference.distance, 0.0, 1.0)),
        drifting=drifting_share(table, reference),
        duration=float(table["t"].iloc[-1]),
        rms_e=rms("e", wanted[:, 4]),
        max_e=float(judged["e"].abs().max()),
        rms_sideslip_error=rms("beta", wanted[:, 2]),
        rms_yaw_rate_error=rms("r", wanted[:, 0]),
        rms_speed_error=rms("v", wanted[:, 1]),
        solves=len(solves),
        solver_failures=int(table["solve_failures"].iloc[-1]),
        line_search_failures=int((solves["solve_step"] == 0.0).sum()),
        sqp_iterations=float(solves["solve_iterations"].mean()),
        restarts=int((solves["solve_restart"] == FOLLOWED).sum()),
        qp_fallbacks=int(solves["solve_qp_fallbacks"].sum()),
        unsolved_qps=int(solves["solve_qp_unsolved"].sum()),
        late_solves=int((milliseconds > 1e3 * table["t"].diff().median()).sum()),
        solve_ms_median=float(np.median(milliseconds)) if len(solves) else float("nan"),
        solve_ms_99=float(np.quantile(milliseconds, 0.99)) if len(solves) else float("nan"),
        **loop_faults(table),
        stopping_from=stopping_from(table),
    )
