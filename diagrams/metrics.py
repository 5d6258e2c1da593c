"""What is said of a run: tracking errors, how far it came, what the solver did."""

import dataclasses

import numpy as np
import pandas as pd

from drift_drake.reference.trajectory import Reference


@dataclasses.dataclass(frozen=True)
class RunMetrics:
    """Errors of the true states against the reference at the car's path position, up to the run's end."""

    outcome: str
    completed: bool
    completion: float  # share of the distance driven
    duration: float  # [s]
    rms_e: float  # [m]
    max_e: float  # [m]
    rms_sideslip_error: float  # [rad]
    rms_yaw_rate_error: float  # [rad/s]
    rms_speed_error: float  # [m/s]
    solves: int
    solver_failures: int
    line_search_failures: int
    solve_ms_median: float
    solve_ms_99: float


def run_metrics(table: pd.DataFrame, outcome: str, reference: Reference, s_start: float = 0.0) -> RunMetrics:
    """Numbers of one run; a run that spun is judged up to the moment of the spin (as in the paper's Appendix B)."""
    s = table["s"].to_numpy(dtype=float)
    wanted = reference.state(s)
    solves = table[table["solve_seconds"] > 0.0]
    milliseconds = 1e3 * solves["solve_seconds"].to_numpy(dtype=float)

    def rms(name: str, target: np.ndarray) -> float:
        return float(np.sqrt(np.mean((table[name].to_numpy(dtype=float) - target) ** 2)))

    return RunMetrics(
        outcome=outcome,
        completed=outcome == "completed",
        completion=float(np.clip((s[-1] - s_start) / (reference.distance - s_start), 0.0, 1.0)),
        duration=float(table["t"].iloc[-1]),
        rms_e=rms("e", wanted[:, 4]),
        max_e=float(table["e"].abs().max()),
        rms_sideslip_error=rms("beta", wanted[:, 2]),
        rms_yaw_rate_error=rms("r", wanted[:, 0]),
        rms_speed_error=rms("v", wanted[:, 1]),
        solves=len(solves),
        solver_failures=int(table["solve_failures"].iloc[-1]),
        line_search_failures=int((solves["solve_step"] == 0.0).sum()),
        solve_ms_median=float(np.median(milliseconds)) if len(solves) else float("nan"),
        solve_ms_99=float(np.quantile(milliseconds, 0.99)) if len(solves) else float("nan"),
    )
